#include <algorithm>
#include <charconv>

#include "firmware-app/stereotrack/doctor/probe.hpp"
#include "firmware-app/stereotrack/doctor/tree.hpp"

namespace stereotrack::doctor {

namespace fs = std::filesystem;

namespace {

/// How many "0-3,5" are.
int count_of(const std::string& list) {
  int count = 0;
  const char* at = list.data();
  const char* const end = at + list.size();
  while (at < end) {
    int first = 0;
    const auto begin = std::from_chars(at, end, first);
    if (begin.ec != std::errc()) return count;
    int last = first;
    at = begin.ptr;
    if (at < end && *at == '-') {
      const auto range = std::from_chars(at + 1, end, last);
      if (range.ec != std::errc()) return count;
      at = range.ptr;
    }
    count += std::max(0, last - first + 1);
    if (at < end) ++at;  // the comma
  }
  return count;
}

}  // namespace

CpuFacts probe_cpu(const fs::path& root) {
  CpuFacts facts;
  const fs::path cpus = root / "sys/devices/system/cpu";
  facts.cores = count_of(text_of(cpus / "online"));
  facts.isolated = text_of(cpus / "isolated");
  for (const std::string& policy : names_in(cpus / "cpufreq", "policy")) {
    const fs::path folder = cpus / "cpufreq" / policy;
    const std::string governor = text_of(folder / "scaling_governor");
    if (!governor.empty() &&
        std::find(facts.governors.begin(), facts.governors.end(), governor) == facts.governors.end()) {
      facts.governors.push_back(governor);
    }
    const auto most_khz = number_of(folder / "cpuinfo_max_freq");
    facts.max_mhz = std::max(facts.max_mhz, static_cast<int>(most_khz.value_or(0) / 1000));
  }
  facts.sleep_states = static_cast<int>(names_in(cpus / "cpu0/cpuidle", "state").size());
  const fs::path zones = root / "sys/class/thermal";
  for (const std::string& zone : names_in(zones, "thermal_zone")) {
    if (const auto milli = number_of(zones / zone / "temp")) {
      facts.hottest_c = std::max(facts.hottest_c.value_or(-273.0), static_cast<double>(*milli) * 1e-3);
    }
  }
  // A Raspberry Pi's firmware: bits 0..3 now, 16..19 since power-on; hexadecimal, without 0x.
  const std::string bits = text_of(root / "sys/devices/platform/soc/soc:firmware/get_throttled");
  if (std::uint64_t value = 0;
      !bits.empty() && std::from_chars(bits.data(), bits.data() + bits.size(), value, 16).ec == std::errc()) {
    facts.throttled = value != 0;
  }
  return facts;
}

}  // namespace stereotrack::doctor
