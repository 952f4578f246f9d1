#include "firmware-app/stereotrack/doctor/pulses.hpp"

#include <algorithm>
#include <stdexcept>

#include "firmware-app/runtime/clock.hpp"
#include "firmware-app/stereotrack/doctor/threads.hpp"

namespace stereotrack::doctor {

namespace {

constexpr std::chrono::milliseconds kLongestWait{100};  // so that it ends in time

}  // namespace

Pulses::Pulses(const config::Configuration& configuration) {
  if (configuration.trigger.mode == config::TriggerMode::kExternal) return;
  try {
    trigger_ = open_trigger(configuration);
    if (trigger_.pwm) trigger_.pwm->start();
    if (!trigger_.train) return;
    const config::RealTimeConfig& realtime = configuration.realtime;
    thread_ = std::make_unique<runtime::Thread>(plan_of("st-trigger", realtime.trigger), mode_of(realtime),
                                                [this] { give(); });
    thread_->begin();
  } catch (const std::runtime_error& error) {
    problem_ = error.what();
  }
}

Pulses::~Pulses() {
  stop_.store(true, std::memory_order_relaxed);
  if (thread_) thread_->join();
}

void Pulses::give() noexcept {
  while (!stop_.load(std::memory_order_relaxed)) {
    const MonotonicTime now = runtime::monotonic_now();
    runtime::sleep_until(std::min<MonotonicTime>(trigger_.train->step(now), now + kLongestWait));
  }
  trigger_.train->end(runtime::monotonic_now());
}

}  // namespace stereotrack::doctor
