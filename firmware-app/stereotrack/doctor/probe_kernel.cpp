#include "firmware-app/stereotrack/doctor/probe.hpp"
#include "firmware-app/stereotrack/doctor/tree.hpp"

namespace stereotrack::doctor {

namespace fs = std::filesystem;

namespace {

bool has(const std::string& text, const char* what) { return text.find(what) != std::string::npos; }

Preemption preemption_of(const fs::path& root, const std::string& version) {
  // "PREEMPT RT" is what kernels called it while it was a patch.
  const bool says_rt = has(version, "PREEMPT_RT") || has(version, "PREEMPT RT");
  if (says_rt || number_of(root / "sys/kernel/realtime").value_or(0) == 1) return Preemption::kRealTime;
  // Chosen at boot; only root may read it: "none voluntary (full)".
  const std::string choice = text_of(root / "sys/kernel/debug/sched/preempt");
  if (has(choice, "(full)") || has(choice, "(lazy)")) return Preemption::kFull;
  if (has(choice, "(voluntary)")) return Preemption::kVoluntary;
  if (has(choice, "(none)")) return Preemption::kNone;
  if (has(version, "PREEMPT_DYNAMIC")) {
    // What it is told at boot, else what distributions build: voluntary.
    const std::string boot = text_of(root / "proc/cmdline");
    if (has(boot, "preempt=full") || has(boot, "preempt=lazy")) return Preemption::kFull;
    if (has(boot, "preempt=none")) return Preemption::kNone;
    return has(boot, "preempt=voluntary") ? Preemption::kVoluntary : Preemption::kUnknown;
  }
  if (has(version, "PREEMPT")) return Preemption::kFull;
  return version.empty() ? Preemption::kUnknown
                         : Preemption::kVoluntary;  // or none: its version does not tell them apart
}

}  // namespace

const char* to_string(Preemption preemption) noexcept {
  switch (preemption) {
    case Preemption::kNone: return "none";
    case Preemption::kVoluntary: return "voluntary";
    case Preemption::kFull: return "full";
    case Preemption::kRealTime: return "rt";
    case Preemption::kUnknown: break;
  }
  return "unknown";
}

KernelFacts probe_kernel(const fs::path& root) {
  KernelFacts facts;
  facts.board = text_of(root / "proc/device-tree/model");
  if (facts.board.empty()) facts.board = text_of(root / "sys/class/dmi/id/product_name");
  facts.release = text_of(root / "proc/sys/kernel/osrelease");
  facts.version = text_of(root / "proc/sys/kernel/version");
  facts.architecture = text_of(root / "proc/sys/kernel/arch");  // from Linux 6.1 on
  facts.preemption = preemption_of(root, facts.version);
  facts.rt_runtime_us = number_of(root / "proc/sys/kernel/sched_rt_runtime_us");
  return facts;
}

}  // namespace stereotrack::doctor
