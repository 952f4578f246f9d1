#pragma once

#include <cstdint>
#include <span>

#include "pipeline/core/arena.hpp"
#include "pipeline/core/image_view.hpp"
#include "pipeline/core/result.hpp"
#include "pipeline/core/stage.hpp"
#include "pipeline/motion/candidate_kernel.hpp"
#include "pipeline/shape/run_length.hpp"

namespace stereotrack {

/// Foreground of the robust preset: from the distance to the background (AdaptiveBackground) to a mask.
/// 1. a pixel is a candidate from `low` on, a seed from `high` on; one below `low` is a candidate, too, if the mean
///    over 5x5 reaches `faint` and half of the largest distance within 2 px: large parts that differ little;
/// 2. halo: smoothing and blur spread a strong object over its rim. A candidate under halo_percent of the
///    largest distance within 2 px is rim, not object;
/// 3. a pixel stays if most of its 3x3 neighbourhood are candidates, which removes single noisy pixels;
/// 4. components without enough seeds go: weak pixels count only where they hang on strong ones.
/// Pixels that are ignored count in steps 1 to 3, so that what lies beside them is judged as anywhere; then they go.
/// In: distance, u8, AdaptiveBackground::kStepsPerSd a standard deviation. Out: 0 or 255, same size. O(pixels). One
/// instance a thread.
class ForegroundMask {
 public:
  struct Config {
    double low_sd = 4.0;     ///< candidate [standard deviations], 0.5..30
    double faint_sd = 1.25;  ///< candidate, as the mean of 5x5 [standard deviations], 0.5..30
    double high_sd = 8.0;    ///< seed [standard deviations], low_sd..60
    int halo_percent = 25;   ///< 0..90; 0 keeps the halo
    int min_seeds = 5;       ///< seeds that a component needs [px], 1..10000
    int max_runs = 65536;    ///< runs of the mask; more are dropped and counted
  };

  /// Faults: kBadConfig, kBadSize, kOutOfMemory.
  /// ignored: pixels that are never foreground, width x height, which must outlive this; width 0: none.
  [[nodiscard]] static Result<ForegroundMask> create(const Config& config, int width, int height, Arena& arena,
                                                     const BitMask& ignored = {}) noexcept;

  /// Fault: kBadSize, mask untouched. Returns the part of the picture, of what is not ignored, that is foreground,
  /// 0..1.
  [[nodiscard]] Result<double> run(ImageView<const std::uint8_t> distance, ImageView<std::uint8_t> mask) noexcept;

  /// Runs of the last mask that found no room among max_runs: what lies below them counts as background.
  [[nodiscard]] int dropped_runs() const noexcept { return dropped_runs_; }

 private:
  [[nodiscard]] double keep_seeded(ImageView<const std::uint8_t> distance, ImageView<std::uint8_t> mask) noexcept;

  int width_ = 0;
  int height_ = 0;
  BitMask ignored_;
  double looked_at_px_ = 0;
  CandidateLimits limits_;
  int high_ = 0;
  int min_seeds_ = 0;
  int dropped_runs_ = 0;
  CandidateWorkspace work_;
  BitMask majority_;
  std::span<Run> runs_;
  std::span<std::int32_t> seeds_;  // by root run
};
static_assert(RealTimeStage<ForegroundMask, &ForegroundMask::run>);

}  // namespace stereotrack
