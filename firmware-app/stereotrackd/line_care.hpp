#pragma once

#include <chrono>
#include <cstddef>
#include <functional>
#include <string>
#include <utility>

#include "drivers/gpio/line.hpp"
#include "pipeline/core/time.hpp"

namespace stereotrack::daemon {

/// What the service does about GPIO lines whose chip does not do as it is told: tells the log of each change once, and
/// says when a chip that is gone is to be asked for anew. Pure logic but for the log; service thread.
class LineCare {
 public:
  static constexpr std::chrono::milliseconds kFirstWait{500};
  static constexpr std::chrono::milliseconds kLongestWait{4000};

  /// `lines`: what the log calls them, "GPIO outputs".
  explicit LineCare(std::string lines) : lines_(std::move(lines)) {}

  /// `failing`: lines that do now; `name`: of line i; `why`: one line.
  void tell(gpio::LineBits failing, const std::function<std::string(std::size_t)>& name, const std::string& why,
            MonotonicTime now);

  /// What was gone does not come back; told where the reason changes: first it is not there, then it may not be used.
  void cannot(const std::string& why);

  /// Whether to ask anew for what is gone. At once, then after waits that double from kFirstWait to kLongestWait; what
  /// was back for less than that goes on where it was.
  [[nodiscard]] bool is_due(gpio::LineBits gone, MonotonicTime now) noexcept;

 private:
  std::string lines_;
  gpio::LineBits failing_ = 0;
  std::string cannot_;     ///< the reason that cannot() was told last, since something fails
  MonotonicTime since_{};  ///< some line fails since
  bool waits_ = false;
  MonotonicTime next_{};
  MonotonicTime good_{};  ///< nothing was gone any more since
  std::chrono::nanoseconds wait_ = kFirstWait;
};

}  // namespace stereotrack::daemon
