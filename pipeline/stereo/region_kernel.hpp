#pragma once

#include <cstdint>
#include <span>

#include "pipeline/core/image_view.hpp"

namespace stereotrack {

/// A pixel of a region in the left picture.
struct RegionSample {
  std::int16_t x;
  std::int16_t y;
  std::int16_t grey;  ///< 0..255
};

/// A region against `lanes` places of the right picture: sample s meets, in lane i, the right pixel
/// (s.x + shift + i, s.y + row_offset), if there is one.
struct RegionTask {
  std::span<const RegionSample> samples;  ///< at most 4096; of several tasks added up, together
  ImageView<const std::uint8_t> right;
  ImageView<const std::uint8_t> moving;  ///< right picture's size, or empty
  int shift = 0;                         ///< [px]
  int row_offset = 0;                    ///< [px]
  int lanes = 0;
  /// The caller knows that every sample meets a pixel in each lane, up to the end of the last step.
  bool inside = false;
};

/// By lane, of the n samples that meet a pixel there, e = grey - right pixel. What a call finds is added to what is
/// there.
struct RegionSums {
  std::span<std::int32_t> differences;  ///< sum e
  std::span<std::int32_t> squares;      ///< sum e^2
  std::span<std::int32_t> moving;       ///< on how many `moving` is not 0; 0 where it is empty
  std::span<std::int32_t> pixels;       ///< n

  /// Those of the lanes [first, first + count).
  [[nodiscard]] RegionSums lanes(std::size_t first, std::size_t count) const noexcept {
    return {differences.subspan(first, count), squares.subspan(first, count), moving.subspan(first, count),
            pixels.subspan(first, count)};
  }
};

/// Lanes that are summed together: whoever asks for fewer pays for as many, or for half of them where that will do.
inline constexpr int kRegionStep = 32;

/// The reference is the definition, which every instruction set of pipeline/core/simd.hpp equals bit for bit. About
/// 0.1 ns a sample and lane. Any thread, no state.
void region_sums(const RegionTask& task, const RegionSums& sums) noexcept;
void region_sums_reference(const RegionTask& task, const RegionSums& sums) noexcept;

}  // namespace stereotrack
