#include "pipeline/core/simd.hpp"

#include <hwy/highway.h>

#include <algorithm>

namespace stereotrack {

namespace {

// Later versions of Highway tell NEON with and without AES apart.
#if defined(HWY_NEON_WITHOUT_AES)
constexpr std::int64_t kHighwayNeon = HWY_NEON | HWY_NEON_WITHOUT_AES;
#else
constexpr std::int64_t kHighwayNeon = HWY_NEON;
#endif

// The sets of Highway's targets that one of ours stands for; within a set Highway takes the best.
constexpr std::array<std::int64_t, kSimdTargets> kHighwayTargets{0, HWY_SSE4, HWY_AVX2, HWY_AVX3 | HWY_AVX3_DL,
                                                                 kHighwayNeon};

// Of Highway's targets, those that this CPU runs. 64-bit ARM has NEON, always: earlier versions of Highway count the
// AES instructions to it, which the Cortex-A72 of a Raspberry Pi 4 lacks and no kernel uses. 32-bit ARM has plain
// kernels: NEON only estimates quotients there, and whole runs with it differ (tests/replay/same_bytes.py).
std::int64_t supported() noexcept {
#if HWY_ARCH_ARM_V7
  return 0;
#else
  return hwy::SupportedTargets() | HWY_STATIC_TARGET;
#endif
}

struct Available {
  std::array<SimdTarget, kSimdTargets> targets{};
  std::size_t count = 0;
};

Available find_available() noexcept {
  const std::int64_t runs = supported() & HWY_TARGETS;
  Available found;
  for (std::size_t i = 0; i < kSimdTargets; ++i) {
    if (i == 0 || (runs & kHighwayTargets[i]) != 0) found.targets[found.count++] = static_cast<SimdTarget>(i);
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
    hwy::GetChosenTarget().Update(supported() & kHighwayTargets[static_cast<std::size_t>(target)]);
  }
  in_use = target;
  return true;
}

SimdTarget simd_in_use() noexcept { return in_use; }

}  // namespace stereotrack
