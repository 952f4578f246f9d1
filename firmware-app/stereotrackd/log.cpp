#include "firmware-app/stereotrackd/log.hpp"

#include <sys/stat.h>
#include <sys/uio.h>
#include <systemd/sd-journal.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <vector>

namespace stereotrack::daemon {

namespace {

// systemd names device and inode of the stream that it gave as stderr; who was redirected since must write there.
bool stderr_is_the_journal() {
  const char* stream = std::getenv("JOURNAL_STREAM");
  struct stat status {};
  if (stream == nullptr || fstat(STDERR_FILENO, &status) != 0) return false;
  return std::string(stream) == std::to_string(status.st_dev) + ':' + std::to_string(status.st_ino);
}

}  // namespace

void log(LogLevel level, const std::string& message, std::initializer_list<LogField> fields) {
  static const bool kJournal = stderr_is_the_journal();
  if (kJournal) {
    std::vector<std::string> texts{"MESSAGE=" + message, "PRIORITY=" + std::to_string(static_cast<int>(level))};
    for (const auto& [name, value] : fields) texts.push_back(std::string(name) + '=' + value);
    std::vector<iovec> parts;
    parts.reserve(texts.size());
    for (std::string& text : texts) parts.push_back({text.data(), text.size()});
    if (sd_journal_sendv(parts.data(), static_cast<int>(parts.size())) == 0) return;
  }
  // One write a line, so that lines of several threads do not mix.
  const std::string line = std::string(program_invocation_short_name) + ": " + message + '\n';
  (void)std::fputs(line.c_str(), stderr);
}

}  // namespace stereotrack::daemon
