#include "pipeline/track/features_kernel.hpp"

#include <algorithm>
#include <cstdlib>

#include "pipeline/core/simd.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "pipeline/track/features_kernel.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#ifndef STEREOTRACK_FEATURES_KERNEL_SHARED
#define STEREOTRACK_FEATURES_KERNEL_SHARED
namespace stereotrack {
namespace {

// Of best_place().
std::int32_t cost_at(const Patch& patch, ImageView<const std::uint8_t> luma, int x, int y) noexcept {
  const auto apart = [&](int u, int v) {
    return patch[static_cast<std::size_t>(v * kPatchSide + u)] - luma.at(x + u - kPatchReach, y + v - kPatchReach);
  };
  int shift = 0;
  for (int v = 0; v < kPatchSide; ++v) {
    for (int u = 0; u < kPatchSide; ++u) shift += apart(u, v);
  }
  int cost = 0;
  for (int v = 0; v < kPatchSide; ++v) {
    for (int u = 0; u < kPatchSide; ++u) cost += std::abs(apart(u, v) * kPatchArea - shift);
  }
  return cost / kPatchArea;
}

}  // namespace
}  // namespace stereotrack
#endif

HWY_BEFORE_NAMESPACE();
namespace stereotrack {
namespace HWY_NAMESPACE {
namespace {

#if HWY_TARGET == HWY_SCALAR

PatchPlace best_of(const Patch& patch, ImageView<const std::uint8_t> luma, const Rect& window) {
  return best_place_reference(patch, luma, window);
}
void tensors_of(ImageView<const std::uint8_t> luma, int x, int y, int count, Tensor* out) {
  tensors_reference(luma, x, y, count, out);
}

#else

namespace hn = hwy::HWY_NAMESPACE;

constexpr std::size_t kMostLanes = 16;
using Wide = hn::CappedTag<std::uint16_t, kMostLanes>;
using Narrow = hn::CappedTag<std::uint16_t, kMostLanes / 2>;

// What the patches of two neighbouring rows of places cover of the picture.
constexpr int kRows = kPatchSide + 1;
constexpr std::size_t kRowLength = kMostPlaces + kPatchSide - 1 + 2 * kMostLanes;
struct Rows {
  alignas(
      64) std::uint16_t scaled[kRows][kRowLength] = {};  // pixels times kPatchArea; row r of the window's at r % kRows
  alignas(64) std::uint16_t sums[2][kRowLength] = {};    // of the columns under the upper patches, and the lower
};

// A difference of two sums, or of pixels times kPatchArea, is at least -kBias.
constexpr int kBias = 255 * kPatchArea;

struct Shape {
  alignas(64) std::uint16_t biased[kPatchArea];  // pixels times kPatchArea, and kBias
  int sum = 0;
};

// Row r under the patches enters; nothing is read outside the picture.
void enter(ImageView<const std::uint8_t> luma, int x, int y, int columns, std::uint16_t* scaled) {
  const Wide wide;
  const hn::Rebind<std::uint8_t, Wide> bytes;
  const int lanes = static_cast<int>(hn::Lanes(wide));
  const std::uint8_t* from = luma.row(y) + x;
  int u = 0;
  for (; u < columns && x + u + lanes <= luma.width; u += lanes) {
    hn::StoreU(hn::Mul(hn::PromoteTo(wide, hn::LoadU(bytes, from + u)), hn::Set(wide, kPatchArea)), wide, scaled + u);
  }
  for (; u < columns; ++u) scaled[u] = static_cast<std::uint16_t>(from[u] * kPatchArea);
}

// The sums of nine rows' columns, pixels as they are: from those one row further up.
void move_down(const std::uint16_t* above, const std::uint8_t* leaves, const std::uint8_t* enters, int columns,
               std::uint16_t* sums) {
  for (int u = 0; u < columns; ++u) sums[u] = static_cast<std::uint16_t>(above[u] + enters[u] - leaves[u]);
}

template <class D>
hn::Vec<D> nine(D d, const std::uint16_t* sums) {
  auto sum = hn::LoadU(d, sums);
  for (int u = 1; u < kPatchSide; ++u) sum = hn::Add(sum, hn::LoadU(d, sums + u));
  return sum;
}

// The costs of as many places as D has lanes: sums of the picture's pixels under each, and the picture's row v under
// the patches from column u on. Differences of 16 bits: 2 kBias < 2^16. Where a few of the patch's rows tell that none
// costs less than `most` they get INT32_MAX.
template <class D, class Row>
void costs_from(D d, const Shape& shape, hn::Vec<D> sum, Row&& row, std::int32_t most, std::int32_t* costs) {
  constexpr int kFewRows = 3;
  const hn::RepartitionToWide<D> sums;
  const auto limit = hn::Set(sums, static_cast<std::uint32_t>(most) * kPatchArea);
  const auto shift = hn::Sub(hn::Set(d, static_cast<std::uint16_t>(shape.sum + kBias)), sum);
  auto even = hn::Zero(sums);
  auto odd = hn::Zero(sums);
  for (int v = 0; v < kPatchSide; ++v) {
    for (int u = 0; u < kPatchSide; ++u) {
      const auto difference = hn::Sub(hn::Set(d, shape.biased[v * kPatchSide + u]), row(v, u));
      const auto apart = hn::Or(hn::SaturatedSub(difference, shift), hn::SaturatedSub(shift, difference));
      const auto pairs = hn::BitCast(sums, apart);
      even = hn::Add(even, hn::And(pairs, hn::Set(sums, 0xFFFFU)));
      odd = hn::Add(odd, hn::ShiftRight<16>(pairs));
    }
    if (v % kFewRows != kFewRows - 1) continue;
    const auto least = hn::Min(even, odd);
    if (hn::AllTrue(sums, hn::Eq(hn::Max(least, limit), least))) {
      std::fill_n(costs, hn::Lanes(d), INT32_MAX);
      return;
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

constexpr int kHalf = kMostLanes / 2;

// The costs of kHalf places under the sums `upper`, and of as many in the row below, where a vector holds both.
template <class D>
void two_rows_from(D d, const Shape& shape, const std::uint16_t* upper, const std::uint16_t* lower,
                   const std::uint16_t* const* under, std::int32_t most, std::int32_t* costs) {
  if constexpr (hn::MaxLanes(D()) == kMostLanes) {
    const hn::Half<D> half;
    costs_from(
        d, shape, hn::Combine(d, nine(half, lower), nine(half, upper)),
        [&](int v, int u)
            HWY_ATTR { return hn::Combine(d, hn::LoadU(half, under[v + 1] + u), hn::LoadU(half, under[v] + u)); },
        most, costs);
  }
}

PatchPlace best_of(const Patch& patch, ImageView<const std::uint8_t> luma, const Rect& window) {
  Rows rows;
  Shape shape;
  for (int i = 0; i < kPatchArea; ++i) {
    shape.biased[i] = static_cast<std::uint16_t>(patch[static_cast<std::size_t>(i)] * kPatchArea + kBias);
    shape.sum += patch[static_cast<std::size_t>(i)];
  }
  const int columns = window.width + kPatchSide - 1;
  const int left = window.left - kPatchReach;
  const int top = window.top - kPatchReach;
  for (int r = 0; r < kPatchSide; ++r) {
    enter(luma, left, top + r, columns, rows.scaled[r]);
    const std::uint8_t* from = luma.row(top + r) + left;
    for (int u = 0; u < columns; ++u) rows.sums[0][u] = static_cast<std::uint16_t>(rows.sums[0][u] + from[u]);
  }
  const Wide wide;
  const Narrow narrow;
  std::int32_t costs[2 * (kMostPlaces + kMostLanes)];
  // The middle, where the patch is expected, mostly costs little: what costs more need not be known.
  std::int32_t most = cost_at(patch, luma, window.left + window.width / 2, window.top + window.height / 2) + 1;
  PatchPlace best{INT32_MAX, 0, 0};
  const auto keep = [&](const std::int32_t* found, int y) {
    for (int i = 0; i < window.width; ++i) {
      if (found[i] < best.cost) best = {found[i], window.left + i, y};
    }
    most = std::min(most, best.cost);
  };
  for (int k = 0; k < window.height;) {
    const auto row_of = [&](int r) { return rows.scaled[(k + r) % kRows]; };
    const std::uint16_t* under[kRows];
    for (int r = 0; r < kRows; ++r) under[r] = row_of(r);
    // Row k + kPatchSide enters, and row k leaves the sums.
    const auto go_down = [&](const std::uint16_t* above, std::uint16_t* sums) {
      enter(luma, left, top + k + kPatchSide, columns, row_of(kPatchSide));
      move_down(above, luma.row(top + k) + left, luma.row(top + k + kPatchSide) + left, columns, sums);
    };
    const bool more = k + 1 < window.height;
    if (hn::MaxLanes(wide) == kMostLanes && window.width <= kHalf && more) {
      go_down(rows.sums[0], rows.sums[1]);
      two_rows_from(wide, shape, rows.sums[0], rows.sums[1], under, most, costs);
      keep(costs, window.top + k);
      keep(costs + kHalf, window.top + k + 1);
      ++k;
      if (k + 1 < window.height) go_down(rows.sums[1], rows.sums[0]);
      ++k;
      continue;
    }
    for (int i = 0; i < window.width;) {
      const auto at = [&](auto d) HWY_ATTR {
        costs_from(
            d, shape, nine(d, rows.sums[0] + i), [&](int v, int u) HWY_ATTR { return hn::LoadU(d, under[v] + i + u); },
            most, costs + i);
        return static_cast<int>(hn::Lanes(d));
      };
      i += window.width - i > kHalf ? at(wide) : at(narrow);
    }
    keep(costs, window.top + k);
    if (more) go_down(rows.sums[0], rows.sums[0]);
    ++k;
  }
  return best;
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
      // NOLINTNEXTLINE(clang-analyzer-core.UndefinedBinaryOperatorResult): k + 4 < length, which is count + 4
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

HWY_EXPORT(best_of);
HWY_EXPORT(tensors_of);

}  // namespace

PatchPlace best_place_reference(const Patch& patch, ImageView<const std::uint8_t> luma, const Rect& window) noexcept {
  PatchPlace best{INT32_MAX, 0, 0};
  for (int y = window.top; y < window.bottom(); ++y) {
    for (int x = window.left; x < window.right(); ++x) {
      const int cost = cost_at(patch, luma, x, y);
      if (cost < best.cost) best = {cost, x, y};
    }
  }
  return best;
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

PatchPlace best_place(const Patch& patch, ImageView<const std::uint8_t> luma, const Rect& window) noexcept {
  if (simd_in_use() == SimdTarget::kScalar) return best_place_reference(patch, luma, window);
  return HWY_DYNAMIC_DISPATCH(best_of)(patch, luma, window);
}

void tensors(ImageView<const std::uint8_t> luma, int x, int y, int count, Tensor* out) noexcept {
  if (simd_in_use() == SimdTarget::kScalar) return tensors_reference(luma, x, y, count, out);
  HWY_DYNAMIC_DISPATCH(tensors_of)(luma, x, y, count, out);
}

}  // namespace stereotrack

#endif
