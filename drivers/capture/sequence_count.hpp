#pragma once

#include <cstdint>

namespace stereotrack::capture {

/// A driver's count of frames, 32 bits wide, continued beyond its wrap-around.
/// A count that stands still or goes back (a driver that starts anew) is the next frame, nothing lost: there is no
/// telling. One thread.
class SequenceCount {
 public:
  struct Frame {
    std::uint64_t sequence = 0;
    std::uint64_t lost = 0;  ///< frames between the last one and this
  };
  [[nodiscard]] Frame next(std::uint32_t counted) noexcept {
    if (!started_) {
      started_ = true;
      last_ = counted;
      return {last_, 0};
    }
    const std::uint32_t ahead = counted - raw();
    const bool forward = ahead != 0 && ahead < 0x8000'0000U;
    // The low half follows the driver's count; where that went back, by an offset.
    if (!forward) offset_ += 1U - ahead;
    const std::uint64_t lost = forward ? ahead - 1 : 0;
    last_ += lost + 1;
    return {last_, lost};
  }

 private:
  [[nodiscard]] std::uint32_t raw() const noexcept { return static_cast<std::uint32_t>(last_) - offset_; }

  bool started_ = false;
  std::uint32_t offset_ = 0;  ///< our low half - the driver's count
  std::uint64_t last_ = 0;
};

}  // namespace stereotrack::capture
