#include "pipeline/photometry/smooth.hpp"

#include <algorithm>

#include "pipeline/core/simd.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "pipeline/photometry/smooth.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "pipeline/core/byte_lanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace stereotrack {
namespace HWY_NAMESPACE {
namespace {

// Columns 1 .. width - 2; false, and nothing is done, where they are less than a vector.

#if HWY_TARGET == HWY_SCALAR

bool smooth_inner(ImageView<const std::uint8_t>, ImageView<std::uint8_t>) { return false; }

#else

namespace hn = hwy::HWY_NAMESPACE;

// Downwards, so that each row is read and summed but once.
void smooth_strip(ImageView<const std::uint8_t> in, int x, ImageView<std::uint8_t> out) {
  const hn::ScalableTag<std::uint8_t> d;
  const hn::RepartitionToWide<decltype(d)> d16;
  const auto even_sum = [&](const std::uint8_t* row) HWY_ATTR {  // of the pixels x, x + 2, ...
    const auto here = hn::LoadU(d, row + x);
    const auto even = even_bytes(here);
    return hn::Add(hn::Add(even_bytes(hn::LoadU(d, row + x - 1)), odd_bytes(here)), hn::Add(even, even));
  };
  const auto odd_sum = [&](const std::uint8_t* row) HWY_ATTR {
    const auto here = hn::LoadU(d, row + x);
    const auto odd = odd_bytes(here);
    return hn::Add(hn::Add(even_bytes(here), odd_bytes(hn::LoadU(d, row + x + 1))), hn::Add(odd, odd));
  };
  const auto rounding = hn::Set(d16, std::uint16_t{8});
  const auto sixteenth = [&](auto above, auto here, auto under) HWY_ATTR {
    return hn::ShiftRight<4>(hn::Add(hn::Add(above, under), hn::Add(hn::Add(here, here), rounding)));
  };
  auto even_above = even_sum(in.row(0));
  auto odd_above = odd_sum(in.row(0));
  auto even_here = even_above;
  auto odd_here = odd_above;
  for (int y = 0; y < out.height; ++y) {
    const std::uint8_t* next = in.row(std::min(y + 1, out.height - 1));
    const auto even_under = even_sum(next);
    const auto odd_under = odd_sum(next);
    hn::StoreU(zip_bytes(sixteenth(even_above, even_here, even_under), sixteenth(odd_above, odd_here, odd_under)), d,
               out.row(y) + x);
    even_above = even_here;
    odd_above = odd_here;
    even_here = even_under;
    odd_here = odd_under;
  }
}

bool smooth_inner(ImageView<const std::uint8_t> in, ImageView<std::uint8_t> out) {
  const int lanes = static_cast<int>(hn::Lanes(hn::ScalableTag<std::uint8_t>()));
  const int last = out.width - 1 - lanes;  // the last strip overlaps the one before it
  if (last < 1) return false;
  for (int x = 1; x < last; x += lanes) smooth_strip(in, x, out);
  smooth_strip(in, last, out);
  return true;
}

#endif

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace stereotrack
HWY_AFTER_NAMESPACE();

#if HWY_ONCE

namespace stereotrack {

namespace {

HWY_EXPORT(smooth_inner);

void smooth_columns(ImageView<const std::uint8_t> in, ImageView<std::uint8_t> out, int from, int to) noexcept {
  for (int y = 0; y < out.height; ++y) {
    const std::uint8_t* a = in.row(std::max(y - 1, 0));
    const std::uint8_t* b = in.row(y);
    const std::uint8_t* c = in.row(std::min(y + 1, out.height - 1));
    const auto column = [&](int x) { return a[x] + 2 * b[x] + c[x]; };
    for (int x = from; x < to; ++x) {
      const int before = column(std::max(x - 1, 0));
      const int after = column(std::min(x + 1, out.width - 1));
      out.at(x, y) = static_cast<std::uint8_t>((before + 2 * column(x) + after + 8) >> 4);
    }
  }
}

}  // namespace

void smooth3x3_reference(ImageView<const std::uint8_t> in, ImageView<std::uint8_t> out) noexcept {
  smooth_columns(in, out, 0, out.width);
}

void smooth3x3(ImageView<const std::uint8_t> in, ImageView<std::uint8_t> out) noexcept {
  if (out.empty()) return;
  if (simd_in_use() == SimdTarget::kScalar || !HWY_DYNAMIC_DISPATCH(smooth_inner)(in, out)) {
    return smooth3x3_reference(in, out);
  }
  smooth_columns(in, out, 0, 1);
  smooth_columns(in, out, out.width - 1, out.width);
}

}  // namespace stereotrack

#endif
