#include "firmware-app/stereotrack/doctor/pulses.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <thread>

#include "drivers/gpio/simulated_chip.hpp"

namespace stereotrack::doctor {
namespace {

namespace sim = gpio::simulated_chip;
using std::chrono::milliseconds;
using ::testing::HasSubstr;

config::Configuration configured(config::TriggerMode mode) {
  config::Configuration configuration;
  configuration.source.name = "cameras";
  configuration.camera.fps = 200;
  configuration.realtime.mode = config::RealTimeMode::kOff;
  configuration.trigger.mode = mode;
  configuration.trigger.line = "sim:doctor-pulses";
  configuration.trigger.pwm_chip = "pwmchip-of-nobody";
  return configuration;
}

TEST(DoctorPulses, AreGivenWhileTheyLiveAndLeaveTheLineInactive) {
  std::uint64_t given = 0;
  {
    const Pulses pulses(configured(config::TriggerMode::kGpio));
    EXPECT_EQ(pulses.problem(), "");
    while (pulses.given() < 5) std::this_thread::sleep_for(milliseconds(1));
    given = pulses.given();
  }
  EXPECT_GE(sim::edges("doctor-pulses"), 2 * given);
  EXPECT_EQ(sim::level("doctor-pulses"), false);
}

TEST(DoctorPulses, OtherModesDriveNothing) {
  for (const auto mode :
       {config::TriggerMode::kFreeRun, config::TriggerMode::kUnseen, config::TriggerMode::kExternal}) {
    const Pulses pulses(configured(mode));
    EXPECT_EQ(pulses.problem(), "");
    EXPECT_EQ(pulses.given(), 0U);
  }
}

TEST(DoctorPulses, WhyThereAreNoneIsALine) {
  const Pulses pulses(configured(config::TriggerMode::kPwm));
  EXPECT_THAT(pulses.problem(), HasSubstr("PWM pwmchip-of-nobody: no such chip"));
}

}  // namespace
}  // namespace stereotrack::doctor
