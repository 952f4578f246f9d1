#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "pipeline/core/arena.hpp"
#include "pipeline/core/image_view.hpp"

namespace stereotrack {

// Pictures of ForegroundMask. Each function has its definition beside it, NAME_reference(), which every instruction set
// of pipeline/core/simd.hpp equals bit for bit.

/// Memory of the two functions below, for pictures of one size. One instance a thread.
struct CandidateWorkspace {
  static constexpr int kReach = 2;  ///< of the 5x5 neighbourhood [px]

  /// arena.failed() where there was no memory.
  [[nodiscard]] static CandidateWorkspace create(int width, int height, Arena& arena) noexcept;

  // Rings of rows, by y modulo their count; the last row stays zero and stands for those outside the picture.
  ImageView<std::uint8_t> distance;    // 5 rows, zeros around
  ImageView<std::uint8_t> most;        // 5 + 1 rows: the largest within 2 columns
  ImageView<std::uint16_t> sum;        // 5 + 1 rows: the sum over 5 columns; a vector of even, one of odd columns
  ImageView<std::uint8_t> candidates;  // 0 or 1, zeros around
  std::array<std::span<std::uint8_t>, 2>
      columns;  // how many columns within 1, within 2 px lie in the picture; 0 outside
};

struct CandidateLimits {
  int low = 0;           ///< of the distance, 0..255
  int faint = 0;         ///< of its mean over 5x5, 0..255
  int halo_percent = 0;  ///< 0..90
};

/// Steps 1 and 2 of ForegroundMask, into work.candidates. distance: the workspace's size. About 0.1 ns a pixel.
void mark_candidates(ImageView<const std::uint8_t> distance, const CandidateLimits& limits,
                     const CandidateWorkspace& work) noexcept;
void mark_candidates_reference(ImageView<const std::uint8_t> distance, const CandidateLimits& limits,
                               const CandidateWorkspace& work) noexcept;

/// Step 3: 255 where most of the 3x3 neighbourhood in work.candidates is 1, else 0. mask: the workspace's size.
void keep_majority(const CandidateWorkspace& work, ImageView<std::uint8_t> mask) noexcept;
void keep_majority_reference(const CandidateWorkspace& work, ImageView<std::uint8_t> mask) noexcept;

}  // namespace stereotrack
