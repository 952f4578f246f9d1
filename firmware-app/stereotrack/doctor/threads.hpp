#pragma once

#include <string>

#include "config/configuration.hpp"
#include "firmware-app/runtime/real_time.hpp"

namespace stereotrack::doctor {

[[nodiscard]] inline runtime::ThreadPlan plan_of(const std::string& name, const config::ThreadConfig& thread) {
  return {name, thread.priority, thread.core};
}

/// Never kEnforce: a doctor goes on.
[[nodiscard]] inline runtime::RealTimeMode mode_of(const config::RealTimeConfig& realtime) {
  return realtime.mode == config::RealTimeMode::kOff ? runtime::RealTimeMode::kOff : runtime::RealTimeMode::kTry;
}

}  // namespace stereotrack::doctor
