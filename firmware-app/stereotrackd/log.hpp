#pragma once

#include <initializer_list>
#include <string>
#include <string_view>
#include <utility>

namespace stereotrack::daemon {

/// What a line is worth: numbers of syslog, as the journal filters them.
enum class LogLevel : unsigned char { kError = 3, kWarning = 4, kNotice = 5, kInfo = 6 };

/// NAME=value of the journal: names in capitals, digits and underscores.
using LogField = std::pair<std::string_view, std::string>;

/// One line. To the journal with its fields where stderr is a journal stream, as under systemd (`journalctl
/// STEREOTRACK_CAUSE=predicted_late`); else to stderr as text: "program: message". Never from a real-time thread. Any
/// number of others.
void log(LogLevel level, const std::string& message, std::initializer_list<LogField> fields = {});

}  // namespace stereotrack::daemon
