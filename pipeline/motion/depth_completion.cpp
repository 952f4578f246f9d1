#include "pipeline/motion/depth_completion.hpp"

#include <algorithm>
#include <cstdlib>

#include "pipeline/stereo/disparity.hpp"

namespace stereotrack {

namespace {

constexpr int kReach = 4;
constexpr int kSide = 2 * kReach + 1;
constexpr int kNeeded = kSide * kSide / 2 + 1;

}  // namespace

Result<DepthCompletion> DepthCompletion::create(const Config& config, int width, int height, Arena& arena) noexcept {
  if (!(config.depth_part > 0) || !(config.own_px > 0)) return fail(Fault::kBadConfig);
  if (width < 1 || height < 1) return fail(Fault::kBadSize);
  DepthCompletion self;
  self.config_ = config;
  self.likely_ = arena.image<std::uint8_t>(width, height);
  self.row_sums_ = arena.image<std::uint8_t>(width, height);
  if (arena.failed()) return fail(Fault::kOutOfMemory);
  return self;
}

int DepthCompletion::run(const Input& in, const Rect& window, double object, std::uint16_t label,
                         ImageView<std::uint16_t> labels) noexcept {
  const Rect box = intersect(window, {0, 0, labels.width, labels.height});
  const int middle = static_cast<int>(object * kDisparityScale);
  const int own = static_cast<int>(config_.own_px * kDisparityScale);
  const int room = std::max(own, static_cast<int>(config_.depth_part * middle));
  for (int y = box.top; y < box.bottom(); ++y) {
    for (int x = box.left; x < box.right(); ++x) {
      const int now = in.disparity.at(x, y);
      const int before = in.disparity_background.at(x, y);
      const bool likely = labels.at(x, y) == 0 && now != kNoDisparity && before != kNoDisparity &&
                          std::abs(now - middle) <= room && now - before > own;
      likely_.at(x, y) = likely ? 1 : 0;
    }
  }
  for (int y = box.top; y < box.bottom(); ++y) {
    int sum = 0;
    for (int x = box.left; x < std::min(box.left + kReach, box.right()); ++x) sum += likely_.at(x, y);
    for (int x = box.left; x < box.right(); ++x) {
      if (x + kReach < box.right()) sum += likely_.at(x + kReach, y);
      if (x - kReach - 1 >= box.left) sum -= likely_.at(x - kReach - 1, y);
      row_sums_.at(x, y) = static_cast<std::uint8_t>(sum);
    }
  }
  int found = 0;
  for (int x = box.left; x < box.right(); ++x) {
    int sum = 0;
    for (int y = box.top; y < std::min(box.top + kReach, box.bottom()); ++y) sum += row_sums_.at(x, y);
    for (int y = box.top; y < box.bottom(); ++y) {
      if (y + kReach < box.bottom()) sum += row_sums_.at(x, y + kReach);
      if (y - kReach - 1 >= box.top) sum -= row_sums_.at(x, y - kReach - 1);
      if (sum < kNeeded || likely_.at(x, y) == 0) continue;
      labels.at(x, y) = label;
      ++found;
    }
  }
  return found;
}

}  // namespace stereotrack
