#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <string>

#include "config/configuration.hpp"
#include "firmware-app/rig/trigger.hpp"
#include "firmware-app/runtime/real_time.hpp"

namespace stereotrack::doctor {

/// Cameras that wait for our trigger give no frame without it: the pulses of trigger.mode = gpio or pwm, as the daemon
/// would give them, while one of these lives. The line or output is inactive before and after. Nothing for other modes.
class Pulses {
 public:
  /// Never throws but std::bad_alloc: why there are none stands in problem().
  explicit Pulses(const config::Configuration& configuration);
  Pulses(const Pulses&) = delete;
  Pulses& operator=(const Pulses&) = delete;
  ~Pulses();

  /// One line; empty: all is well.
  [[nodiscard]] const std::string& problem() const { return problem_; }
  /// By the line; hardware does not tell.
  [[nodiscard]] std::uint64_t given() const { return trigger_.train ? trigger_.train->counters().given.get() : 0; }

 private:
  void give() noexcept;

  TriggerSetup trigger_;
  std::string problem_;
  std::atomic<bool> stop_{false};
  std::unique_ptr<runtime::Thread> thread_;
};

}  // namespace stereotrack::doctor
