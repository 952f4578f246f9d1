#include "firmware-app/stereotrackd/line_care.hpp"

#include <algorithm>

#include "firmware-app/formatted.hpp"
#include "firmware-app/stereotrackd/log.hpp"

namespace stereotrack::daemon {

void LineCare::tell(gpio::LineBits failing, const std::function<std::string(std::size_t)>& name, const std::string& why,
                    MonotonicTime now) {
  const auto names = [&](gpio::LineBits bits) {
    std::string text;
    for (std::size_t i = 0; i < gpio::kMaxLines; ++i) {
      if ((bits >> i & 1U) != 0) text += (text.empty() ? " " : ", ") + name(i);
    }
    return text;
  };
  if (const gpio::LineBits bad = failing & ~failing_; bad != 0) {
    if (failing_ == 0) since_ = now;
    log(LogLevel::kError, lines_ + names(bad) + " fail: " + why + "; tried again until they work",
        {{"STEREOTRACK_CAUSE", "line"}});
  }
  if (const gpio::LineBits good = failing_ & ~failing; good != 0) {
    log(LogLevel::kNotice, lines_ + names(good) + formatted(" work again after %.1f s", to_seconds(now - since_)),
        {{"STEREOTRACK_CAUSE", "line"}});
  }
  failing_ = failing;
  if (failing == 0) cannot_.clear();
}

void LineCare::cannot(const std::string& why) {
  if (!cannot_.empty() && why != cannot_) {
    log(LogLevel::kWarning, lines_ + ": " + why, {{"STEREOTRACK_CAUSE", "line"}});
  }
  cannot_ = why;
}

bool LineCare::is_due(gpio::LineBits gone, MonotonicTime now) noexcept {
  if (gone == 0) {
    if (waits_) good_ = now;
    waits_ = false;
    return false;
  }
  if (!waits_) {
    waits_ = true;
    if (now - good_ >= kLongestWait) wait_ = kFirstWait;
    // Without a rest, a chip that comes and goes would be asked for all the time.
    next_ = std::max(now, next_);
  }
  if (now < next_) return false;
  next_ = now + wait_;
  wait_ = std::min<std::chrono::nanoseconds>(2 * wait_, kLongestWait);
  return true;
}

}  // namespace stereotrack::daemon
