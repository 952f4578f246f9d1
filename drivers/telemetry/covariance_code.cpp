#include "drivers/telemetry/covariance_code.hpp"

#include <bit>
#include <cmath>

namespace stereotrack::telemetry {
namespace {

std::uint16_t to_bfloat16(float value) noexcept {
  const auto bits = std::bit_cast<std::uint32_t>(value);
  return static_cast<std::uint16_t>((bits + 0x7FFFU + ((bits >> 16U) & 1U)) >> 16U);
}

float from_bfloat16(std::uint16_t half) noexcept {
  return std::bit_cast<float>(static_cast<std::uint32_t>(half) << 16U);
}

}  // namespace

std::optional<CovarianceBytes> pack_covariance(const Eigen::Matrix<double, 6, 6>& P) noexcept {
  // What is left of a variance after its explained part is subtracted: below this share it is rounding.
  constexpr double kRounding = 1e-12;
  Eigen::Matrix<double, 6, 6> L = Eigen::Matrix<double, 6, 6>::Zero();
  for (int j = 0; j < 6; ++j) {
    if (!(P(j, j) >= 0)) return std::nullopt;
    double pivot = P(j, j);
    for (int k = 0; k < j; ++k) pivot -= L(j, k) * L(j, k);
    for (int i = j; i < 6; ++i) {
      if (!std::isfinite(P(i, j))) return std::nullopt;
    }
    if (!(pivot > kRounding * P(j, j))) continue;
    L(j, j) = std::sqrt(pivot);
    for (int i = j + 1; i < 6; ++i) {
      double rest = P(i, j);
      for (int k = 0; k < j; ++k) rest -= L(i, k) * L(j, k);
      L(i, j) = rest / L(j, j);
    }
  }
  CovarianceBytes bytes{};
  std::size_t at = 0;
  for (int i = 0; i < 6; ++i) {
    for (int j = 0; j <= i; ++j) {
      const auto value = static_cast<float>(L(i, j));
      if (!std::isfinite(value)) return std::nullopt;
      const std::uint16_t half = to_bfloat16(value);
      if (!std::isfinite(from_bfloat16(half))) return std::nullopt;
      bytes[at++] = static_cast<std::uint8_t>(half & 0xFFU);
      bytes[at++] = static_cast<std::uint8_t>(half >> 8U);
    }
  }
  return bytes;
}

std::optional<Eigen::Matrix<float, 6, 6>> unpack_covariance(
    std::span<const std::uint8_t, kCovarianceBytes> bytes) noexcept {
  Eigen::Matrix<float, 6, 6> L = Eigen::Matrix<float, 6, 6>::Zero();
  std::size_t at = 0;
  for (int i = 0; i < 6; ++i) {
    for (int j = 0; j <= i; ++j) {
      L(i, j) = from_bfloat16(static_cast<std::uint16_t>(bytes[at] | (bytes[at + 1] << 8)));
      at += 2;
    }
  }
  const Eigen::Matrix<float, 6, 6> P = L * L.transpose();
  if (!P.allFinite()) return std::nullopt;
  return P;
}

}  // namespace stereotrack::telemetry
