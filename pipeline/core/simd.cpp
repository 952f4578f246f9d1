#include "pipeline/core/simd.hpp"

#include <hwy/highway.h>

#include <algorithm>

namespace stereotrack {

namespace {

// The sets of Highway's targets that one of ours stands for; within a set Highway takes the best.
constexpr std::array<std::int64_t, kSimdTargets> kHighwayTargets{0, HWY_SSE4, HWY_AVX2, HWY_AVX3 | HWY_AVX3_DL,
                                                                 HWY_NEON};

struct Available {
  std::array<SimdTarget, kSimdTargets> targets{};
  std::size_t count = 0;
};

Available find_available() noexcept {
  const std::int64_t supported = hwy::SupportedTargets() & HWY_TARGETS;
  Available found;
  for (std::size_t i = 0; i < kSimdTargets; ++i) {
    if (i == 0 || (supported & kHighwayTargets[i]) != 0) found.targets[found.count++] = static_cast<SimdTarget>(i);
  }
  return found;
}

const Available kAvailable = find_available();
SimdTarget in_use = kAvailable.targets[kAvailable.count - 1];

}  // namespace

std::span<const SimdTarget> simd_targets() noexcept { return {kAvailable.targets.data(), kAvailable.count}; }

bool use_simd(SimdTarget target) noexcept {
  const auto targets = simd_targets();
  if (std::find(targets.begin(), targets.end(), target) == targets.end()) return false;
  // Highway's own choice is narrowed, too: its tables of functions are indexed by it.
  if (target != SimdTarget::kScalar) {
    hwy::GetChosenTarget().Update(hwy::SupportedTargets() & kHighwayTargets[static_cast<std::size_t>(target)]);
  }
  in_use = target;
  return true;
}

SimdTarget simd_in_use() noexcept { return in_use; }

}  // namespace stereotrack
