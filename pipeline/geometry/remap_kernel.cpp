#include "pipeline/geometry/remap_kernel.hpp"

#include <algorithm>
#include <cstring>

#include "pipeline/core/simd.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "pipeline/geometry/remap_kernel.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "pipeline/core/byte_lanes-inl.h"

#ifndef STEREOTRACK_REMAP_KERNEL_SHARED
#define STEREOTRACK_REMAP_KERNEL_SHARED
namespace stereotrack {
namespace {

constexpr int kSubPixels = RemapTable::kSubPixels;
constexpr int kBlock = RemapTable::kBlock;
constexpr int kWindowColumns = 16;
constexpr int kWindowRows = 3;
constexpr unsigned kFractionMask = (1U << RemapTable::kFractionBits) - 1;

// 0 or kSubPixels, whichever is nearer; halves up. In: 0..kSubPixels.
constexpr unsigned rounded(unsigned fraction) noexcept { return (fraction + kSubPixels / 2) & kSubPixels; }

[[maybe_unused]] void remap_pixels(ImageView<const std::uint8_t> raw, const RemapTable& table, int row,
                                   Sampling sampling, int from, int to, std::uint8_t* out) noexcept {
  const RawPixel* corners = table.corner.row(row);
  const std::uint16_t* fractions = table.fractions.row(row);
  for (int u = from; u < to; ++u) {
    if (!corners[u].valid()) {
      out[u] = 0;
      continue;
    }
    const std::uint8_t* upper = raw.row(corners[u].y) + corners[u].x;
    const std::uint8_t* lower = upper + raw.stride;
    unsigned a = fractions[u] & kFractionMask;
    unsigned b = fractions[u] >> RemapTable::kFractionBits;
    if (sampling == Sampling::kNearest) {
      a = rounded(a);
      b = rounded(b);
    }
    const unsigned top = upper[0] * (kSubPixels - a) + upper[1] * a;
    const unsigned bottom = lower[0] * (kSubPixels - a) + lower[1] * a;
    out[u] = static_cast<std::uint8_t>((top * (kSubPixels - b) + bottom * b + kSubPixels * kSubPixels / 2) /
                                       (kSubPixels * kSubPixels));
  }
}

}  // namespace
}  // namespace stereotrack
#endif

HWY_BEFORE_NAMESPACE();
namespace stereotrack {
namespace HWY_NAMESPACE {
namespace {

#if HWY_TARGET == HWY_SCALAR

void remap(ImageView<const std::uint8_t> raw, const RemapTable& table, int row, Sampling sampling, std::uint8_t* out) {
  remap_row_reference(raw, table, row, sampling, out);
}

#else

namespace hn = hwy::HWY_NAMESPACE;

// A table look-up reaches the 16 bytes of its part of the vector: a block's window for each part.
constexpr hn::FixedTag<std::uint8_t, kWindowColumns> kWindow{};
constexpr int kMostBlocks = hn::MaxLanes(hn::ScalableTag<std::uint8_t>()) >= 2 * kWindowColumns ? 2 : 1;

// 32 times the mixture of each pair of bytes; at most 8160.
template <class V, class A>
A mixed(V pairs, A a) {
  const hn::DFromV<A> d;
  const auto left = hn::BitCast(d, even_bytes(pairs));
  const auto right = hn::BitCast(d, odd_bytes(pairs));
  return hn::Add(hn::ShiftLeft<5>(left), hn::Mul(hn::Sub(right, left), a));
}

/// A row of the table, from a block on.
struct Blocks {
  const RawPixel* windows;
  const std::uint8_t* places;
  const std::uint16_t* fractions;
  const std::uint8_t* mask;
};

// The pixels of neighbouring blocks, all of which have windows.
template <Sampling kSampling, int kBlocks>
auto map_together(ImageView<const std::uint8_t> raw, const Blocks& at) {
  const hn::FixedTag<std::uint16_t, kBlocks * kBlock> words;
  const hn::RebindToSigned<decltype(words)> as_signed;
  const hn::Repartition<std::uint8_t, decltype(words)> bytes;
  const hn::Rebind<std::uint8_t, decltype(words)> narrow;
  const auto window_row = [&](int row) HWY_ATTR {
    const auto of = [&](int block) HWY_ATTR {
      return hn::LoadU(kWindow, raw.row(at.windows[block].y + row) + at.windows[block].x);
    };
    if constexpr (kBlocks == 2) {
      return hn::Combine(bytes, of(1), of(0));
    } else {
      return of(0);
    }
  };
  const auto place = hn::PromoteTo(words, hn::LoadU(narrow, at.places));
  const auto column = hn::And(place, hn::Set(words, kWindowColumns - 1));
  const auto pairs = hn::BitCast(bytes, hn::Or(column, hn::ShiftLeft<8>(hn::Add(column, hn::Set(words, 1)))));
  const auto second = hn::TestBit(place, hn::Set(words, RemapTable::kSecondRow));
  const auto look_up = [&](int row)
                           HWY_ATTR { return hn::BitCast(words, hn::TableLookupBytes(window_row(row), pairs)); };
  const auto row0 = look_up(0);
  const auto row1 = look_up(1);
  const auto row2 = look_up(2);
  const auto fractions = hn::LoadU(words, at.fractions);
  auto a = hn::And(fractions, hn::Set(words, kFractionMask));
  auto b = hn::ShiftRight<RemapTable::kFractionBits>(fractions);
  if (kSampling == Sampling::kNearest) {
    const auto half = hn::Set(words, kSubPixels / 2);
    a = hn::And(hn::Add(a, half), hn::Set(words, kSubPixels));
    b = hn::And(hn::Add(b, half), hn::Set(words, kSubPixels));
  }
  const auto across = hn::BitCast(as_signed, a);
  const auto top = mixed(hn::BitCast(bytes, hn::IfThenElse(second, row1, row0)), across);
  const auto bottom = mixed(hn::BitCast(bytes, hn::IfThenElse(second, row2, row1)), across);
  // (32 top + b (bottom - top) + 512) / 1024 = (top + b (bottom - top) / 32 + 16) / 32, each rounded down; the inner
  // quotient is the upper half of 4 (bottom - top) 512 b, whose factors are below 2^15.
  const auto shift = hn::MulHigh(hn::ShiftLeft<2>(hn::Sub(bottom, top)), hn::BitCast(as_signed, hn::ShiftLeft<9>(b)));
  const auto sum = hn::Add(hn::Add(top, shift), hn::Set(as_signed, kSubPixels / 2));
  return hn::And(hn::DemoteTo(narrow, hn::ShiftRight<5>(sum)), hn::LoadU(narrow, at.mask));
}

template <Sampling kSampling>
void remap_blocks(ImageView<const std::uint8_t> raw, const RemapTable& table, int row, std::uint8_t* out) {
  const int width = table.corner.width;
  for (int u = 0; u < width;) {
    const Blocks at{table.window.row(row) + u / kBlock, table.place.row(row) + u, table.fractions.row(row) + u,
                    table.mask.row(row) + u};
    if constexpr (kMostBlocks == 2) {
      if (u + 2 * kBlock <= width && at.windows[0].valid() && at.windows[1].valid()) {
        hn::StoreU(map_together<kSampling, 2>(raw, at), hn::FixedTag<std::uint8_t, 2 * kBlock>(), out + u);
        u += 2 * kBlock;
        continue;
      }
    }
    if (!at.windows[0].valid()) {
      remap_pixels(raw, table, row, kSampling, u, std::min(u + kBlock, width), out);
    } else {
      const hn::FixedTag<std::uint8_t, kBlock> block;
      const auto value = map_together<kSampling, 1>(raw, at);
      if (u + kBlock <= width) {
        hn::StoreU(value, block, out + u);
      } else {
        alignas(kBlock) std::uint8_t end[kBlock];
        hn::Store(value, block, end);
        std::memcpy(out + u, end, static_cast<std::size_t>(width - u));
      }
    }
    u += kBlock;
  }
}

void remap(ImageView<const std::uint8_t> raw, const RemapTable& table, int row, Sampling sampling, std::uint8_t* out) {
  if (sampling == Sampling::kNearest) {
    remap_blocks<Sampling::kNearest>(raw, table, row, out);
  } else {
    remap_blocks<Sampling::kBilinear>(raw, table, row, out);
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

HWY_EXPORT(remap);

}  // namespace

void RemapTable::find_windows(int raw_width, int raw_height) noexcept {
  for (int v = 0; v < corner.height; ++v) {
    for (int u = 0; u < corner.width; u += kBlock) {
      const RawPixel* begin = corner.row(v) + u;
      const RawPixel* end = corner.row(v) + std::min(u + kBlock, corner.width);
      RawPixel low{INT16_MAX, INT16_MAX};
      RawPixel high{0, 0};
      for (const RawPixel* p = begin; p != end; ++p) {
        if (!p->valid()) continue;
        low = {std::min(low.x, p->x), std::min(low.y, p->y)};
        high = {std::max(high.x, p->x), std::max(high.y, p->y)};
      }
      const int x = std::min<int>(low.x, raw_width - kWindowColumns);
      const int y = std::min<int>(low.y, raw_height - kWindowRows);
      if (x < 0 || y < 0 || high.x - x > kWindowColumns - 2 || high.y - y > kWindowRows - 2) {
        window.at(u / kBlock, v) = {};
        continue;
      }
      window.at(u / kBlock, v) = {static_cast<std::int16_t>(x), static_cast<std::int16_t>(y)};
      for (const RawPixel* p = begin; p != end; ++p) {
        const int row = p->valid() && p->y > y ? kSecondRow : 0;
        place.at(u + static_cast<int>(p - begin), v) = static_cast<std::uint8_t>((p->valid() ? p->x - x : 0) + row);
      }
    }
  }
}

RemapTable RemapTable::columns(int begin, int end) const noexcept {
  const auto part = [&](auto picture) { return picture.window(begin, 0, end - begin, picture.height); };
  const int blocks = (end - begin + kBlock - 1) / kBlock;
  return {part(corner), part(fractions), part(mask), window.window(begin / kBlock, 0, blocks, window.height),
          part(place)};
}

void remap_row_reference(ImageView<const std::uint8_t> raw, const RemapTable& table, int row, Sampling sampling,
                         std::uint8_t* out) noexcept {
  remap_pixels(raw, table, row, sampling, 0, table.corner.width, out);
}

void remap_row(ImageView<const std::uint8_t> raw, const RemapTable& table, int row, Sampling sampling,
               std::uint8_t* out) noexcept {
  if (simd_in_use() == SimdTarget::kScalar) return remap_row_reference(raw, table, row, sampling, out);
  HWY_DYNAMIC_DISPATCH(remap)(raw, table, row, sampling, out);
}

}  // namespace stereotrack

#endif
