#pragma once

#include <filesystem>
#include <vector>

#include "config/configuration.hpp"
#include "firmware-app/stereotrack/doctor/findings.hpp"

namespace stereotrack::doctor {

// `root` is where sys/, proc/ and dev/ lie: "/", or a tree that is laid out like a board. What is not there is not
// told: members keep their defaults. Nothing is written, nothing throws but std::bad_alloc.

[[nodiscard]] KernelFacts probe_kernel(const std::filesystem::path& root);
[[nodiscard]] CpuFacts probe_cpu(const std::filesystem::path& root);
[[nodiscard]] MemoryFacts probe_memory(const std::filesystem::path& root);
/// The source by `root`; TAI is asked of the kernel that runs.
[[nodiscard]] ClockFacts probe_clocks(const std::filesystem::path& root);
[[nodiscard]] LimitFacts probe_limits(const std::filesystem::path& root);

// Of the machine that runs.

/// What the daemon would ask for with this configuration and not be granted: memory, deep sleep, each thread's priority
/// and core. Asks as the daemon does and lets go again; nothing with realtime.mode = "off".
[[nodiscard]] std::vector<runtime::Missing> ask_rights(const config::Configuration& configuration);

/// All cameras, of all drivers. Waits for libcamera, where there is a module for it.
[[nodiscard]] CamerasFound probe_cameras();

/// The lines that the configuration names, looked up: none is requested or driven.
[[nodiscard]] std::vector<LineFound> probe_lines(const config::Configuration& configuration);

}  // namespace stereotrack::doctor
