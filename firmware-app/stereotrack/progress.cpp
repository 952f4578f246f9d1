#include "firmware-app/stereotrack/progress.hpp"

#include <unistd.h>

#include <ostream>

#include "firmware-app/formatted.hpp"

namespace stereotrack {

using Clock = std::chrono::steady_clock;

Progress::Progress(std::ostream& out, std::optional<std::uint64_t> total)
    : out_(out), total_(total), terminal_(isatty(STDERR_FILENO) == 1), start_(Clock::now()), shown_(start_) {}

std::string Progress::line() const {
  const double seconds = std::chrono::duration<double>(Clock::now() - start_).count();
  const double rate = seconds > 0 ? static_cast<double>(done_) / seconds : 0;
  if (!total_ || rate <= 0) return formatted("%llu frames, %.1f/s", static_cast<unsigned long long>(done_), rate);
  const double left = *total_ > done_ ? static_cast<double>(*total_ - done_) / rate : 0;
  return formatted("%llu of %llu frames, %.1f/s, %.0f s left", static_cast<unsigned long long>(done_),
                   static_cast<unsigned long long>(*total_), rate, left);
}

void Progress::step() {
  ++done_;
  const auto now = Clock::now();
  if (now - shown_ < (terminal_ ? std::chrono::milliseconds(200) : std::chrono::seconds(10))) return;
  shown_ = now;
  if (terminal_) {
    out_ << '\r' << line() << "\x1b[K" << std::flush;
  } else {
    out_ << line() << std::endl;
  }
}

void Progress::message(const std::string& text) {
  if (terminal_) out_ << "\r\x1b[K";
  out_ << text << std::endl;
}

void Progress::finish() {
  if (terminal_) out_ << '\r' << line() << "\x1b[K" << std::endl;
}

}  // namespace stereotrack
