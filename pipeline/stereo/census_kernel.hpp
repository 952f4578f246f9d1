#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "pipeline/core/arena.hpp"
#include "pipeline/stereo/disparity.hpp"
#include "pipeline/stereo/lane_layout.hpp"

namespace stereotrack {

/// One call of CensusMatcher, checked: its steps 1 to 4.
struct CensusTask {
  BlockGeometry geometry;
  int texture;        ///< as in CensusMatcher::Config
  int uniqueness;     ///< likewise
  int left_right_px;  ///< likewise
  ImageView<const std::uint8_t> left;
  ImageView<const std::uint8_t> right;
  ImageView<const std::uint8_t> mask;  ///< picture size; empty = all
  WantedRows wanted;                   ///< not empty
  ImageView<std::uint16_t> raw;        ///< picture size; all of wanted.box is written: before filtering
};

/// Memory of both ways. A call touches what its region, its margin of half a block and its range need, no more.
struct CensusScratch {
  [[nodiscard]] static CensusScratch create(int width, int block, int disparities, Arena& arena) noexcept;

  /// One row's codes in three planes of 8 bits.
  using Codes = std::array<std::span<std::uint8_t>, 3>;

  std::span<std::uint8_t> distances;         ///< [row modulo block][column of the region][lane]
  std::span<std::uint16_t> column_sums;      ///< [column of the region][lane], over the rows of the window
  std::span<std::uint16_t> window_sums;      ///< [lane]
  std::span<std::uint16_t> costs;            ///< [pixel of kPixelStep][lane], kLaneStep cells of padding around each
  std::span<std::uint32_t> gradient_sums;    ///< [column of the region], over the rows of the window
  std::span<WindowLimits> limits;            ///< [column of the region]
  Codes left_codes;                          ///< [column of the region + kLaneStep]
  Codes right_codes;                         ///< [partner + kLaneStep]
  std::span<std::uint8_t> partner_exists;    ///< [partner] 0 or 0xFF
  std::span<std::uint8_t> no_partner;        ///< [partner] 0
  std::span<std::uint16_t> right_costs;      ///< [partner] best cost of each right pixel of the row
  std::span<std::uint16_t> right_ids;        ///< [partner] and for which disparity
  std::span<std::uint16_t> values;           ///< [column of the region] disparities of the row, not yet checked
  std::span<std::uint16_t> ids;              ///< [column of the region] best d - range.min
  std::span<std::uint32_t> reference_left;   ///< [column of the region] codes of the plain way
  std::span<std::uint32_t> reference_right;  ///< [partner] likewise
};

/// The plain reference. Adds wanted, border, texture, uniqueness, left_right.
[[nodiscard]] DisparityCounts census_reference(const CensusTask& task, CensusScratch& scratch) noexcept;

/// The same bit for bit with disparities in vector lanes; the instruction set is Highway's choice (see use_simd). Each
/// Hamming distance is counted once, in bytes, and kept for `block` rows; what a column's sums change by is added in
/// the pass that slides the window. The right view's best are kept for 32 pixels at a time: a lane moves by one cell
/// from pixel to pixel, which memory that was just written does not like.
[[nodiscard]] DisparityCounts census_lanes(const CensusTask& task, CensusScratch& scratch) noexcept;

}  // namespace stereotrack
