#include "drivers/capture/synthetic/random.hpp"

namespace stereotrack::capture::synthetic {
namespace {

std::array<std::int16_t, 1U << kNormalBits> make_quantiles() noexcept {
  constexpr int kCount = 1 << kNormalBits;
  constexpr double kStep = 1.0 / 512;
  constexpr double kFactor0 = 0.99999809265318620;     // exp(-h^2 / 2)
  constexpr double kFactorStep = 0.99999618531001030;  // exp(-h^2)
  constexpr double kHalfArea = 1.2533141373155001;     // integral of exp(-x^2 / 2) over x > 0
  std::array<std::int16_t, kCount> table{};
  double density = 1.0;
  double factor = kFactor0;
  double area = 0;
  double x = 0;
  for (int i = 0; i < kCount / 2; ++i) {
    const double wanted = (i + 0.5) / kCount * 2.0 * kHalfArea;
    for (;;) {
      const double slice = kStep * 0.5 * density * (1.0 + factor);
      if (area + slice >= wanted) {
        const double quantile = x + kStep * (wanted - area) / slice;
        const auto fixed = static_cast<std::int16_t>(quantile * 4096.0 + 0.5);
        table[static_cast<std::size_t>(kCount / 2 + i)] = fixed;
        table[static_cast<std::size_t>(kCount / 2 - 1 - i)] = static_cast<std::int16_t>(-fixed);
        break;
      }
      area += slice;
      density *= factor;
      factor *= kFactorStep;
      x += kStep;
    }
  }
  return table;
}

}  // namespace

const std::array<std::int16_t, 1U << kNormalBits>& normal_quantiles() noexcept {
  static const std::array<std::int16_t, 1U << kNormalBits> table = make_quantiles();
  return table;
}

}  // namespace stereotrack::capture::synthetic
