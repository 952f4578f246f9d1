#include "pipeline/photometry/smooth.hpp"

#include <algorithm>
#include <array>

#include "pipeline/core/simd.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "pipeline/photometry/smooth.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "pipeline/core/byte_lanes-inl.h"

#ifndef STEREOTRACK_SMOOTH_COLUMNS
#define STEREOTRACK_SMOOTH_COLUMNS
namespace stereotrack {
namespace {

constexpr int kWidest = 8192;  // wider pictures are the reference's

/// The vertical sums of a row, the even columns apart from the odd ones.
struct Columns {
  static constexpr std::size_t kFrame = 64;  // before and after, for neighbours and whole vectors
  std::uint16_t* even() noexcept { return even_.data() + kFrame; }
  std::uint16_t* odd() noexcept { return odd_.data() + kFrame; }

 private:
  alignas(128) std::array<std::uint16_t, kWidest / 2 + 2 * kFrame> even_;
  alignas(128) std::array<std::uint16_t, kWidest / 2 + 2 * kFrame> odd_;
};

}  // namespace
}  // namespace stereotrack
#endif

HWY_BEFORE_NAMESPACE();
namespace stereotrack {
namespace HWY_NAMESPACE {
namespace {

#if HWY_TARGET == HWY_SCALAR

void smooth(ImageView<const std::uint8_t> in, ImageView<std::uint8_t> out) { smooth3x3_reference(in, out); }

#else

namespace hn = hwy::HWY_NAMESPACE;

constexpr hn::ScalableTag<std::uint8_t> kBytes{};
constexpr hn::RepartitionToWide<hn::ScalableTag<std::uint8_t> > kWords{};
using Word = hn::Vec<decltype(kWords)>;

Word one_two_one(Word a, Word b, Word c) { return hn::Add(hn::Add(a, c), hn::Add(b, b)); }

void sum_columns(const std::uint8_t* above, const std::uint8_t* here, const std::uint8_t* under, int width,
                 std::uint16_t* even, std::uint16_t* odd) {
  const int lanes = static_cast<int>(hn::Lanes(kBytes));
  int x = 0;
  for (; x + lanes <= width; x += lanes) {
    const auto a = hn::LoadU(kBytes, above + x);
    const auto b = hn::LoadU(kBytes, here + x);
    const auto c = hn::LoadU(kBytes, under + x);
    hn::StoreU(one_two_one(even_bytes(a), even_bytes(b), even_bytes(c)), kWords, even + x / 2);
    hn::StoreU(one_two_one(odd_bytes(a), odd_bytes(b), odd_bytes(c)), kWords, odd + x / 2);
  }
  const auto column = [&](int u) { return static_cast<std::uint16_t>(above[u] + 2 * here[u] + under[u]); };
  for (; x < width; ++x) (x % 2 == 0 ? even : odd)[x / 2] = column(x);
  // The first and the last column stand in for those outside.
  odd[-1] = even[0];
  // In a variable of its own: with -fsanitize=shift GCC 12 takes the index of another one otherwise.
  std::uint16_t* const outside = width % 2 == 0 ? even : odd;
  outside[width / 2] = column(width - 1);
}

void smooth(ImageView<const std::uint8_t> in, ImageView<std::uint8_t> out) {
  const int width = out.width;
  const int lanes = static_cast<int>(hn::Lanes(kBytes));
  const Word rounding = hn::Set(kWords, std::uint16_t{8});
  Columns columns;
  std::uint16_t* even = columns.even();
  std::uint16_t* odd = columns.odd();
  for (int y = 0; y < out.height; ++y) {
    sum_columns(in.row(std::max(y - 1, 0)), in.row(y), in.row(std::min(y + 1, out.height - 1)), width, even, odd);
    std::uint8_t* to = out.row(y);
    int x = 0;
    for (; x + lanes <= width; x += lanes) {
      const int i = x / 2;
      const Word e = hn::LoadU(kWords, even + i);
      const Word o = hn::LoadU(kWords, odd + i);
      const Word even_sum = one_two_one(hn::LoadU(kWords, odd + i - 1), e, o);
      const Word odd_sum = one_two_one(e, o, hn::LoadU(kWords, even + i + 1));
      hn::StoreU(
          zip_bytes(hn::ShiftRight<4>(hn::Add(even_sum, rounding)), hn::ShiftRight<4>(hn::Add(odd_sum, rounding))),
          kBytes, to + x);
    }
    for (; x < width; ++x) {
      const int i = x / 2;
      const int sum = x % 2 == 0 ? odd[i - 1] + 2 * even[i] + odd[i] : even[i] + 2 * odd[i] + even[i + 1];
      to[x] = static_cast<std::uint8_t>((sum + 8) >> 4);
    }
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

HWY_EXPORT(smooth);

}  // namespace

void smooth3x3_reference(ImageView<const std::uint8_t> in, ImageView<std::uint8_t> out) noexcept {
  for (int y = 0; y < out.height; ++y) {
    const std::uint8_t* a = in.row(std::max(y - 1, 0));
    const std::uint8_t* b = in.row(y);
    const std::uint8_t* c = in.row(std::min(y + 1, out.height - 1));
    const auto column = [&](int x) { return a[x] + 2 * b[x] + c[x]; };
    for (int x = 0; x < out.width; ++x) {
      const int before = column(std::max(x - 1, 0));
      const int after = column(std::min(x + 1, out.width - 1));
      out.at(x, y) = static_cast<std::uint8_t>((before + 2 * column(x) + after + 8) >> 4);
    }
  }
}

void smooth3x3(ImageView<const std::uint8_t> in, ImageView<std::uint8_t> out) noexcept {
  if (out.empty()) return;
  if (simd_in_use() == SimdTarget::kScalar || out.width > kWidest) return smooth3x3_reference(in, out);
  HWY_DYNAMIC_DISPATCH(smooth)(in, out);
}

}  // namespace stereotrack

#endif
