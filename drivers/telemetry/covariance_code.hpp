#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <optional>
#include <span>

namespace stereotrack::telemetry {

/// A 6x6 covariance in 42 bytes, as `Target.covariance` of stereotrack.proto carries it.
///     P = L L^T,  L lower triangular                                  Cholesky
///     L00 L10 L11 L20 L21 L22 ... L55 as bfloat16, low byte first     21 numbers
/// bfloat16 is the upper half of a float32: its whole range, 8 bits of precision, rounded to nearest even.
/// Why the factor: seen from a stereo rig P is long along the ray and thin across it, and P rounded to 16
/// bits is no longer a covariance. L L^T always is one; |error of P_ij| <= 2^-7 sqrt(P_ii P_jj).
inline constexpr std::size_t kCovarianceBytes = 42;
using CovarianceBytes = std::array<std::uint8_t, kCovarianceBytes>;

/// Nothing if P holds a value that is not finite, or a negative variance. Reads the lower triangle.
/// A P that rounding made slightly indefinite is sent as the nearest thing that is not: a pivot that is
/// not positive counts as 0, and its column with it. O(1), no heap, + - * / sqrt only.
[[nodiscard]] std::optional<CovarianceBytes> pack_covariance(const Eigen::Matrix<double, 6, 6>& P) noexcept;

/// P again, symmetric; nothing if a number is not finite.
[[nodiscard]] std::optional<Eigen::Matrix<float, 6, 6>> unpack_covariance(
    std::span<const std::uint8_t, kCovarianceBytes> bytes) noexcept;

}  // namespace stereotrack::telemetry
