#include "pipeline/track/features_kernel.hpp"

#include <algorithm>
#include <cstdlib>

#include "pipeline/core/simd.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "pipeline/track/features_kernel.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace stereotrack {
namespace HWY_NAMESPACE {
namespace {

#if HWY_TARGET == HWY_SCALAR

void costs_of(const Patch& patch, ImageView<const std::uint8_t> luma, int x, int y, int count, std::int32_t* costs) {
  patch_costs_reference(patch, luma, x, y, count, costs);
}
void tensors_of(ImageView<const std::uint8_t> luma, int x, int y, int count, Tensor* out) {
  tensors_reference(luma, x, y, count, out);
}

#else

namespace hn = hwy::HWY_NAMESPACE;

constexpr std::size_t kMostLanes = 16;
using Wide = hn::CappedTag<std::uint16_t, kMostLanes>;
using Narrow = hn::CappedTag<std::uint16_t, kMostLanes / 2>;

// The picture's rows under the patch, times kPatchArea, and the sums of their columns; what follows the last place's
// patch is 0.
constexpr std::size_t kRowLength = kMostPlaces + kPatchSide - 1 + kMostLanes;
struct Rows {
  alignas(64) std::uint16_t scaled[kPatchSide][kRowLength];
  alignas(64) std::uint16_t column_sums[kRowLength];
};

// A difference of two sums, or of pixels times kPatchArea, is at least -kBias.
constexpr int kBias = 255 * kPatchArea;

// The costs of as many places as D has lanes, from place i on. Differences of 16 bits: 2 kBias < 2^16.
template <class D>
void costs_from(D d, const Rows& rows, const std::uint16_t* biased, int patch_sum, int i, std::int32_t* costs) {
  const hn::RepartitionToWide<D> sums;
  auto sum = hn::LoadU(d, rows.column_sums + i);
  for (int u = 1; u < kPatchSide; ++u) sum = hn::Add(sum, hn::LoadU(d, rows.column_sums + i + u));
  const auto shift = hn::Sub(hn::Set(d, static_cast<std::uint16_t>(patch_sum + kBias)), sum);
  auto even = hn::Zero(sums);
  auto odd = hn::Zero(sums);
  for (int v = 0; v < kPatchSide; ++v) {
    const std::uint16_t* row = rows.scaled[v] + i;
    for (int u = 0; u < kPatchSide; ++u) {
      const auto difference = hn::Sub(hn::Set(d, biased[v * kPatchSide + u]), hn::LoadU(d, row + u));
      const auto apart = hn::Or(hn::SaturatedSub(difference, shift), hn::SaturatedSub(shift, difference));
      const auto pairs = hn::BitCast(sums, apart);
      even = hn::Add(even, hn::And(pairs, hn::Set(sums, 0xFFFFU)));
      odd = hn::Add(odd, hn::ShiftRight<16>(pairs));
    }
  }
  alignas(64) std::uint32_t even_sums[kMostLanes / 2];
  alignas(64) std::uint32_t odd_sums[kMostLanes / 2];
  hn::Store(even, sums, even_sums);
  hn::Store(odd, sums, odd_sums);
  for (std::size_t k = 0; k < hn::Lanes(sums); ++k) {
    costs[2 * k] = static_cast<std::int32_t>(even_sums[k] / kPatchArea);
    costs[2 * k + 1] = static_cast<std::int32_t>(odd_sums[k] / kPatchArea);
  }
}

void costs_of(const Patch& patch, ImageView<const std::uint8_t> luma, int x, int y, int count, std::int32_t* costs) {
  Rows rows;
  const int columns = count + kPatchSide - 1;
  std::fill_n(rows.column_sums, kRowLength, std::uint16_t{0});
  for (int v = 0; v < kPatchSide; ++v) {
    const std::uint8_t* from = luma.row(y + v - kPatchReach) + x - kPatchReach;
    std::uint16_t* scaled = rows.scaled[v];
    for (int u = 0; u < columns; ++u) {
      scaled[u] = static_cast<std::uint16_t>(from[u] * kPatchArea);
      rows.column_sums[u] = static_cast<std::uint16_t>(rows.column_sums[u] + from[u]);
    }
    std::fill_n(scaled + columns, kMostLanes, std::uint16_t{0});
  }
  std::uint16_t biased[kPatchArea];
  int patch_sum = 0;
  for (int i = 0; i < kPatchArea; ++i) {
    biased[i] = static_cast<std::uint16_t>(patch[static_cast<std::size_t>(i)] * kPatchArea + kBias);
    patch_sum += patch[static_cast<std::size_t>(i)];
  }
  const Wide wide;
  const Narrow narrow;
  std::int32_t found[kMostPlaces + kMostLanes];
  for (int i = 0; i < count;) {
    if (count - i > static_cast<int>(hn::Lanes(narrow))) {
      costs_from(wide, rows, biased, patch_sum, i, found + i);
      i += static_cast<int>(hn::Lanes(wide));
    } else {
      costs_from(narrow, rows, biased, patch_sum, i, found + i);
      i += static_cast<int>(hn::Lanes(narrow));
    }
  }
  std::copy_n(found, count, costs);
}

// Sums of columns, then of five of them.
void tensors_of(ImageView<const std::uint8_t> luma, int x, int y, int count, Tensor* out) {
  const hn::CappedTag<std::int32_t, kMostLanes> d;
  const hn::Rebind<std::uint8_t, decltype(d)> pixels;
  const int lanes = static_cast<int>(hn::Lanes(d));
  constexpr std::size_t kLength = kMostTensors + 2 * kTensorReach + kMostLanes;
  alignas(64) std::int32_t columns[3][kLength];
  const int first = x - kTensorReach;
  const int length = count + 2 * kTensorReach;
  int i = 0;
  // Vectors must see whole columns of the picture.
  for (; i < length && first + i + lanes + 1 <= luma.width; i += lanes) {
    auto a = hn::Zero(d);
    auto b = hn::Zero(d);
    auto c = hn::Zero(d);
    const auto load = [&](int u, int v)
                          HWY_ATTR { return hn::PromoteTo(d, hn::LoadU(pixels, luma.row(v) + first + i + u)); };
    for (int v = y - kTensorReach; v <= y + kTensorReach; ++v) {
      const auto gx = hn::Sub(load(1, v), load(-1, v));
      const auto gy = hn::Sub(load(0, v + 1), load(0, v - 1));
      a = hn::Add(a, hn::Mul(gx, gx));
      b = hn::Add(b, hn::Mul(gx, gy));
      c = hn::Add(c, hn::Mul(gy, gy));
    }
    hn::StoreU(a, d, columns[0] + i);
    hn::StoreU(b, d, columns[1] + i);
    hn::StoreU(c, d, columns[2] + i);
  }
  for (; i < length; ++i) {
    for (auto& sums : columns) sums[i] = 0;
    for (int v = y - kTensorReach; v <= y + kTensorReach; ++v) {
      const int gx = luma.at(first + i + 1, v) - luma.at(first + i - 1, v);
      const int gy = luma.at(first + i, v + 1) - luma.at(first + i, v - 1);
      columns[0][i] += gx * gx;
      columns[1][i] += gx * gy;
      columns[2][i] += gy * gy;
    }
  }
  for (int k = 0; k < count; ++k) {
    const auto five = [k](const std::int32_t* sums) {
      return sums[k] + sums[k + 1] + sums[k + 2] + sums[k + 3] + sums[k + 4];
    };
    out[k] = {five(columns[0]), five(columns[1]), five(columns[2])};
  }
}

#endif

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace stereotrack
HWY_AFTER_NAMESPACE();

#if HWY_ONCE

namespace stereotrack {

namespace {

HWY_EXPORT(costs_of);
HWY_EXPORT(tensors_of);

}  // namespace

void patch_costs_reference(const Patch& patch, ImageView<const std::uint8_t> luma, int x, int y, int count,
                           std::int32_t* costs) noexcept {
  for (int i = 0; i < count; ++i) {
    const auto apart = [&](int u, int v) {
      return patch[static_cast<std::size_t>(v * kPatchSide + u)] -
             luma.at(x + i + u - kPatchReach, y + v - kPatchReach);
    };
    int shift = 0;
    for (int v = 0; v < kPatchSide; ++v) {
      for (int u = 0; u < kPatchSide; ++u) shift += apart(u, v);
    }
    int cost = 0;
    for (int v = 0; v < kPatchSide; ++v) {
      for (int u = 0; u < kPatchSide; ++u) cost += std::abs(apart(u, v) * kPatchArea - shift);
    }
    costs[i] = cost / kPatchArea;
  }
}

void tensors_reference(ImageView<const std::uint8_t> luma, int x, int y, int count, Tensor* out) noexcept {
  for (int i = 0; i < count; ++i) {
    out[i] = {};
    for (int v = y - kTensorReach; v <= y + kTensorReach; ++v) {
      for (int u = x + i - kTensorReach; u <= x + i + kTensorReach; ++u) {
        const int gx = luma.at(u + 1, v) - luma.at(u - 1, v);
        const int gy = luma.at(u, v + 1) - luma.at(u, v - 1);
        out[i].a += gx * gx;
        out[i].b += gx * gy;
        out[i].c += gy * gy;
      }
    }
  }
}

void patch_costs(const Patch& patch, ImageView<const std::uint8_t> luma, int x, int y, int count,
                 std::int32_t* costs) noexcept {
  if (simd_in_use() == SimdTarget::kScalar) return patch_costs_reference(patch, luma, x, y, count, costs);
  HWY_DYNAMIC_DISPATCH(costs_of)(patch, luma, x, y, count, costs);
}

void tensors(ImageView<const std::uint8_t> luma, int x, int y, int count, Tensor* out) noexcept {
  if (simd_in_use() == SimdTarget::kScalar) return tensors_reference(luma, x, y, count, out);
  HWY_DYNAMIC_DISPATCH(tensors_of)(luma, x, y, count, out);
}

}  // namespace stereotrack

#endif
