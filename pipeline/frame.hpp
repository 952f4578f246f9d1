#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "pipeline/core/time.hpp"

namespace stereotrack {

enum class PixelFormat : std::uint8_t {
  kGrey8,  ///< one byte a pixel, luma
  kBgr8,   ///< three bytes a pixel, blue green red, full range
};

[[nodiscard]] constexpr int bytes_per_pixel(PixelFormat format) noexcept {
  return format == PixelFormat::kBgr8 ? 3 : 1;
}

/// One sensor's picture as the source delivers it: raw, unrectified, owned by the source.
struct Picture {
  const std::uint8_t* data = nullptr;
  int width = 0;                    ///< [px]
  int height = 0;                   ///< [px]
  std::ptrdiff_t stride_bytes = 0;  ///< from one row to the next
  PixelFormat format = PixelFormat::kGrey8;

  [[nodiscard]] const std::uint8_t* row(int y) const noexcept { return data + y * stride_bytes; }
  [[nodiscard]] bool empty() const noexcept { return data == nullptr || width <= 0 || height <= 0; }
};

/// What was exposed at one moment by both sensors. `right` is empty for a mono source.
/// The pixels stay valid until the source is asked for the next pair.
struct FramePair {
  std::uint64_t ordinal = 0;                     ///< from 1, counts the source's pairs, unreadable ones too
  CaptureTime capture_time{};                    ///< middle of the exposure, of the left sensor where each has its own
  std::optional<std::chrono::nanoseconds> skew;  ///< right capture time - left; none: one stamp for both, or mono
  Picture left;
  Picture right;
};

}  // namespace stereotrack
