#pragma once

#include <array>
#include <cstdint>

namespace stereotrack::capture::synthetic {

/// SplitMix64's finaliser (Steele, Lea, Flood 2014): a bijection whose every output bit depends on every
/// input bit. Integers only: the same everywhere.
[[nodiscard]] constexpr std::uint64_t mix_bits(std::uint64_t x) noexcept {
  x += 0x9e3779b97f4a7c15ULL;
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9ULL;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebULL;
  return x ^ (x >> 31);
}

/// A stream of random numbers named by a key: number n is a function of (key, n) alone, so that what one
/// object draws does not depend on what others drew before.
class Random {
 public:
  explicit constexpr Random(std::uint64_t key) noexcept : key_(mix_bits(key)) {}

  constexpr std::uint64_t bits() noexcept { return mix_bits(key_ + 0x9e3779b97f4a7c15ULL * ++count_); }
  /// In [0, 1), a multiple of 2^-53.
  constexpr double uniform() noexcept { return static_cast<double>(bits() >> 11) * 0x1p-53; }
  constexpr double uniform(double low, double high) noexcept { return low + (high - low) * uniform(); }
  /// In [0, count).
  constexpr int below(int count) noexcept { return static_cast<int>(bits() % static_cast<std::uint64_t>(count)); }
  constexpr bool chance(double probability) noexcept { return uniform() < probability; }
  constexpr double sign() noexcept { return chance(0.5) ? 1.0 : -1.0; }

 private:
  std::uint64_t key_;
  std::uint64_t count_ = 0;
};

/// Quantiles of the normal distribution with mean 0 and standard deviation 1, times 2^12: entry i is the
/// one at probability (i + 1/2) / 4096. Twelve random bits pick a normal number by one look-up.
/// Made by summing the density, which the recurrence g(x + h) = g(x) r(x), r(x + h) = r(x) exp(-h^2)
/// gives with multiplications alone.
inline constexpr int kNormalBits = 12;
[[nodiscard]] const std::array<std::int16_t, 1U << kNormalBits>& normal_quantiles() noexcept;

}  // namespace stereotrack::capture::synthetic
