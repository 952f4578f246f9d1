#pragma once

#include <array>
#include <cstdint>
#include <span>

namespace stereotrack {

/// Instruction sets that kernels are written for. kScalar is the plain reference that stands beside each kernel and
/// to which every other target is equal bit for bit.
enum class SimdTarget : std::uint8_t { kScalar, kSse4, kAvx2, kAvx512, kNeon };
inline constexpr std::size_t kSimdTargets = 5;

[[nodiscard]] constexpr const char* to_string(SimdTarget target) noexcept {
  constexpr std::array<const char*, kSimdTargets> kNames{"scalar", "sse4", "avx2", "avx512", "neon"};
  return kNames[static_cast<std::size_t>(target)];
}

/// Those that this build holds and this CPU runs: kScalar first, the best one last. Lives for ever.
[[nodiscard]] std::span<const SimdTarget> simd_targets() noexcept;

/// All kernels of the process use `target` from now on; until told otherwise, the best one. Set-up only: never while a
/// kernel runs in another thread. False, and nothing changes, where this CPU or build lacks it.
[[nodiscard]] bool use_simd(SimdTarget target) noexcept;

/// What kernels use now.
[[nodiscard]] SimdTarget simd_in_use() noexcept;

}  // namespace stereotrack
