#include "firmware-app/runtime/clock.hpp"
#include "firmware-app/stereotrack/doctor/probe.hpp"
#include "firmware-app/stereotrack/doctor/tree.hpp"

namespace stereotrack::doctor {

ClockFacts probe_clocks(const std::filesystem::path& root) {
  ClockFacts facts;
  const std::filesystem::path source = root / "sys/devices/system/clocksource/clocksource0";
  facts.source = text_of(source / "current_clocksource");
  facts.available = words_of(text_of(source / "available_clocksource"));
  for (const std::string& name : names_in(root / "dev", "ptp")) facts.ptp.push_back("/dev/" + name);
  if (const auto error = runtime::read_tai().error) facts.tai_error_us = static_cast<double>(error->count()) * 1e-3;
  return facts;
}

}  // namespace stereotrack::doctor
