#include "drivers/capture/libcamera/module/complaints.hpp"

namespace stereotrack::libcamera_module {
namespace {

/// Without the sequences that colour a terminal: ESC [ ... m.
std::string without_colours(std::string_view line) {
  std::string plain;
  while (!line.empty()) {
    const std::size_t escape = line.find('\x1b');
    plain += line.substr(0, escape);
    if (escape == std::string_view::npos) break;
    const std::size_t end = line.find('m', escape);
    if (end == std::string_view::npos) break;
    line.remove_prefix(end + 1);
  }
  return plain;
}

}  // namespace

std::string text_of_log_line(std::string_view line) {
  const std::string plain = without_colours(line);
  for (const std::string_view level : {" FATAL ", " ERROR ", " WARN ", " INFO ", " DEBUG "}) {
    if (const std::size_t at = plain.find(level); at != std::string::npos) return plain.substr(at + level.size());
  }
  return plain;
}

std::string Complaints::last() const {
  const std::scoped_lock lock(mutex_);
  return last_;
}

void Complaints::forget() {
  const std::scoped_lock lock(mutex_);
  last_.clear();
}

std::streamsize Complaints::xsputn(const char* text, std::streamsize count) {
  put({text, static_cast<std::size_t>(count)});
  return count;
}

Complaints::int_type Complaints::overflow(int_type c) {
  if (traits_type::eq_int_type(c, traits_type::eof())) return traits_type::not_eof(c);
  const char one = traits_type::to_char_type(c);
  put({&one, 1});
  return c;
}

void Complaints::put(std::string_view text) {
  const std::scoped_lock lock(mutex_);
  for (const char c : text) {
    if (c != '\n') {
      line_ += c;
      continue;
    }
    if (!line_.empty()) last_ = text_of_log_line(line_);
    line_.clear();
  }
}

}  // namespace stereotrack::libcamera_module
