#pragma once

#include <cstdint>
#include <string>

namespace stereotrack::daemon {

class Daemon;

/// All figures of the daemon as Prometheus text, exposition format 0.0.4. Service thread.
[[nodiscard]] std::string metrics_text(const Daemon& daemon, std::uint64_t session);

/// Writes the text to `path`, whole or not at all. False: it could not be, errno says why.
[[nodiscard]] bool write_metrics_file(const std::string& path, const std::string& text);

}  // namespace stereotrack::daemon
