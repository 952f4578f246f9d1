#include "pipeline/motion/foreground_mask.hpp"

#include <algorithm>
#include <bit>

#include "pipeline/motion/adaptive_background.hpp"

namespace stereotrack {

namespace {

constexpr int kStepsPerSd = AdaptiveBackground::kStepsPerSd;

}  // namespace

Result<ForegroundMask> ForegroundMask::create(const Config& config, int width, int height, Arena& arena,
                                              const BitMask& ignored) noexcept {
  if (!(config.low_sd > 0) || !(config.high_sd >= config.low_sd) || !(config.high_sd <= 60) ||
      !(config.faint_sd >= 0.5) || !(config.faint_sd <= 60) || config.halo_percent < 0 || config.halo_percent > 90 ||
      config.min_seeds < 1 || config.max_runs < 1) {
    return fail(Fault::kBadConfig);
  }
  if (width < 1 || height < 1) return fail(Fault::kBadSize);
  if (ignored.width != 0 && (ignored.width != width || ignored.height != height)) return fail(Fault::kBadSize);
  const auto steps = [](double sd) { return static_cast<int>(sd * kStepsPerSd + 0.5); };
  ForegroundMask self;
  self.width_ = width;
  self.height_ = height;
  self.ignored_ = ignored;
  self.looked_at_px_ = static_cast<double>(width) * height;
  for (int y = 0; y < ignored.height; ++y) {
    for (int w = 0; w < ignored.words_a_row(); ++w) self.looked_at_px_ -= std::popcount(ignored.row(y)[w]);
  }
  self.limits_ = {steps(config.low_sd), steps(config.faint_sd), config.halo_percent};
  self.high_ = steps(config.high_sd);
  self.min_seeds_ = config.min_seeds;
  self.work_ = CandidateWorkspace::create(width, height, arena);
  self.majority_ = BitMask::create(width, height, arena);
  const std::size_t runs = std::min(static_cast<std::size_t>(config.max_runs), max_run_count(width, height));
  self.runs_ = arena.array<Run>(runs);
  self.seeds_ = arena.array<std::int32_t>(runs);
  if (arena.failed()) return fail(Fault::kOutOfMemory);
  return self;
}

Result<double> ForegroundMask::run(ImageView<const std::uint8_t> distance, ImageView<std::uint8_t> mask) noexcept {
  const auto fits = [&](const auto& picture) { return picture.width == width_ && picture.height == height_; };
  if (!fits(distance) || !fits(mask)) return fail(Fault::kBadSize);
  mark_candidates(distance, limits_, work_);
  keep_majority(work_, majority_);
  for (int y = 0; y < ignored_.height; ++y) {
    for (int w = 0; w < ignored_.words_a_row(); ++w) majority_.row(y)[w] &= ~ignored_.row(y)[w];
  }
  return keep_seeded(distance, mask);
}

double ForegroundMask::keep_seeded(ImageView<const std::uint8_t> distance, ImageView<std::uint8_t> mask) noexcept {
  const auto [count, dropped] = find_components(majority_, RunKind::kObject, runs_);
  dropped_runs_ = dropped;
  std::fill_n(seeds_.begin(), count, 0);
  for (std::int32_t i = 0; i < count; ++i) {
    const Run& run = runs_[i];
    const std::uint8_t* row = distance.row(run.y);
    seeds_[root_of(runs_, i)] += static_cast<std::int32_t>(
        std::count_if(row + run.begin, row + run.end, [high = high_](std::uint8_t d) { return d >= high; }));
  }
  for (int y = 0; y < height_; ++y) std::fill_n(mask.row(y), width_, std::uint8_t{0});
  std::int64_t kept = 0;
  for (std::int32_t i = 0; i < count; ++i) {
    const Run& run = runs_[i];
    if (seeds_[root_of(runs_, i)] < min_seeds_) continue;
    std::fill_n(mask.row(run.y) + run.begin, run.length(), std::uint8_t{255});
    kept += run.length();
  }
  return looked_at_px_ > 0 ? static_cast<double>(kept) / looked_at_px_ : 0.0;
}

}  // namespace stereotrack
