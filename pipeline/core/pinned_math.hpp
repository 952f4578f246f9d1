#pragma once

#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>

namespace stereotrack {

/// Elementary functions that give the same bits on every machine. Those of the C library do not: they
/// differ between versions, and even between processors under one version.
///
/// Made of + - * / sqrt and floor alone, which IEEE 754 rounds exactly, and fixed polynomials. Needs
/// -ffp-contract=off (set for every target of the project): a fused multiply-add rounds once, not twice.
/// Polynomials and reductions: fdlibm 5.3 (Sun Microsystems, freely granted).
///
///     function     domain (outside: NaN unless said)                error
///     pinned_sin   |x| <= 1e6                                       < 1e-15 for |x| < 100, < 1e-12 absolute
///     pinned_cos   |x| <= 1e6                                       the same
///     pinned_tan   |x| <= 1e6                                       < 1e-12 relative where |cos x| > 1e-3
///     pinned_atan  all, infinities too                              < 1e-15 absolute
///     pinned_atan2 all finite; (0, 0) gives 0                       < 1e-15 absolute
///     pinned_exp   all; > 709.78 gives infinity, < -708.39 gives 0  < 1e-15 relative
///     pinned_log   x > 0; 0 gives -infinity                         < 1e-15 relative, < 1e-15 absolute near 1
///
/// Any thread. Cost: 5 to 20 ns.
namespace pinned_detail {

/// sin r for |r| <= pi/4.
inline double sin_kernel(double r) noexcept {
  const double z = r * r;
  const double p =
      8.33333333332248946124e-03 +
      z * (-1.98412698298579493134e-04 +
           z * (2.75573137070700676789e-06 + z * (-2.50507602534068634195e-08 + z * 1.58969099521155010221e-10)));
  return r + r * z * (-1.66666666666666324348e-01 + z * p);
}

/// cos r for |r| <= pi/4.
inline double cos_kernel(double r) noexcept {
  const double z = r * r;
  const double p =
      4.16666666666666019037e-02 +
      z * (-1.38888888888741095749e-03 +
           z * (2.48015872894767294178e-05 + z * (-2.75573143513906633035e-07 +
                                                  z * (2.08757232129817482790e-09 + z * -1.13596475577881948265e-11))));
  return 1.0 - (0.5 * z - z * z * p);
}

/// x = r + quadrant pi/2, |r| <= pi/4 (+ a rounding). quadrant < 0: x outside the domain.
struct Reduced {
  double r = 0;
  int quadrant = -1;
};
inline Reduced reduce(double x) noexcept {
  constexpr double kTwoOverPi = 6.36619772367581382433e-01;
  constexpr double kPiOver2High = 1.57079632673412561417e+00;  // 33 bits: n * it is exact for n < 2^20
  constexpr double kPiOver2Low = 6.07710050650619224932e-11;
  if (!(x >= -1e6 && x <= 1e6)) return {};
  const double n = std::floor(x * kTwoOverPi + 0.5);
  return {(x - n * kPiOver2High) - n * kPiOver2Low, static_cast<int>(static_cast<std::int64_t>(n) & 3)};
}

}  // namespace pinned_detail

[[nodiscard]] inline double pinned_sin(double x) noexcept {
  const pinned_detail::Reduced a = pinned_detail::reduce(x);
  switch (a.quadrant) {
    case 0: return pinned_detail::sin_kernel(a.r);
    case 1: return pinned_detail::cos_kernel(a.r);
    case 2: return -pinned_detail::sin_kernel(a.r);
    case 3: return -pinned_detail::cos_kernel(a.r);
    default: return std::numeric_limits<double>::quiet_NaN();
  }
}

[[nodiscard]] inline double pinned_cos(double x) noexcept {
  const pinned_detail::Reduced a = pinned_detail::reduce(x);
  switch (a.quadrant) {
    case 0: return pinned_detail::cos_kernel(a.r);
    case 1: return -pinned_detail::sin_kernel(a.r);
    case 2: return -pinned_detail::cos_kernel(a.r);
    case 3: return pinned_detail::sin_kernel(a.r);
    default: return std::numeric_limits<double>::quiet_NaN();
  }
}

[[nodiscard]] inline double pinned_tan(double x) noexcept { return pinned_sin(x) / pinned_cos(x); }

[[nodiscard]] inline double pinned_atan(double x) noexcept {
  if (!(x == x)) return x;
  const double a = x < 0 ? -x : x;
  if (a > 1e19) return x < 0 ? -std::numbers::pi / 2 : std::numbers::pi / 2;
  // atan a = base + atan t with t small: base is atan of 0, 1/2, 1, 3/2, infinity.
  double high = 0;
  double low = 0;
  double t = a;
  if (a >= 2.4375) {
    high = 1.57079632679489655800e+00;
    low = 6.12323399573676603587e-17;
    t = -1.0 / a;
  } else if (a >= 1.1875) {
    high = 9.82793723247329054082e-01;
    low = 1.39033110312309984516e-17;
    t = (a - 1.5) / (1.0 + 1.5 * a);
  } else if (a >= 0.6875) {
    high = 7.85398163397448278999e-01;
    low = 3.06161699786838301793e-17;
    t = (a - 1.0) / (a + 1.0);
  } else if (a >= 0.4375) {
    high = 4.63647609000806093515e-01;
    low = 2.26987774529616870924e-17;
    t = (2.0 * a - 1.0) / (2.0 + a);
  }
  const double z = t * t;
  const double w = z * z;
  const double odd = z * (3.33333333333329318027e-01 +
                          w * (1.42857142725034663711e-01 +
                               w * (9.09088713343650656196e-02 +
                                    w * (6.66107313738753120669e-02 +
                                         w * (4.97687799461593236017e-02 + w * 1.62858201153657823623e-02)))));
  const double even =
      w *
      (-1.99999999998764832476e-01 +
       w * (-1.11111104054623557880e-01 +
            w * (-7.69187620504482999495e-02 + w * (-5.83357013379057348645e-02 + w * -3.65315727442169155270e-02))));
  const double result = high - ((t * (odd + even) - low) - t);
  return x < 0 ? -result : result;
}

/// The angle of (x, y) against the x axis, in (-pi, pi].
[[nodiscard]] inline double pinned_atan2(double y, double x) noexcept {
  if (!(x == x) || !(y == y)) return std::numeric_limits<double>::quiet_NaN();
  if (x > 0) return pinned_atan(y / x);
  if (x < 0) return y >= 0 ? pinned_atan(y / x) + std::numbers::pi : pinned_atan(y / x) - std::numbers::pi;
  if (y > 0) return std::numbers::pi / 2;
  if (y < 0) return -std::numbers::pi / 2;
  return 0.0;
}

[[nodiscard]] inline double pinned_exp(double x) noexcept {
  constexpr double kLn2High = 6.93147180369123816490e-01;  // 32 bits: k * it is exact
  constexpr double kLn2Low = 1.90821492927058770002e-10;
  if (!(x == x)) return x;
  if (x > 709.782712893383973096) return std::numeric_limits<double>::infinity();
  if (x < -708.39) return 0.0;
  const double k = std::floor(x * 1.44269504088896338700e+00 + 0.5);
  const double high = x - k * kLn2High;
  const double low = k * kLn2Low;
  const double r = high - low;
  const double z = r * r;
  const double c =
      r -
      z * (1.66666666666666019037e-01 +
           z * (-2.77777777770155933842e-03 +
                z * (6.61375632143793436117e-05 + z * (-1.65339022054652515390e-06 + z * 4.13813679705723846039e-08))));
  const double y = 1.0 - ((low - (r * c) / (2.0 - c)) - high);
  // y 2^k by two exact factors: 2^1024 itself has no representation.
  const auto power = [](int e) { return std::bit_cast<double>(static_cast<std::uint64_t>(e + 1023) << 52); };
  const int exponent = static_cast<int>(k);
  const int half = exponent / 2;
  return y * power(half) * power(exponent - half);
}

[[nodiscard]] inline double pinned_log(double x) noexcept {
  constexpr double kLn2High = 6.93147180369123816490e-01;
  constexpr double kLn2Low = 1.90821492927058770002e-10;
  if (x == 0) return -std::numeric_limits<double>::infinity();
  if (!(x > 0)) return std::numeric_limits<double>::quiet_NaN();
  if (x == std::numeric_limits<double>::infinity()) return x;
  int k = 0;
  if (x < std::numeric_limits<double>::min()) {
    x *= 0x1p54;
    k = -54;
  }
  // x = 2^k m with m in [sqrt(1/2), sqrt 2)
  std::uint64_t bits = std::bit_cast<std::uint64_t>(x);
  k += static_cast<int>(bits >> 52) - 1023;
  bits = (bits & 0x000fffffffffffffULL) | 0x3ff0000000000000ULL;
  double m = std::bit_cast<double>(bits);
  if (m >= std::numbers::sqrt2) {
    m *= 0.5;
    ++k;
  }
  const double f = m - 1.0;
  const double s = f / (2.0 + f);
  const double z = s * s;
  const double w = z * z;
  const double even = w * (3.999999999940941908e-01 + w * (2.222219843214978396e-01 + w * 1.531383769920937332e-01));
  const double odd =
      z * (6.666666666666735130e-01 +
           w * (2.857142874366239149e-01 + w * (1.818357216161805012e-01 + w * 1.479819860511658591e-01)));
  const double half = 0.5 * f * f;
  const double n = static_cast<double>(k);
  return n * kLn2High - ((half - (s * (half + even + odd) + n * kLn2Low)) - f);
}

}  // namespace stereotrack
