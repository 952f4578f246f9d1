#include "pipeline/shape/contour_fill.hpp"

#include <algorithm>
#include <cstring>

namespace stereotrack {

Result<ContourFill> ContourFill::create(const Config& config, int width, int height, Arena& arena) noexcept {
  if (width <= 0 || height <= 0 || config.max_hole_px < 0 || config.max_border_px < 0) return fail(Fault::kBadConfig);
  ContourFill stage;
  stage.config_ = config;
  stage.width_ = width;
  stage.height_ = height;
  stage.runs_ = arena.array<Run>(max_run_count(width, height));
  stage.area_ = arena.array<std::int64_t>(max_run_count(width, height));
  stage.at_border_ = arena.array<std::uint8_t>(max_run_count(width, height));
  if (stage.runs_.empty() || stage.area_.empty() || stage.at_border_.empty()) return fail(Fault::kOutOfMemory);
  return stage;
}

Result<void> ContourFill::run(ImageView<const std::uint8_t> edges, ImageView<std::uint8_t> filled) noexcept {
  if (edges.width != width_ || edges.height != height_ || !edges.same_size(filled)) return fail(Fault::kBadSize);
  const int count = find_components(edges, RunKind::kBackground, runs_).kept;
  std::fill_n(area_.begin(), count, 0);
  std::fill_n(at_border_.begin(), count, std::uint8_t{0});
  for (int i = 0; i < count; ++i) {
    const Run& run = runs_[i];
    const std::int32_t root = root_of(runs_, i);
    area_[root] += run.length();
    if (run.y == 0 || run.y == height_ - 1 || run.begin == 0 || run.end == width_) at_border_[root] = 1;
  }
  for (int y = 0; y < height_; ++y) std::memset(filled.row(y), 255, static_cast<std::size_t>(width_));
  for (int i = 0; i < count; ++i) {
    const Run& run = runs_[i];
    const std::int32_t root = root_of(runs_, i);
    if (area_[root] > (at_border_[root] != 0 ? config_.max_border_px : config_.max_hole_px)) {
      std::memset(filled.row(run.y) + run.begin, 0, static_cast<std::size_t>(run.length()));
    }
  }
  return {};
}

}  // namespace stereotrack
