#pragma once

#include <cstdint>
#include <span>

#include "pipeline/core/arena.hpp"
#include "pipeline/core/stage.hpp"
#include "pipeline/stereo/disparity.hpp"

namespace stereotrack {

/// Cleans a disparity picture, in this order:
/// * median of the 3x3 neighbours that have a disparity (the upper one of an even number); pixels without
///   a disparity stay without;
/// * speckles: 4-connected islands, inside which neighbours differ by at most `speckle_step`, of fewer than
///   `speckle_size` pixels lose their disparity;
/// * gaps: runs in a row of at most `fill_px` wanted pixels without disparity take that of the farther (smaller
///   disparity) of their two ends: what is hidden from one camera is usually background. At the border of
///   the picture (or of what is wanted) the one end there is.
///
/// In: 1/16 px, kNoDisparity = none, at most the size of create(); `mask` of the same size or empty. Out: all
/// wanted pixels are written, no others. Adds matched, speckle and filled to `counts`.
/// O(pixels). Memory: 18 bytes a pixel. Faults at create(): kBadConfig (sides over 8192), kOutOfMemory. One instance a
/// thread.
class DisparityFilter {
 public:
  struct Config {
    bool median = true;
    int speckle_size = 60;  ///< [px], 0 = off
    int speckle_step = 32;  ///< [1/16 px], 0..65535
    int fill_px = 16;       ///< [px], 0 = off
  };

  DisparityFilter() noexcept = default;
  [[nodiscard]] static Result<DisparityFilter> create(const Config& config, int width, int height,
                                                      Arena& arena) noexcept;
  void run(ImageView<const std::uint16_t> in, ImageView<const std::uint8_t> mask, ImageView<std::uint16_t> out,
           DisparityCounts& counts) noexcept;

 private:
  struct Start {
    std::int16_t x;
    std::int16_t y;
  };

  [[nodiscard]] std::int64_t remove_speckles(ImageView<std::uint16_t> picture) noexcept;
  [[nodiscard]] std::int64_t fill_gaps(ImageView<const std::uint8_t> mask,
                                       ImageView<std::uint16_t> picture) const noexcept;
  [[nodiscard]] std::int32_t find_runs(ImageView<const std::uint16_t> picture) noexcept;
  [[nodiscard]] std::int32_t root(std::int32_t run) noexcept;
  void join(std::int32_t a, std::int32_t b) noexcept;

  Config config_;
  ImageView<std::uint16_t> work_;
  std::span<std::uint16_t> none_row_;  ///< a row without disparities
  // Islands are made of runs: neighbours in a row that belong together.
  std::span<std::int32_t> run_of_;   ///< [row modulo 2][column]
  std::span<Start> starts_;          ///< [run]
  std::span<std::int32_t> lengths_;  ///< [run]
  std::span<std::int32_t> parents_;  ///< [run] union-find
  std::span<std::int32_t> sizes_;    ///< of the island [px], at its root
};
static_assert(RealTimeStage<DisparityFilter, &DisparityFilter::run>);

}  // namespace stereotrack
