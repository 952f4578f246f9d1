#include "pipeline/shape/sobel_kernel.hpp"

#include <algorithm>
#include <cmath>

#include "pipeline/core/simd.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "pipeline/shape/sobel_kernel.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace stereotrack {
namespace HWY_NAMESPACE {
namespace {

// Returns how many columns it did, from column 1 on; none where they are less than a vector.

#if HWY_TARGET == HWY_SCALAR || HWY_ARCH_ARM_V7  // whose square root is an estimate

int inner_columns(const SobelRows&, int, std::uint8_t*) { return 0; }

#else

namespace hn = hwy::HWY_NAMESPACE;

int inner_columns(const SobelRows& in, int width, std::uint8_t* out) {
  const hn::ScalableTag<std::int16_t> d;
  const hn::Rebind<std::uint8_t, decltype(d)> bytes;
  const hn::RepartitionToWide<decltype(d)> d32;
  const hn::Half<decltype(d)> half;
  const hn::Rebind<float, decltype(d32)> floats;
  const int lanes = static_cast<int>(hn::Lanes(d));
  const int last = width - 1 - lanes;  // the last vector overlaps the one before it
  if (last < 1) return 0;
  const auto load = [&](const std::uint8_t* row, int x)
                        HWY_ATTR { return hn::PromoteTo(d, hn::LoadU(bytes, row + x)); };
  // Exact: the sum fits a float's 24 bits, sqrt is correctly rounded, and below 256 the root of k^2 - 1 lies 0.002
  // under k, more than a hundred times a float's step there.
  const auto magnitude = [&](auto gx, auto gy) HWY_ATTR {
    const auto x = hn::PromoteTo(d32, gx);
    const auto y = hn::PromoteTo(d32, gy);
    const auto root = hn::Sqrt(hn::ConvertTo(floats, hn::Add(hn::Mul(x, x), hn::Mul(y, y))));
    return hn::DemoteTo(half, hn::ConvertTo(d32, root));
  };
  const auto columns_at = [&](int x) HWY_ATTR {
    const auto twice = [](auto v) HWY_ATTR { return hn::Add(v, v); };
    const auto left = hn::Add(hn::Add(load(in.above, x - 1), load(in.under, x - 1)), twice(load(in.here, x - 1)));
    const auto right = hn::Add(hn::Add(load(in.above, x + 1), load(in.under, x + 1)), twice(load(in.here, x + 1)));
    const auto top = hn::Add(hn::Add(load(in.above, x - 1), load(in.above, x + 1)), twice(load(in.above, x)));
    const auto low = hn::Add(hn::Add(load(in.under, x - 1), load(in.under, x + 1)), twice(load(in.under, x)));
    const auto gx = hn::Sub(right, left);
    const auto gy = hn::Sub(low, top);
    const auto first = magnitude(hn::LowerHalf(half, gx), hn::LowerHalf(half, gy));
    const auto second = magnitude(hn::UpperHalf(half, gx), hn::UpperHalf(half, gy));
    hn::StoreU(hn::DemoteTo(bytes, hn::Combine(d, second, first)), bytes, out + x);  // saturates
  };
  for (int x = 1; x < last; x += lanes) columns_at(x);
  columns_at(last);
  return width - 2;
}

#endif

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace stereotrack
HWY_AFTER_NAMESPACE();

#if HWY_ONCE

namespace stereotrack {

namespace {

HWY_EXPORT(inner_columns);

void columns(const SobelRows& in, int width, int from, int to, std::uint8_t* out) noexcept {
  for (int x = from; x < to; ++x) {
    const int before = std::max(x - 1, 0);
    const int after = std::min(x + 1, width - 1);
    const int gx = in.above[after] + 2 * in.here[after] + in.under[after] - in.above[before] - 2 * in.here[before] -
                   in.under[before];
    const int gy =
        in.under[before] + 2 * in.under[x] + in.under[after] - in.above[before] - 2 * in.above[x] - in.above[after];
    const float root = std::sqrt(static_cast<float>(gx * gx + gy * gy));  // exact, see above
    out[x] = static_cast<std::uint8_t>(static_cast<int>(std::min(root, 255.0F)));
  }
}

}  // namespace

void sobel_row_reference(const SobelRows& in, int width, std::uint8_t* out) noexcept {
  columns(in, width, 0, width, out);
}

void sobel_row(const SobelRows& in, int width, std::uint8_t* out) noexcept {
  const int done = simd_in_use() == SimdTarget::kScalar ? 0 : HWY_DYNAMIC_DISPATCH(inner_columns)(in, width, out);
  if (done == 0) return sobel_row_reference(in, width, out);
  columns(in, width, 0, 1, out);
  columns(in, width, 1 + done, width, out);
}

}  // namespace stereotrack

#endif
