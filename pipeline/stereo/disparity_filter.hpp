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
/// O(pixels), most of it 64 pixels at a time (row_bits_kernel.hpp); speckles O(runs). Memory: 18 bytes a pixel. Faults
/// at create(): kBadConfig (sides over 8192), kOutOfMemory. One instance a thread.
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

  /// A row of find_runs().
  struct Row {
    std::uint64_t* with_left;   ///< [word] which pixels belong to the run of the left one
    std::uint64_t* starts;      ///< [word] which pixels begin a run
    std::int32_t* runs_before;  ///< [word] runs of the picture that begin before it
  };

  [[nodiscard]] std::uint64_t* known(int y) const noexcept { return known_.data() + std::ptrdiff_t{y} * words_; }

  void remove_speckles(ImageView<std::uint16_t> picture, DisparityCounts& counts) noexcept;
  void fill_gaps(ImageView<const std::uint8_t> mask, ImageView<std::uint16_t> picture,
                 DisparityCounts& counts) const noexcept;
  [[nodiscard]] std::int32_t find_runs(ImageView<const std::uint16_t> picture) noexcept;
  [[nodiscard]] std::int32_t run_length(Start start, int limit) const noexcept;
  [[nodiscard]] std::int32_t root(std::int32_t run) noexcept;
  void join(std::int32_t a, std::int32_t b) noexcept;

  Config config_;
  ImageView<std::uint16_t> work_;
  std::span<std::uint16_t> none_row_;    ///< a row without disparities
  int words_ = 0;                        ///< of a row of the running call
  std::span<std::uint64_t> known_;       ///< [row][word] of which pixels have a disparity
  std::span<std::uint64_t> alike_;       ///< [5][word] of find_runs()
  std::span<std::int32_t> runs_before_;  ///< [2][word] likewise
  std::span<std::uint64_t> wanted_;      ///< [word]
  // Islands are made of runs: neighbours in a row that belong together.
  std::span<Start> starts_;          ///< [run]
  std::span<std::int32_t> lengths_;  ///< [run]
  std::span<std::int32_t> parents_;  ///< [run] union-find
  std::span<std::int32_t> sizes_;    ///< of the island [px], at its root
};
static_assert(RealTimeStage<DisparityFilter, &DisparityFilter::run>);

}  // namespace stereotrack
