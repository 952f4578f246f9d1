#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "pipeline/core/arena.hpp"
#include "pipeline/core/image_view.hpp"
#include "pipeline/shape/bit_mask.hpp"

namespace stereotrack {

// Pictures of ForegroundMask. mark_candidates() has its definition beside it, mark_candidates_reference(), which every
// instruction set of pipeline/core/simd.hpp equals bit for bit.

/// Memory of the functions below, for pictures of one size. One instance a thread.
struct CandidateWorkspace {
  static constexpr int kReach = 2;  ///< of the 5x5 neighbourhood [px]

  /// arena.failed() where there was no memory.
  [[nodiscard]] static CandidateWorkspace create(int width, int height, Arena& arena) noexcept;

  BitMask candidates;
  // A ring of rows, by y modulo their count; the last row stays zero and stands for those outside the picture.
  ImageView<std::uint8_t> distance;     // 5 + 1 rows, zeros around
  std::span<std::uint8_t> column_sums;  // over 5 rows, saturated; zeros around
  std::span<std::uint8_t> columns;      // how many columns within 2 px lie in the picture; 0 outside
  std::span<std::uint8_t> least_sums;   // no candidate by its mean has less
  struct Votes {
    std::span<std::uint64_t> ones;  // of a row's number of candidates within 1 column, by pixel: its lower bit
    std::span<std::uint64_t> twos;  // and its upper one
  };
  std::array<Votes, 3> votes;  // of three rows, by y modulo 3
};

struct CandidateLimits {
  int low = 0;           ///< of the distance, 0..255
  int faint = 0;         ///< of its mean over 5x5, 0..255
  int halo_percent = 0;  ///< 0..90
};

/// Steps 1 and 2 of ForegroundMask, into work.candidates. distance: the workspace's size. About 0.1 ns a pixel where
/// nothing moves, 0.4 elsewhere.
void mark_candidates(ImageView<const std::uint8_t> distance, const CandidateLimits& limits,
                     const CandidateWorkspace& work) noexcept;
void mark_candidates_reference(ImageView<const std::uint8_t> distance, const CandidateLimits& limits,
                               const CandidateWorkspace& work) noexcept;

/// Step 3: set where most of the 3x3 neighbourhood in work.candidates is set. mask: the workspace's size. 64 pixels at
/// a time, in plain C++.
void keep_majority(const CandidateWorkspace& work, const BitMask& mask) noexcept;

}  // namespace stereotrack
