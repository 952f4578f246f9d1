#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "pipeline/core/arena.hpp"

namespace stereotrack {

/// What the pipeline's memory is for: rooms of the stages, in the order of the stages.
enum class MemoryPart : std::uint8_t {
  kPlanes,      ///< luma, chroma, smoothed planes, distance and mask of both views; lines of a mosaic; what is ignored
  kBackground,  ///< background models of both views
  kForeground,  ///< edges or hysteresis, closing
  kShapes,      ///< filling, opening, runs, blobs
  kLevelSet,    ///< level set and convex hull
  kRectifier,   ///< tables of both views
  kMatcher,     ///< block matching, dense or in regions
  kRegions,     ///< matching of whole regions
  kCanvases,    ///< rectified pictures of both views
  kDisparity,   ///< disparity maps, raw and rectified
  kShadow,      ///< shadow test
  kDetector,    ///< segments of depth, candidates, detections
  kTracker,     ///< targets, association, corner features
};
inline constexpr std::size_t kMemoryParts = 13;
[[nodiscard]] constexpr const char* to_string(MemoryPart part) noexcept {
  constexpr std::array<const char*, kMemoryParts> kNames{
      "planes",  "background", "foreground", "shapes", "level set", "rectifier", "matcher",
      "regions", "canvases",   "disparity",  "shadow", "detector",  "tracker"};
  return kNames[static_cast<std::size_t>(part)];
}

/// Arena bytes by part. charge() writes what the arena gave since the charge before (or since the beginning) on the
/// account of a part, so the sum is what it gave from the beginning to the last charge. Set-up only.
class MemoryUse {
 public:
  MemoryUse() noexcept = default;
  explicit MemoryUse(const Arena& arena) noexcept : first_(arena.bytes_used()), last_(first_) {}

  void charge(MemoryPart part, const Arena& arena) noexcept {
    bytes_[static_cast<std::size_t>(part)] += arena.bytes_used() - last_;
    last_ = arena.bytes_used();
  }
  [[nodiscard]] std::size_t bytes(MemoryPart part) const noexcept { return bytes_[static_cast<std::size_t>(part)]; }
  [[nodiscard]] std::size_t total() const noexcept { return last_ - first_; }

 private:
  std::array<std::size_t, kMemoryParts> bytes_{};
  std::size_t first_ = 0;
  std::size_t last_ = 0;
};

}  // namespace stereotrack
