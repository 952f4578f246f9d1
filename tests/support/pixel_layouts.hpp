#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "pipeline/frame.hpp"
#include "pipeline/photometry/colour.hpp"

namespace stereotrack::test {

/// Puts a sample where sample_of() finds it. Its lower bits, which are of no consequence, differ from pixel to pixel.
inline void put_sample(SampleLayout layout, std::uint8_t* row, int x, std::uint8_t sample) {
  const auto put_word = [&](int bits) {
    const int word = sample << (bits - 8) | (x * 181 & ((1 << (bits - 8)) - 1));
    row[2 * x] = static_cast<std::uint8_t>(word);
    row[2 * x + 1] = static_cast<std::uint8_t>(word >> 8);
  };
  switch (layout) {
    case SampleLayout::kBytes: row[x] = sample; break;
    case SampleLayout::kWords10: put_word(10); break;
    case SampleLayout::kWords12: put_word(12); break;
    case SampleLayout::kWords16: put_word(16); break;
    case SampleLayout::kPacked10:
      row[x / 4 * 5 + x % 4] = sample;
      row[x / 4 * 5 + 4] = static_cast<std::uint8_t>(x * 181);
      break;
    case SampleLayout::kPacked12:
      row[x / 2 * 3 + x % 2] = sample;
      row[x / 2 * 3 + 2] = static_cast<std::uint8_t>(x * 181);
      break;
  }
}

/// BGR pixels as a camera would give them in another format, full range: luma of each pixel, chroma the mean over those
/// that share it; of a mosaic the one colour that its pixel sees. `format`: any but kBgr8 whose sizes the picture can
/// have. `stride`: of the result.
inline void lay_out(const Picture& bgr, PixelFormat format, std::ptrdiff_t stride, std::vector<std::uint8_t>& out) {
  out.resize(static_cast<std::size_t>(stride) * static_cast<std::size_t>(memory_rows(format, bgr.height)));
  const auto row = [&](int y) { return out.data() + y * stride; };
  if (is_bayer(format) || !has_colour(format) || format == PixelFormat::kRgb8) {
    const BayerRed red = is_bayer(format) ? bayer_red(format) : BayerRed{};
    for (int y = 0; y < bgr.height; ++y) {
      for (int x = 0; x < bgr.width; ++x) {
        const std::uint8_t* pixel = bgr.row(y) + 3 * x;
        if (format == PixelFormat::kRgb8) {
          for (int i = 0; i < 3; ++i) row(y)[3 * x + i] = pixel[2 - i];
          continue;
        }
        const int colour = 1 + (y % 2 == red.y ? 1 : 0) - (x % 2 == red.x ? 0 : 1);  // blue 0, green 1, red 2
        const std::uint8_t sample = is_bayer(format) ? pixel[colour] : luma(pixel[0], pixel[1], pixel[2]);
        put_sample(sample_layout(format), row(y), x, sample);
      }
    }
    return;
  }
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
