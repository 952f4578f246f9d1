#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "pipeline/frame.hpp"
#include "pipeline/photometry/colour.hpp"

namespace stereotrack::test {

/// BGR pixels as a camera would give them in another colour format, full range: luma of each pixel, chroma the mean
/// over those that share it. `format`: kYuyv, kUyvy or kNv12, whose sizes the picture must have. `stride`: of the
/// result.
inline void lay_out(const Picture& bgr, PixelFormat format, std::ptrdiff_t stride, std::vector<std::uint8_t>& out) {
  out.resize(static_cast<std::size_t>(stride) * static_cast<std::size_t>(memory_rows(format, bgr.height)));
  const auto row = [&](int y) { return out.data() + y * stride; };
  const int tall = format == PixelFormat::kNv12 ? 2 : 1;
  for (int y = 0; y < bgr.height; y += tall) {
    for (int x = 0; x < bgr.width; x += 2) {
      int blue = 0;
      int red = 0;
      for (int v = y; v < y + tall; ++v) {
        for (int u = x; u < x + 2; ++u) {
          const std::uint8_t* pixel = bgr.row(v) + 3 * u;
          const std::uint8_t grey = luma(pixel[0], pixel[1], pixel[2]);
          blue += chroma_blue(pixel[0], grey);
          red += chroma_red(pixel[2], grey);
          if (format == PixelFormat::kNv12) row(v)[u] = grey;
          if (format == PixelFormat::kYuyv) row(v)[2 * u] = grey;
          if (format == PixelFormat::kUyvy) row(v)[2 * u + 1] = grey;
        }
      }
      const auto mean = [tall](int sum) { return static_cast<std::uint8_t>((sum + tall) / (2 * tall)); };
      const int first = format == PixelFormat::kYuyv ? 1 : 0;
      std::uint8_t* pair = format == PixelFormat::kNv12 ? row(bgr.height + y / 2) + x : row(y) + 2 * x + first;
      pair[0] = mean(blue);
      pair[format == PixelFormat::kNv12 ? 1 : 2] = mean(red);
    }
  }
}

}  // namespace stereotrack::test
