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

/// Larger blocks than this take the plain way: their costs and a disparity do not fit into 16 bits.
inline constexpr int kLargestCensusLaneBlock = 9;

/// Memory of both ways. A call touches what its region, its margin of half a block and its range need, no more.
struct CensusScratch {
  static constexpr int kMostPlanes = 6;
  static constexpr int kMostKeyStride = 64;

  [[nodiscard]] static CensusScratch create(int width, int block, int disparities, Arena& arena) noexcept;

  std::span<std::uint8_t> distances;         ///< [row modulo block][column of the region][lane]
  std::span<std::uint8_t> column_sums;       ///< [column of the region + 1][lane], over the rows of the window
  std::span<std::uint16_t> window;           ///< [lane] keys of the window; of the plain way its costs
  std::span<std::uint16_t> keys;             ///< [group of kLaneStep lanes + 1][pixel of kPixelStep][lane and padding]
  std::span<std::uint16_t> gradient_sums;    ///< [column of the region + kLaneStep], over the rows of the window
  std::span<WindowLimits> limits;            ///< [column of the region]
  std::span<std::uint8_t> left_codes;        ///< [row modulo block][plane][column of the region]
  std::span<std::uint8_t> right_codes;       ///< [row modulo block][plane][partner]
  std::span<std::uint8_t> partner_exists;    ///< [partner] 0 or 0xFF
  std::span<std::uint8_t> no_partner;        ///< [partner] 0
  std::span<std::uint16_t> partner_missing;  ///< [partner] 0 or 0xFFFF
  std::span<std::uint16_t> right_costs;      ///< [partner] best cost of each right pixel of the row
  std::span<std::uint16_t> right_ids;        ///< [partner] and for which disparity
  std::span<std::uint16_t> values;           ///< [column of the region] disparities of the row, not yet checked
  std::span<std::uint16_t> ids;              ///< [column of the region] best d - range.min
  std::span<std::uint16_t> met_ids;          ///< [column of the region] that of the right pixel that it leads to

  // Of the plain way.
  std::span<std::uint32_t> reference_left;       ///< [column of the region] codes
  std::span<std::uint32_t> reference_right;      ///< [partner] likewise
  std::span<std::uint16_t> reference_sums;       ///< [column of the region][d - range.min], over the rows of the window
  std::span<std::uint32_t> reference_gradients;  ///< [column of the region], likewise
  std::span<std::uint16_t> reference_costs;      ///< [d - range.min]
};

/// The plain reference. Adds wanted, border, texture, uniqueness, left_right.
[[nodiscard]] DisparityCounts census_reference(const CensusTask& task, CensusScratch& scratch) noexcept;

/// The same bit for bit with disparities in vector lanes, block <= kLargestCensusLaneBlock; the instruction set is
/// Highway's choice (see use_simd). Each Hamming distance is counted once and kept for `block` rows; distances and
/// column sums are bytes. The window holds keys of 16 bits, cost x 32 + d modulo 32, so that one minimum finds cost and
/// disparity, for the left view and, along the diagonals of 32 pixels, for the right one.
[[nodiscard]] DisparityCounts census_lanes(const CensusTask& task, CensusScratch& scratch) noexcept;

}  // namespace stereotrack
