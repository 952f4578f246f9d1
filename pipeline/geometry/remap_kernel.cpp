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

// Eight pixels at a time, whatever the vectors' length: a table look-up reaches 16 bytes.
constexpr hn::FixedTag<std::uint8_t, 16> kBytes{};
constexpr hn::FixedTag<std::uint8_t, 8> kHalf{};
constexpr hn::FixedTag<std::uint16_t, 8> kWords{};
constexpr hn::FixedTag<std::int16_t, 8> kSigned{};
using Bytes = hn::Vec<decltype(kBytes)>;
using SignedWords = hn::Vec<decltype(kSigned)>;

// 32 times the mixture of each pair of bytes; at most 8160.
SignedWords mixed(Bytes pairs, SignedWords a) {
  const auto left = hn::BitCast(kSigned, even_bytes(pairs));
  const auto right = hn::BitCast(kSigned, odd_bytes(pairs));
  return hn::Add(hn::ShiftLeft<5>(left), hn::Mul(hn::Sub(right, left), a));
}

template <Sampling kSampling>
void remap_blocks(ImageView<const std::uint8_t> raw, const RemapTable& table, int row, std::uint8_t* out) {
  const int width = table.corner.width;
  const RawPixel* windows = table.window.row(row);
  const std::uint8_t* places = table.place.row(row);
  const std::uint16_t* fractions = table.fractions.row(row);
  const std::uint8_t* mask = table.mask.row(row);
  const auto half = hn::Set(kWords, kSubPixels / 2);
  for (int u = 0; u < width; u += kBlock) {
    const RawPixel window = windows[u / kBlock];
    if (!window.valid()) {
      remap_pixels(raw, table, row, kSampling, u, std::min(u + kBlock, width), out);
      continue;
    }
    const std::uint8_t* first = raw.row(window.y) + window.x;
    const auto place = hn::LoadU(kBytes, places + u);
    const auto column = hn::And(place, hn::Set(kBytes, kWindowColumns - 1));
    const auto pairs = hn::InterleaveLower(kBytes, column, hn::Add(column, hn::Set(kBytes, 1)));
    const auto row_bit = hn::InterleaveLower(kBytes, place, place);
    const auto second = hn::TestBit(row_bit, hn::Set(kBytes, RemapTable::kSecondRow));
    const auto row0 = hn::TableLookupBytes(hn::LoadU(kBytes, first), pairs);
    const auto row1 = hn::TableLookupBytes(hn::LoadU(kBytes, first + raw.stride), pairs);
    const auto row2 = hn::TableLookupBytes(hn::LoadU(kBytes, first + 2 * raw.stride), pairs);
    auto a = hn::And(hn::LoadU(kWords, fractions + u), hn::Set(kWords, kFractionMask));
    auto b = hn::ShiftRight<RemapTable::kFractionBits>(hn::LoadU(kWords, fractions + u));
    if (kSampling == Sampling::kNearest) {
      a = hn::And(hn::Add(a, half), hn::Set(kWords, kSubPixels));
      b = hn::And(hn::Add(b, half), hn::Set(kWords, kSubPixels));
    }
    const auto top = mixed(hn::IfThenElse(second, row1, row0), hn::BitCast(kSigned, a));
    const auto bottom = mixed(hn::IfThenElse(second, row2, row1), hn::BitCast(kSigned, a));
    // (32 top + b (bottom - top) + 512) / 1024 = (top + b (bottom - top) / 32 + 16) / 32, each rounded down; the inner
    // quotient is the upper half of 4 (bottom - top) 512 b, whose factors are below 2^15.
    const auto shift = hn::MulHigh(hn::ShiftLeft<2>(hn::Sub(bottom, top)), hn::BitCast(kSigned, hn::ShiftLeft<9>(b)));
    const auto sum = hn::Add(hn::Add(top, shift), hn::Set(kSigned, kSubPixels / 2));
    const auto value = hn::And(hn::DemoteTo(kHalf, hn::ShiftRight<5>(sum)), hn::LoadU(kHalf, mask + u));
    if (u + kBlock <= width) {
      hn::StoreU(value, kHalf, out + u);
    } else {
      alignas(kBlock) std::uint8_t end[kBlock];
      hn::Store(value, kHalf, end);
      std::memcpy(out + u, end, static_cast<std::size_t>(width - u));
    }
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
