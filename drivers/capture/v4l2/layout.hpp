#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "drivers/capture/v4l2/device.hpp"
#include "drivers/capture/v4l2/formats.hpp"
#include "drivers/capture/v4l2/v4l2.hpp"

namespace stereotrack::capture::v4l2 {

/// How a driver lays a frame out in a buffer, and which part of it is the picture.
struct Layout {
  const KnownFormat* format = nullptr;
  bool planes_interface = false;  ///< V4L2_BUF_TYPE_VIDEO_CAPTURE_MPLANE
  int frame_width = 0;            ///< [px]
  int frame_height = 0;           ///< [px]
  int left = 0;                   ///< of the picture in the frame [px]
  int top = 0;
  int width = 0;  ///< of the picture [px]
  int height = 0;
  std::size_t stride = 0;      ///< bytes from row to row
  std::size_t bytes = 0;       ///< of a frame up to the end of its last row, all planes together
  std::size_t luma_bytes = 0;  ///< of the first plane, where there are two

  [[nodiscard]] std::uint32_t buffer_type() const noexcept;
  /// Where the picture begins.
  [[nodiscard]] std::size_t offset() const noexcept;
};

/// Sets format and size as wanted, or the best that can be had; of full range, which grey and RGB have, too, where that
/// can be chosen. Throws std::runtime_error, one line: a format or size
/// that the driver does not offer (and which it does), fields in turn, planes that do not make one picture.
[[nodiscard]] Layout set_layout(const Device& device, bool planes_interface, const Settings& wanted,
                                const std::string& name);

/// Sets the frame rate, if one is wanted, and reads it back. Empty: the driver does not tell.
[[nodiscard]] std::optional<std::chrono::nanoseconds> set_period(const Device& device, const Layout& layout, double fps,
                                                                 std::vector<std::string>& notes);

/// The shortest that the driver offers for that format and size, where it lists them.
[[nodiscard]] std::optional<std::chrono::nanoseconds> shortest_period(const Device& device, std::uint32_t fourcc,
                                                                      int width, int height);

/// A format that the driver offers.
struct OfferedFormat {
  std::uint32_t fourcc = 0;
  bool range_choice = false;  ///< full or limited range of its brightness is ours to choose
};
[[nodiscard]] std::vector<OfferedFormat> list_formats(const Device& device, bool planes_interface);

/// A size, or a range of them, that a format can have.
struct OfferedSize {
  int width = 0, height = 0;          ///< [px]
  int max_width = 0, max_height = 0;  ///< the same, where the size is no range
};
[[nodiscard]] std::vector<OfferedSize> list_sizes(const Device& device, std::uint32_t fourcc);
/// Frames a second: each rate that is offered, or the highest and lowest of a range.
[[nodiscard]] std::vector<double> list_rates(const Device& device, std::uint32_t fourcc, int width, int height);

}  // namespace stereotrack::capture::v4l2
