#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>

#if defined(__aarch64__)
#include <sys/auxv.h>
#endif

#include "pipeline/core/simd.hpp"

namespace stereotrack {
namespace {

TEST(Simd, ScalarIsAlwaysThereAndFirst) {
  ASSERT_FALSE(simd_targets().empty());
  EXPECT_EQ(simd_targets().front(), SimdTarget::kScalar);
  EXPECT_TRUE(std::is_sorted(simd_targets().begin(), simd_targets().end()));
}

TEST(Simd, TheBestIsUsedUntilToldOtherwise) { EXPECT_EQ(simd_in_use(), simd_targets().back()); }

TEST(Simd, EachAvailableTargetCanBeForced) {
  for (const SimdTarget target : simd_targets()) {
    ASSERT_TRUE(use_simd(target)) << to_string(target);
    EXPECT_EQ(simd_in_use(), target);
  }
}

TEST(Simd, AnotherMachinesTargetIsRefused) {
  const auto targets = simd_targets();
  const SimdTarget before = simd_in_use();
  int refused = 0;
  for (std::size_t i = 0; i < kSimdTargets; ++i) {
    const auto target = static_cast<SimdTarget>(i);
    if (std::find(targets.begin(), targets.end(), target) != targets.end()) continue;
    EXPECT_FALSE(use_simd(target)) << to_string(target);
    EXPECT_EQ(simd_in_use(), before);
    ++refused;
  }
  EXPECT_GE(refused, 1);  // no machine is both x86 and ARM
}

#if defined(__aarch64__)
// Also where the CPU has no AES instructions, which Highway counts to its NEON: no_aes.c takes them away.
TEST(Simd, NeonIsOnEvery64BitArm) {
  if (std::getenv("STEREOTRACK_AES_IS_HIDDEN") != nullptr) {
    ASSERT_EQ(getauxval(AT_HWCAP) & HWCAP_AES, 0U);
  }
  EXPECT_EQ(simd_targets().back(), SimdTarget::kNeon);
}
#elif defined(__arm__)
// Whose NEON does not divide.
TEST(Simd, ThirtyTwoBitArmHasPlainKernels) { EXPECT_EQ(simd_targets().back(), SimdTarget::kScalar); }
#endif

}  // namespace
}  // namespace stereotrack
