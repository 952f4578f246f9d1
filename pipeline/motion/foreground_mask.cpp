#include "pipeline/motion/foreground_mask.hpp"

#include <algorithm>

#include "pipeline/motion/adaptive_background.hpp"

namespace stereotrack {

namespace {

constexpr int kFaintPercent = 50;

constexpr int kStepsPerSd = AdaptiveBackground::kStepsPerSd;
constexpr int kHaloReach = 2;
constexpr int kMaxComponents = 4096;

}  // namespace

Result<ForegroundMask> ForegroundMask::create(const Config& config, int width, int height, Arena& arena) noexcept {
  if (!(config.low_sd > 0) || !(config.high_sd >= config.low_sd) || !(config.high_sd <= 60) ||
      !(config.faint_sd >= 0.5) || !(config.faint_sd <= 60) || config.halo_percent < 0 || config.halo_percent > 90 ||
      config.min_seeds < 1) {
    return fail(Fault::kBadConfig);
  }
  Result<BlobExtractor> components =
      BlobExtractor::create({.max_runs = config.max_runs, .max_blobs = kMaxComponents, .min_area_px = config.min_seeds},
                            width, height, arena);
  if (!components) return fail(components.error());
  ForegroundMask self(*components);
  self.config_ = config;
  self.low_ = static_cast<int>(config.low_sd * kStepsPerSd + 0.5);
  self.high_ = static_cast<int>(config.high_sd * kStepsPerSd + 0.5);
  self.faint_ = static_cast<int>(config.faint_sd * kStepsPerSd + 0.5);
  self.candidates_ = arena.image<std::uint8_t>(width, height);
  self.row_max_ = arena.image<std::uint8_t>(width, height);
  self.seeds_ = arena.array<std::uint32_t>(kMaxComponents + 1);
  if (arena.failed()) return fail(Fault::kOutOfMemory);
  return self;
}

Result<double> ForegroundMask::run(ImageView<const std::uint8_t> distance, ImageView<std::uint8_t> mask) noexcept {
  const int width = candidates_.width;
  const int height = candidates_.height;
  if (!distance.same_size(candidates_) || !mask.same_size(candidates_)) return fail(Fault::kBadSize);
  for (int y = 0; y < height; ++y) {
    const std::uint8_t* row = distance.row(y);
    for (int x = 0; x < width; ++x) {
      std::uint8_t most = 0;
      for (int u = std::max(x - kHaloReach, 0); u <= std::min(x + kHaloReach, width - 1); ++u) {
        most = std::max(most, row[u]);
      }
      row_max_.at(x, y) = most;
    }
  }
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      int most = 0;
      for (int v = std::max(y - kHaloReach, 0); v <= std::min(y + kHaloReach, height - 1); ++v) {
        most = std::max<int>(most, row_max_.at(x, v));
      }
      const int here = distance.at(x, y);
      int sum = 0;
      int count = 0;
      if (here < low_ && most >= faint_) {
        for (int v = std::max(y - 2, 0); v <= std::min(y + 2, height - 1); ++v) {
          for (int u = std::max(x - 2, 0); u <= std::min(x + 2, width - 1); ++u) {
            sum += distance.at(u, v);
            ++count;
          }
        }
      }
      const bool strong = here >= low_ && here * 100 >= most * config_.halo_percent;
      const bool faint = sum >= faint_ * count && count > 0 && sum * 100 >= most * count * kFaintPercent;
      candidates_.at(x, y) = strong || faint ? 1 : 0;
    }
  }
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      int votes = 0;
      int voters = 0;
      for (int v = std::max(y - 1, 0); v <= std::min(y + 1, height - 1); ++v) {
        for (int u = std::max(x - 1, 0); u <= std::min(x + 1, width - 1); ++u) {
          votes += candidates_.at(u, v);
          ++voters;
        }
      }
      mask.at(x, y) = 2 * votes > voters ? 255 : 0;
    }
  }
  const Result<BlobSet> components = components_.run(mask);
  if (!components) return fail(components.error());
  std::fill_n(seeds_.begin(), components->blobs.size() + 1, 0U);
  for (int y = 0; y < height; ++y) {
    const std::uint16_t* label = components->labels.row(y);
    for (int x = 0; x < width; ++x) {
      if (label[x] != 0 && distance.at(x, y) >= high_) ++seeds_[label[x]];
    }
  }
  std::int64_t kept = 0;
  for (int y = 0; y < height; ++y) {
    const std::uint16_t* label = components->labels.row(y);
    for (int x = 0; x < width; ++x) {
      const bool keep = label[x] != 0 && seeds_[label[x]] >= static_cast<std::uint32_t>(config_.min_seeds);
      mask.at(x, y) = keep ? 255 : 0;
      kept += keep ? 1 : 0;
    }
  }
  return static_cast<double>(kept) / (static_cast<double>(width) * height);
}

}  // namespace stereotrack
