#include <utility>

#include "firmware-app/rig/trigger.hpp"
#include "firmware-app/stereotrack/doctor/probe.hpp"
#include "firmware-app/stereotrack/doctor/threads.hpp"

namespace stereotrack::doctor {

std::vector<runtime::Missing> ask_rights(const config::Configuration& configuration) {
  const config::RealTimeConfig& realtime = configuration.realtime;
  if (realtime.mode == config::RealTimeMode::kOff) return {};
  std::vector<runtime::Missing> missing;
  {
    const runtime::RealTimeProcess process({.deep_sleep = realtime.deep_sleep});
    missing = process.missing();
  }
  std::vector<std::pair<const char*, config::ThreadConfig>> threads{{"st-publisher", realtime.publisher},
                                                                    {"st-capture", realtime.capture},
                                                                    {"st-frames", realtime.frames},
                                                                    {"st-service", realtime.service}};
  if (trigger_output(configuration)) threads.emplace_back("st-trigger", realtime.trigger);
  for (const auto& [name, thread] : threads) {
    const runtime::Thread asked(plan_of(name, thread), runtime::RealTimeMode::kTry, [] {});
    missing.insert(missing.end(), asked.missing().begin(), asked.missing().end());
  }
  return missing;
}

}  // namespace stereotrack::doctor
