#pragma once

#include <cstdint>

namespace stereotrack {

// Rows of AdaptiveBackground::distance(). Each has its definition beside it, NAME_reference(), which every instruction
// set of pipeline/core/simd.hpp equals bit for bit. Rows may start anywhere; out is none of the inputs.
// 0.1 to 0.4 ns a pixel with 16 lanes. Any thread, no state.

/// The background under the present light, rounded, saturated at 255.
///     out = (mean gain + 2^15) / 2^16
/// mean: 8.8; gain: 256 = unchanged, 0..1023.
void lit_row(const std::uint16_t* mean, int gain, int width, std::uint8_t* out) noexcept;
void lit_row_reference(const std::uint16_t* mean, int gain, int width, std::uint8_t* out) noexcept;

/// Largest less smallest of the 3x3 neighbourhood, as far as it lies in the picture. At the picture's upper and lower
/// border `here` stands in for the row outside.
struct ThreeRows {
  const std::uint8_t* above = nullptr;
  const std::uint8_t* here = nullptr;
  const std::uint8_t* under = nullptr;
};
void range_row(const ThreeRows& in, int width, std::uint8_t* out) noexcept;
void range_row_reference(const ThreeRows& in, int width, std::uint8_t* out) noexcept;

/// One channel: the picture, and what the background knows [8.8].
struct ChannelRow {
  const std::uint8_t* now = nullptr;
  const std::uint16_t* mean = nullptr;
  const std::uint16_t* deviation = nullptr;
  std::uint8_t* shown = nullptr;  ///< of cb and cr: written with the mean, rounded, saturated at 255
};

/// Distance from the background in 1/4 standard deviations, saturated at 255: z of AdaptiveBackground. Only luma has
/// gain and edge tolerance. cb and cr without pictures for a grey one.
struct DistanceRow {
  ChannelRow y;
  ChannelRow cb;
  ChannelRow cr;
  const std::uint8_t* range = nullptr;  ///< of range_row()
  int gain = 256;                       ///< 0..1023
  int noise_floor = 1;                  ///< 1..4096
  int edge_percent = 0;                 ///< 0..200
};
void distance_row(const DistanceRow& in, int width, std::uint8_t* out) noexcept;
void distance_row_reference(const DistanceRow& in, int width, std::uint8_t* out) noexcept;

/// Ratio of picture and background of every third pixel, the i-th at 3 i, as the histogram's bin:
///     bin = min((65536 now + mean / 2) / mean, kGainBins - 1)
/// and kGainBins for pixels that say nothing: too dark, too bright or foreground (not 0).
inline constexpr int kGainStep = 3;
inline constexpr int kGainBins = 1024;
void gain_bins(const std::uint8_t* now, const std::uint16_t* mean, const std::uint8_t* foreground, int count,
               std::uint16_t* bins) noexcept;
void gain_bins_reference(const std::uint8_t* now, const std::uint16_t* mean, const std::uint8_t* foreground, int count,
                         std::uint16_t* bins) noexcept;

/// How many of the values are at most `limit`, 0..65535. About 0.03 ns a value.
int count_up_to(const std::uint16_t* values, int count, int limit) noexcept;
int count_up_to_reference(const std::uint16_t* values, int count, int limit) noexcept;

}  // namespace stereotrack
