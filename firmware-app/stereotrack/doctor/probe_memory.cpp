#include <unistd.h>

#include <pwd.h>

#include "firmware-app/stereotrack/doctor/probe.hpp"
#include "firmware-app/stereotrack/doctor/tree.hpp"

namespace stereotrack::doctor {

namespace fs = std::filesystem;

MemoryFacts probe_memory(const fs::path& root) {
  MemoryFacts facts;
  const std::string info = text_of(root / "proc/meminfo");
  const auto mb = [&info](const char* key) { return number_in(info, key).value_or(0) / 1024; };
  facts.total_mb = mb("MemTotal:");
  facts.available_mb = mb("MemAvailable:");
  facts.swap_mb = mb("SwapTotal:");
  facts.cma_mb = mb("CmaTotal:");
  facts.dma_heaps = names_in(root / "dev/dma_heap");
  return facts;
}

LimitFacts probe_limits(const fs::path& root) {
  LimitFacts facts;
  const passwd* const entry = ::getpwuid(::geteuid());
  facts.user = entry == nullptr ? std::to_string(::geteuid()) : entry->pw_name;
  const std::string limits = text_of(root / "proc/self/limits");
  if (const auto bytes = number_in(limits, "Max locked memory")) facts.locked_kb = *bytes / 1024;
  facts.priority = static_cast<int>(number_in(limits, "Max realtime priority").value_or(0));
  return facts;
}

}  // namespace stereotrack::doctor
