#include "drivers/trigger/pwm.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <memory>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>

#include "tests/support/temp_dir.hpp"

// On a folder tree laid out like sysfs. What a kernel does when a channel is exported, a thread does here; what it
// refuses is not simulated.
namespace stereotrack::trigger {
namespace {

namespace fs = std::filesystem;
using std::chrono::milliseconds;

void write(const fs::path& path, const std::string& text) { std::ofstream(path) << text << '\n'; }
std::string read(const fs::path& path) {
  std::ifstream file(path);
  std::string line;
  std::getline(file, line);
  return line;
}

class Sysfs {
 public:
  Sysfs() {
    chip("pwmchip0", "fe20c000.pwm", 2);
    chip("pwmchip10", "1-0040.pca9685", 16);
    fs::create_directories(root() / "not-a-chip");
  }
  ~Sysfs() {
    stop_.store(true);
    if (kernel_.joinable()) kernel_.join();
  }
  Sysfs(const Sysfs&) = delete;
  Sysfs& operator=(const Sysfs&) = delete;

  [[nodiscard]] fs::path root() const { return dir_.path() / "class" / "pwm"; }
  [[nodiscard]] fs::path channel(int number) const { return root() / "pwmchip0" / ("pwm" + std::to_string(number)); }

  void make_channel(int number) const {
    fs::create_directories(channel(number));
    write(channel(number) / "period", "0");
    write(channel(number) / "duty_cycle", "0");
    write(channel(number) / "polarity", "normal");
    write(channel(number) / "enable", "0");
  }

  /// Channel 1 comes a moment after it was asked for.
  void export_when_asked() {
    kernel_ = std::thread([this] {
      while (!stop_.load() && read(root() / "pwmchip0" / "export") != "1") {
        std::this_thread::sleep_for(milliseconds(1));
      }
      std::this_thread::sleep_for(milliseconds(30));
      if (!stop_.load()) make_channel(1);
    });
  }

  [[nodiscard]] Pwm::Config config(const std::string& chip, unsigned channel) const {
    return {.chip = chip,
            .channel = channel,
            .period = milliseconds(20),
            .width = std::chrono::microseconds(500),
            .root = root().string()};
  }

 private:
  void chip(const std::string& name, const std::string& device, int channels) const {
    const fs::path of_device = dir_.path() / "devices" / device;
    fs::create_directories(of_device);
    fs::create_directories(root() / name);
    fs::create_directory_symlink(of_device, root() / name / "device");
    write(root() / name / "npwm", std::to_string(channels));
    write(root() / name / "export", "");
    write(root() / name / "unexport", "");
  }

  test::TempDir dir_;
  std::atomic<bool> stop_{false};
  std::thread kernel_;
};

std::string refusal(const Pwm::Config& config) {
  try {
    const Pwm pwm(config);
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  return {};
}

TEST(Pwm, AChannelIsExportedSetUpStartedAndLeftAsItWas) {
  Sysfs sysfs;
  sysfs.export_when_asked();
  const fs::path channel = sysfs.channel(1);
  {
    Pwm pwm(sysfs.config("pwmchip0", 1));
    EXPECT_EQ(pwm.name(), "pwmchip0 (fe20c000.pwm), channel 1");
    EXPECT_EQ(read(channel / "period"), "20000000");
    EXPECT_EQ(read(channel / "duty_cycle"), "0");
    EXPECT_EQ(read(channel / "enable"), "0");  // not before it is asked to
    pwm.start();
    EXPECT_EQ(read(channel / "duty_cycle"), "500000");
    EXPECT_EQ(read(channel / "enable"), "1");
    EXPECT_TRUE(pwm.stop());
    EXPECT_EQ(read(channel / "enable"), "0");
    EXPECT_EQ(read(channel / "duty_cycle"), "0");
    pwm.start();
    EXPECT_TRUE(pwm.hold_safe());
    EXPECT_EQ(read(channel / "enable"), "0");
    pwm.start();
    EXPECT_EQ(read(sysfs.root() / "pwmchip0" / "unexport"), "");
  }
  EXPECT_EQ(read(channel / "enable"), "0");
  EXPECT_EQ(read(sysfs.root() / "pwmchip0" / "unexport"), "1");
}

TEST(Pwm, WhatSomebodyElseExportedStaysExported) {
  Sysfs sysfs;
  sysfs.make_channel(0);
  write(sysfs.channel(0) / "period", "1000");
  write(sysfs.channel(0) / "duty_cycle", "900");
  {
    Pwm::Config inversed = sysfs.config("0", 0);
    inversed.active_low = true;
    Pwm pwm(inversed);
    EXPECT_EQ(read(sysfs.channel(0) / "polarity"), "inversed");
    pwm.start();
    EXPECT_EQ(read(sysfs.channel(0) / "enable"), "1");
  }
  EXPECT_EQ(read(sysfs.channel(0) / "enable"), "0");
  EXPECT_EQ(read(sysfs.root() / "pwmchip0" / "export"), "");
  EXPECT_EQ(read(sysfs.root() / "pwmchip0" / "unexport"), "");
}

TEST(Pwm, AChipIsNamedByItselfItsNumberItsPathOrItsDevice) {
  const Sysfs sysfs;
  for (const std::string& name : {std::string("pwmchip10"), std::string("10"), std::string("1-0040.pca9685"),
                                  (sysfs.root() / "pwmchip10").string()}) {
    EXPECT_EQ(find_pwm(sysfs.config(name, 15)).name, "pwmchip10") << name;
  }
  ASSERT_EQ(pwm_chips(sysfs.root().string()).size(), 2U);
  EXPECT_EQ(pwm_chips(sysfs.root().string())[0].device, "fe20c000.pwm");
  EXPECT_TRUE(pwm_chips(sysfs.root().string())[0].exported.empty());
  sysfs.make_channel(1);
  EXPECT_EQ(pwm_chips(sysfs.root().string())[0].exported, std::vector<unsigned>{1});
  EXPECT_TRUE(pwm_chips((sysfs.root() / "none").string()).empty());
}

TEST(Pwm, WhatCannotBeHadIsOneLineWithTheWayOut) {
  Sysfs sysfs;
  EXPECT_EQ(refusal(sysfs.config("pwmchip3", 0)),
            "PWM pwmchip3: no such chip in " + sysfs.root().string() +
                ": there are pwmchip0 (fe20c000.pwm), pwmchip10 (1-0040.pca9685)");
  EXPECT_EQ(refusal(sysfs.config("pwmchip0", 2)),
            "PWM pwmchip0 (fe20c000.pwm), channel 2: no such channel: it has 2, from 0");
  Pwm::Config nowhere = sysfs.config("0", 0);
  nowhere.root = (sysfs.root() / "none").string();
  EXPECT_NE(refusal(nowhere).find("there is none, does the board's device tree enable one?"), std::string::npos);
  sysfs.make_channel(0);
  write(sysfs.channel(0) / "enable", "1");
  EXPECT_NE(refusal(sysfs.config("0", 0)).find("it is on already"), std::string::npos);
  EXPECT_EQ(read(sysfs.channel(0) / "enable"), "1");
}

TEST(Pwm, AfterACrashItIsTurnedOff) {
  const Sysfs sysfs;
  EXPECT_EQ(set_pwm_safe(sysfs.config("0", 0)), "PWM pwmchip0 (fe20c000.pwm), channel 0: nobody uses it");
  sysfs.make_channel(0);
  write(sysfs.channel(0) / "period", "20000000");
  write(sysfs.channel(0) / "duty_cycle", "500000");
  write(sysfs.channel(0) / "enable", "1");
  EXPECT_EQ(set_pwm_safe(sysfs.config("0", 0)), "PWM pwmchip0 (fe20c000.pwm), channel 0: off");
  EXPECT_EQ(read(sysfs.channel(0) / "enable"), "0");
  EXPECT_EQ(read(sysfs.channel(0) / "duty_cycle"), "0");
}

}  // namespace
}  // namespace stereotrack::trigger
