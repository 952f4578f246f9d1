#pragma once

#include <array>
#include <cstdint>

namespace stereotrack {

/// A row of AdaptiveBackground's state and of what it learns from [8.8 but for `now`].
struct LearnRow {
  struct Channel {
    const std::uint8_t* now = nullptr;
    std::uint16_t* mean = nullptr;
    std::uint16_t* deviation = nullptr;
    std::uint16_t* candidate = nullptr;
  };
  std::array<Channel, 3> channels;         ///< the first `count` of them: luma, blue, red
  int count = 1;                           ///< 1..3
  std::uint16_t* age = nullptr;            ///< frames that looked like the mean; 0 = nothing known
  std::uint16_t* candidate_age = nullptr;  ///< frames that looked like the candidate
  const std::uint8_t* mask = nullptr;      ///< 0 background, else one of AdaptiveBackground's marks
};

struct LearnRates {
  int window = 60;   ///< 2..1024 [frames]
  int absorb = 300;  ///< 2..60000 [frames]
  int pull = 0;      ///< of a sample at most, 0..8 [mean absolute deviations]; 0 = without bound
};

/// Learns one row, as AdaptiveBackground says; how many of its pixels were foreground. The definition stands beside it,
/// and every instruction set of pipeline/core/simd.hpp equals it bit for bit. About 0.5 ns a pixel and channel, and
/// little more where all is foreground. Any thread, no state.
int learn_row(const LearnRow& row, const LearnRates& rates, int width) noexcept;
int learn_row_reference(const LearnRow& row, const LearnRates& rates, int width) noexcept;

}  // namespace stereotrack
