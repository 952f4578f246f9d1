#include "drivers/trigger/pwm.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <filesystem>
#include <fstream>
#include <optional>
#include <stdexcept>
#include <string_view>
#include <system_error>
#include <thread>

namespace stereotrack::trigger {

namespace {

namespace fs = std::filesystem;

constexpr std::chrono::milliseconds kUdevPatience{1000};  // to hand a channel that was just exported to its group
constexpr std::chrono::milliseconds kUdevRound{10};
constexpr std::string_view kPrefix = "pwmchip";
constexpr std::string_view kChannelPrefix = "pwm";

/// None: it is no number, or none of a chip or channel.
std::optional<unsigned> number_of(std::string_view text) {
  if (text.empty() || text.size() > 5 || text.find_first_not_of("0123456789") != std::string_view::npos) return {};
  return static_cast<unsigned>(std::stoul(std::string(text)));
}

/// What follows the prefix, of each entry of a folder that has it and a number.
std::vector<unsigned> numbers_in(const fs::path& folder, std::string_view prefix) {
  std::vector<unsigned> numbers;
  std::error_code error;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, error)) {
    const std::string name = entry.path().filename().string();
    if (!name.starts_with(prefix)) continue;
    if (const auto number = number_of(std::string_view(name).substr(prefix.size()))) numbers.push_back(*number);
  }
  std::sort(numbers.begin(), numbers.end());
  return numbers;
}

/// The first line; none: it cannot be read.
std::optional<std::string> read_line(const std::string& path) {
  std::ifstream file(path);
  std::string line;
  if (!std::getline(file, line)) return std::nullopt;
  return line;
}

/// 0, or an errno.
int write_text(const std::string& path, std::string_view text) {
  const int fd = open(path.c_str(), O_WRONLY | O_TRUNC | O_CLOEXEC);
  if (fd < 0) return errno;
  const bool whole = write(fd, text.data(), text.size()) == static_cast<ssize_t>(text.size());
  const int error = whole ? 0 : errno;
  (void)close(fd);
  return error;
}

[[noreturn]] void refuse(const std::string& name, const std::string& what) {
  throw std::runtime_error("PWM " + name + ": " + what);
}

std::string way_out(int error) {
  switch (error) {
    case EACCES:
    case EPERM: return ": let a udev rule give /sys/class/pwm to a group, and the daemon be in it";
    case EBUSY: return ": a driver of the kernel's has it: choose another channel";
    case EINVAL:
    case ERANGE: return ": the hardware cannot do that: change trigger.pulse_us or camera.fps";
    default: return "";
  }
}

void set(const std::string& name, const std::string& path, const std::string& text) {
  const int error = write_text(path, text);
  if (error == 0) return;
  refuse(name, path + " refuses " + text + ": " + std::generic_category().message(error) + way_out(error));
}

std::string folder_of(const Pwm::Config& config, const PwmChip& chip) { return config.root + '/' + chip.name; }

std::string channel_folder(const Pwm::Config& config, const PwmChip& chip) {
  return folder_of(config, chip) + "/pwm" + std::to_string(config.channel);
}

std::string name_of(const Pwm::Config& config, const PwmChip& chip) {
  return chip.name + (chip.device.empty() ? "" : " (" + chip.device + ")") + ", channel " +
         std::to_string(config.channel);
}

bool write_zero(int fd) noexcept { return fd < 0 || pwrite(fd, "0\n", 2, 0) == 2; }

}  // namespace

std::vector<PwmChip> pwm_chips(const std::string& root) {
  std::vector<PwmChip> chips;
  for (const unsigned number : numbers_in(root, kPrefix)) {
    PwmChip& chip = chips.emplace_back();
    chip.name = std::string(kPrefix) + std::to_string(number);
    const fs::path folder = fs::path(root) / chip.name;
    std::error_code error;
    const fs::path device = fs::canonical(folder / "device", error);
    if (!error) chip.device = device.filename().string();
    chip.channels = number_of(read_line(folder / "npwm").value_or("")).value_or(0);
    chip.exported = numbers_in(folder, kChannelPrefix);
  }
  return chips;
}

PwmChip find_pwm(const Pwm::Config& config) {
  const std::vector<PwmChip> chips = pwm_chips(config.root);
  const std::string wanted = config.chip.substr(config.chip.rfind('/') + 1);  // of a path, its name
  std::string there;
  const PwmChip* found = nullptr;
  for (const PwmChip& chip : chips) {
    const bool is_it = chip.name == wanted || chip.name == std::string(kPrefix) + wanted || chip.device == wanted;
    if (is_it && found != nullptr) refuse(config.chip, "two chips have this name: give pwmchipN");
    if (is_it) found = &chip;
    there += (there.empty() ? "" : ", ") + chip.name + (chip.device.empty() ? "" : " (" + chip.device + ")");
  }
  if (found == nullptr) {
    refuse(config.chip,
           "no such chip in " + config.root + ": " +
               (there.empty() ? "there is none, does the board's device tree enable one?" : "there are " + there));
  }
  if (config.channel >= found->channels) {
    refuse(name_of(config, *found), "no such channel: it has " + std::to_string(found->channels) + ", from 0");
  }
  return *found;
}

Pwm::Pwm(const Config& config) : config_(config) {
  const PwmChip chip = find_pwm(config_);
  chip_folder_ = folder_of(config_, chip);
  folder_ = channel_folder(config_, chip);
  name_ = name_of(config_, chip);
  if (!fs::exists(folder_)) {
    set(name_, chip_folder_ + "/export", std::to_string(config_.channel));
    exported_ = true;
  }
  try {
    set_up();
  } catch (...) {
    let_go();
    throw;
  }
}

void Pwm::set_up() {
  const auto until = std::chrono::steady_clock::now() + kUdevPatience;
  const std::string enable = folder_ + "/enable";
  const std::string duty = folder_ + "/duty_cycle";
  while (access(enable.c_str(), W_OK) != 0 && std::chrono::steady_clock::now() < until) {
    std::this_thread::sleep_for(kUdevRound);
  }
  if (read_line(enable) == "1") {
    refuse(name_,
           "it is on already, somebody uses it: choose another channel; after a crash of ours, "
           "stereotrackd --safe-lines turns it off");
  }
  // A period under the duty cycle that was is refused, and so is a duty cycle where there is no period yet.
  if (read_line(folder_ + "/period").value_or("0") != "0") set(name_, duty, "0");
  set(name_, folder_ + "/period", std::to_string(config_.period.count()));
  const std::string polarity = config_.active_low ? "inversed" : "normal";
  if (read_line(folder_ + "/polarity").value_or("normal") != polarity) {
    const int error = write_text(folder_ + "/polarity", polarity);
    if (error != 0) {
      refuse(name_, "its driver cannot be active " + std::string(config_.active_low ? "low" : "high") + ": " +
                        std::generic_category().message(error) + ": set trigger.active to the other");
    }
  }
  duty_ = open(duty.c_str(), O_WRONLY | O_CLOEXEC);
  enable_ = open(enable.c_str(), O_WRONLY | O_CLOEXEC);
  if (duty_ < 0 || enable_ < 0) {
    const int error = errno;
    refuse(name_, enable + ": " + std::generic_category().message(error) + way_out(error));
  }
}

void Pwm::let_go() noexcept {
  for (const int fd : {enable_, duty_}) {
    if (fd >= 0) (void)close(fd);
  }
  enable_ = duty_ = -1;
  if (!exported_) return;
  try {
    (void)write_text(chip_folder_ + "/unexport", std::to_string(config_.channel));
  } catch (const std::exception&) {  // no memory for the path: it stays exported
  }
}

Pwm::~Pwm() {
  (void)stop();
  let_go();
}

void Pwm::start() {
  set(name_, folder_ + "/duty_cycle", std::to_string(config_.width.count()));
  set(name_, folder_ + "/enable", "1");
}

bool Pwm::stop() noexcept { return hold_safe(); }

bool Pwm::hold_safe() noexcept {
  const bool inactive = write_zero(duty_);
  return write_zero(enable_) && inactive;
}

std::string set_pwm_safe(const Pwm::Config& config) {
  const PwmChip chip = find_pwm(config);
  const std::string name = name_of(config, chip);
  const std::string folder = channel_folder(config, chip);
  if (!fs::exists(folder)) return "PWM " + name + ": nobody uses it";
  if (read_line(folder + "/period").value_or("0") != "0") set(name, folder + "/duty_cycle", "0");
  set(name, folder + "/enable", "0");
  return "PWM " + name + ": off";
}

}  // namespace stereotrack::trigger
