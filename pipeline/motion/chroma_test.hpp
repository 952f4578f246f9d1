#pragma once

#include <array>
#include <cstdint>

#include "pipeline/core/image_view.hpp"
#include "pipeline/core/stage.hpp"
#include "pipeline/shape/bits_kernel.hpp"

namespace stereotrack {

/// The document's test against shadows: a segmented pixel is background after all if both its chroma
/// values lie within one standard deviation of the background's.
///     mean  = 1/N sum x_i                                                 (3.20)
///     sigma = sqrt(1/N sum (x_i - mean)^2)                                (3.21)
///     Cb_background - sigma < Cb_current < Cb_background + sigma          (3.22)
///     Cr_background - sigma < Cr_current < Cr_background + sigma          (3.23)
/// x_i are the Cb (Cr) values of the N segmented pixels of the whole frame: one sigma per chroma channel.
/// Strict inequalities as printed, so with sigma 0 nothing is removed. Compared squared and multiplied by
/// N^2, in integers: exact. O(pixels), two passes. Any thread, no state.
struct ChromaTest {
  /// Clears the pixels of `mask` (255 = segmented) that the test calls background. All planes of one size.
  /// Returns how many were cleared.
  static std::uint32_t run(ImageView<const std::uint8_t> cb, ImageView<const std::uint8_t> cr,
                           ImageView<const std::uint8_t> cb_background, ImageView<const std::uint8_t> cr_background,
                           ImageView<std::uint8_t> mask) noexcept {
    std::uint64_t n = 0;
    std::array<std::uint64_t, 2> sum{};
    std::array<std::uint64_t, 2> squares{};
    const auto for_each_segmented = [&](auto&& fn) {
      for (int y = 0; y < mask.height; ++y) {
        for_each_set_run(mask.row(y), mask.width, [&](int begin, int end) {
          for (int x = begin; x < end; ++x) fn(x, y);
        });
      }
    };
    for_each_segmented([&](int x, int y) {
      const std::uint64_t b = cb.at(x, y);
      const std::uint64_t r = cr.at(x, y);
      ++n;
      sum[0] += b;
      sum[1] += r;
      squares[0] += b * b;
      squares[1] += r * r;
    });
    // n^2 sigma^2 = n sum x^2 - (sum x)^2; |a - b| < sigma  <=>  n^2 (a - b)^2 < n^2 sigma^2.
    const std::uint64_t variance_b = n * squares[0] - sum[0] * sum[0];
    const std::uint64_t variance_r = n * squares[1] - sum[1] * sum[1];
    std::uint32_t cleared = 0;
    for_each_segmented([&](int x, int y) {
      const auto db = static_cast<std::int64_t>(cb.at(x, y)) - cb_background.at(x, y);
      const auto dr = static_cast<std::int64_t>(cr.at(x, y)) - cr_background.at(x, y);
      const bool same_b = n * n * static_cast<std::uint64_t>(db * db) < variance_b;
      const bool same_r = n * n * static_cast<std::uint64_t>(dr * dr) < variance_r;
      if (same_b && same_r) {
        mask.at(x, y) = 0;
        ++cleared;
      }
    });
    return cleared;
  }
};
static_assert(RealTimeStage<ChromaTest, &ChromaTest::run>);

}  // namespace stereotrack
