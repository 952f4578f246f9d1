#include "drivers/record/torn.hpp"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <optional>
#include <stdexcept>
#include <system_error>

#include "drivers/record/black_box.hpp"
#include "drivers/record/recording_source.hpp"

namespace stereotrack::record {

namespace fs = std::filesystem;

namespace {

constexpr const char* kWhole = ".strec";
constexpr const char* kPart = ".strec.part";

/// Its writer holds a lock as long as it lives.
bool is_written(const fs::path& part) {
  const int file = ::open(part.c_str(), O_RDONLY | O_CLOEXEC);
  if (file < 0) return false;
  const bool held = ::flock(file, LOCK_EX | LOCK_NB) != 0;
  ::close(file);
  return held;
}

/// Empty: nothing can be read of it.
std::optional<bool> is_whole(const fs::path& part) {
  try {
    return RecordingSource(part.string()).warning().empty();
  } catch (const std::runtime_error&) {
    return std::nullopt;
  }
}

std::string keep(const fs::path& part) {
  const std::string path = part.string();
  const std::string name = path.substr(0, path.size() - std::string(kPart).size());
  const std::optional<bool> whole = is_whole(part);
  std::error_code error;
  if (!whole) {
    fs::remove(part, error);
    return path + ": was cut before its first frame: " + (error ? error.message() : "deleted");
  }
  const std::string kept = name + (*whole ? "" : "-torn") + kWhole;
  fs::rename(part, kept, error);
  if (error) return path + ": was left by a run that was cut off and cannot be renamed: " + error.message();
  return kept + (*whole ? ": is whole" : ": is cut, and kept up to its last whole frame") +
         "; a run that was cut off was writing it";
}

}  // namespace

std::vector<std::string> keep_torn(const fs::path& directory) {
  std::vector<std::string> lines;
  std::error_code error;
  for (fs::directory_iterator entry(directory, error), end; !error && entry != end; entry.increment(error)) {
    const std::string name = entry->path().filename().string();
    if (!name.starts_with(BlackBox::kPrefix) || !name.ends_with(kPart) || is_written(entry->path())) continue;
    lines.push_back(keep(entry->path()));
  }
  return lines;
}

}  // namespace stereotrack::record
