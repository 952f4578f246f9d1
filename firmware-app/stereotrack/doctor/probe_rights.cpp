#include <algorithm>

#include "firmware-app/stereotrack/doctor/probe.hpp"
#include "firmware-app/stereotrack/doctor/threads.hpp"

namespace stereotrack::doctor {

std::vector<runtime::Missing> ask_rights(const config::RealTimeConfig& realtime) {
  if (realtime.mode == config::RealTimeMode::kOff) return {};
  std::vector<runtime::Missing> missing;
  {
    const runtime::RealTimeProcess process({.deep_sleep = realtime.deep_sleep});
    missing = process.missing();
  }
  for (const auto& [name, thread] : {std::pair{"st-publisher", realtime.publisher},
                                     {"st-capture", realtime.capture},
                                     {"st-frames", realtime.frames},
                                     {"st-service", realtime.service}}) {
    const runtime::Thread asked(plan_of(name, thread), runtime::RealTimeMode::kTry, [] {});
    missing.insert(missing.end(), asked.missing().begin(), asked.missing().end());
  }
  return missing;
}

}  // namespace stereotrack::doctor
