#include "pipeline/shape/blob_extractor.hpp"

#include <algorithm>
#include <cstring>

#include "pipeline/shape/region.hpp"

namespace stereotrack {

Result<BlobExtractor> BlobExtractor::create(const Config& config, int width, int height, Arena& arena) noexcept {
  if (width <= 0 || height <= 0 || config.max_runs < 1 || config.max_blobs < 1 || config.max_blobs > 65535 ||
      config.min_area_px < 0) {
    return fail(Fault::kBadConfig);
  }
  BlobExtractor stage;
  stage.config_ = config;
  stage.width_ = width;
  stage.height_ = height;
  const std::size_t runs = std::min(static_cast<std::size_t>(config.max_runs), max_run_count(width, height));
  stage.runs_ = arena.array<Run>(runs);
  stage.component_of_ = arena.array<std::int32_t>(runs);
  stage.components_ = arena.array<Component>(runs);
  stage.blobs_ = arena.array<Blob>(static_cast<std::size_t>(config.max_blobs));
  stage.labels_ = arena.image<std::uint16_t>(width, height);
  if (stage.runs_.empty() || stage.component_of_.empty() || stage.components_.empty() || stage.blobs_.empty() ||
      stage.labels_.empty()) {
    return fail(Fault::kOutOfMemory);
  }
  return stage;
}

Result<BlobSet> BlobExtractor::run(ImageView<const std::uint8_t> mask) noexcept {
  if (mask.width != width_ || mask.height != height_) return fail(Fault::kBadSize);
  const RunCount run_count = find_components(mask, RunKind::kObject, runs_);

  // A root is its component's first run, so components arise in raster order.
  int found = 0;
  for (std::int32_t i = 0; i < run_count.kept; ++i) {
    const Run& run = runs_[i];
    const std::int32_t root = root_of(runs_, i);
    if (root == i) {
      component_of_[i] = found;
      components_[found] = {0, 0, 0, i, run.begin, run.end, run.y + 1};
      ++found;
    }
    Component& component = components_[component_of_[root]];
    const std::int64_t length = run.length();
    component.area += run.length();
    component.sum_x += length * (run.begin + run.end - 1) / 2;
    component.sum_y += length * run.y;
    component.left = std::min(component.left, run.begin);
    component.right = std::max(component.right, run.end);
    component.bottom = run.y + 1;
  }

  Component* const begin = components_.data();
  Component* end =
      std::remove_if(begin, begin + found, [&](const Component& c) noexcept { return c.area < config_.min_area_px; });
  BlobSet result;
  result.labels = labels_;
  result.small = found - static_cast<int>(end - begin);
  result.dropped_runs = run_count.dropped;

  const auto larger = [](const Component& a, const Component& b) noexcept {
    return a.area != b.area ? a.area > b.area : a.root < b.root;
  };
  const auto earlier = [](const Component& a, const Component& b) noexcept { return a.root < b.root; };
  if (end - begin > config_.max_blobs) {
    Component* const last_kept = begin + config_.max_blobs;
    std::nth_element(begin, last_kept, end, larger);
    result.dropped_blobs = static_cast<int>(end - last_kept);
    end = last_kept;
  }
  if (config_.order == Order::kArea) {
    std::sort(begin, end, larger);
  } else {
    std::sort(begin, end, earlier);
  }

  std::fill_n(component_of_.begin(), run_count.kept, 0);
  const auto count = static_cast<int>(end - begin);
  for (int i = 0; i < count; ++i) {
    const Component& component = components_[i];
    const Run& first = runs_[component.root];
    component_of_[component.root] = i + 1;
    Blob& blob = blobs_[i];
    blob.label = static_cast<std::uint16_t>(i + 1);
    blob.area = component.area;
    blob.box = {component.left, first.y, component.right - component.left, component.bottom - first.y};
    blob.first = {first.begin, first.y};
    blob.center_x = static_cast<double>(component.sum_x) / component.area;
    blob.center_y = static_cast<double>(component.sum_y) / component.area;
    blob.sides = sides_touched(blob.box, width_, height_);
  }
  result.blobs = blobs_.first(static_cast<std::size_t>(count));

  for (int y = 0; y < height_; ++y) {
    std::memset(labels_.row(y), 0, static_cast<std::size_t>(width_) * sizeof(std::uint16_t));
  }
  for (std::int32_t i = 0; i < run_count.kept; ++i) {
    const auto label = static_cast<std::uint16_t>(component_of_[root_of(runs_, i)]);
    if (label != 0) std::fill_n(labels_.row(runs_[i].y) + runs_[i].begin, runs_[i].length(), label);
  }
  return result;
}

}  // namespace stereotrack
