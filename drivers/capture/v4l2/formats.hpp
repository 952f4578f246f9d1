#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "pipeline/frame.hpp"

namespace stereotrack::capture::v4l2 {

/// A way in which a driver lays out pictures, and what it is to us.
struct KnownFormat {
  std::string_view name;  ///< as users write it
  std::uint32_t fourcc;   ///< as the kernel writes it
  PixelFormat format;
  std::size_t planes = 1;  ///< pieces of memory a picture is in; 2: brightness and colour, each in its own
};

/// In the order in which `auto` takes them: grey first, by bytes a pixel; then colour, by the cost of reading it.
[[nodiscard]] std::span<const KnownFormat> known_formats() noexcept;

/// Null: none of ours.
[[nodiscard]] const KnownFormat* find_format(std::uint32_t fourcc) noexcept;
[[nodiscard]] const KnownFormat* find_format(std::string_view name) noexcept;

/// "YUYV", without spaces at its end; characters that do not print as '?'.
[[nodiscard]] std::string fourcc_text(std::uint32_t fourcc);

}  // namespace stereotrack::capture::v4l2
