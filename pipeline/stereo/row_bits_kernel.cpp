#include "pipeline/stereo/row_bits_kernel.hpp"

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <iterator>

#include "pipeline/core/simd.hpp"
#include "pipeline/stereo/disparity.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "pipeline/stereo/row_bits_kernel.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#ifndef STEREOTRACK_ROW_BITS_KERNEL_COMMON
#define STEREOTRACK_ROW_BITS_KERNEL_COMMON
namespace stereotrack {

namespace {

[[maybe_unused]] bool alike(int a, int b, int step) noexcept {
  return a != kNoDisparity && b != kNoDisparity && std::abs(a - b) <= step;
}

[[maybe_unused]] void set_bit(std::uint64_t* bits, int x, bool value) noexcept {
  bits[x / 64] |= std::uint64_t{value} << (x % 64);
}

}  // namespace

}  // namespace stereotrack
#endif

HWY_BEFORE_NAMESPACE();
namespace stereotrack {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

#if HWY_TARGET == HWY_SCALAR

void row_bits_in_lanes(const RowBitsTask& task, const RowBits& bits) { row_bits_reference(task, bits); }
void wanted_bits_in_lanes(const std::uint8_t* mask, int width, std::uint64_t* bits) {
  wanted_bits_reference(mask, width, bits);
}

#else

/// A whole number of vectors makes a word.
template <class T>
using WordLanes = hn::CappedTag<T, 64>;

/// 64 bits, `vector(k)` gives those of pixels k and on as a mask.
template <class D, class Vector>
HWY_INLINE std::uint64_t word_of(D d, const Vector& vector) {
  constexpr int kLanes = static_cast<int>(hn::MaxLanes(D()));
  // A vector may write a byte more than its bits need.
  std::uint8_t bytes[sizeof(std::uint64_t) + 8];
  for (int k = 0; k < 64; k += kLanes) (void)hn::StoreMaskBits(d, vector(k), bytes + k / 8);
  std::uint64_t word;
  std::memcpy(&word, bytes, sizeof word);
  return word;
}

/// Reads 65 values of `row`. `carry`: whether the last pixel before is like the first one; of the next word afterwards.
HWY_INLINE void add_word(const std::uint16_t* row, const std::uint16_t* above, int step, std::uint64_t& carry, int at,
                         const RowBits& bits) {
  const WordLanes<std::uint16_t> d;
  const auto none = hn::Set(d, kNoDisparity);
  const auto limit = hn::Set(d, static_cast<std::uint16_t>(step));
  const auto alike = [&](auto a, auto b) HWY_ATTR {
    const auto larger = hn::Max(a, b);
    const auto too_far = hn::SaturatedSub(hn::Sub(larger, hn::Min(a, b)), limit);
    return hn::Eq(hn::Or(too_far, hn::VecFromMask(d, hn::Eq(larger, none))), hn::Zero(d));
  };
  const auto at_pixel = [&](int k) HWY_ATTR { return hn::LoadU(d, row + k); };
  bits.known[at] = ~word_of(d, [&](int k) HWY_ATTR { return hn::Eq(at_pixel(k), none); });
  bits.with_above[at] = word_of(d, [&](int k) HWY_ATTR { return alike(at_pixel(k), hn::LoadU(d, above + k)); });
  const std::uint64_t with_right =
      word_of(d, [&](int k) HWY_ATTR { return alike(at_pixel(k), hn::LoadU(d, row + k + 1)); });
  bits.with_left[at] = with_right << 1 | carry;
  carry = with_right >> 63;
}

void row_bits_in_lanes(const RowBitsTask& task, const RowBits& bits) {
  std::uint64_t carry = 0;
  int x = 0;
  for (; x + 64 < task.width; x += 64) add_word(task.row + x, task.above + x, task.step, carry, x / 64, bits);
  const int rest = task.width - x;
  if (rest == 0) return;
  // What is left, with none behind it.
  std::uint16_t row[65];
  std::uint16_t above[64];
  std::fill(std::copy_n(task.row + x, rest, row), std::end(row), kNoDisparity);
  std::fill(std::copy_n(task.above + x, rest, above), std::end(above), kNoDisparity);
  add_word(row, above, task.step, carry, x / 64, bits);
}

void wanted_bits_in_lanes(const std::uint8_t* mask, int width, std::uint64_t* bits) {
  const WordLanes<std::uint8_t> d;
  const auto word = [d](const std::uint8_t* from) HWY_ATTR {
    return ~word_of(d, [&](int k) HWY_ATTR { return hn::Eq(hn::LoadU(d, from + k), hn::Zero(d)); });
  };
  int x = 0;
  for (; x + 64 <= width; x += 64) bits[x / 64] = word(mask + x);
  if (x == width) return;
  std::uint8_t rest[64] = {};
  std::copy_n(mask + x, width - x, rest);
  bits[x / 64] = word(rest);
}

#endif

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace stereotrack
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace stereotrack {

HWY_EXPORT(row_bits_in_lanes);
HWY_EXPORT(wanted_bits_in_lanes);

void row_bits(const RowBitsTask& task, const RowBits& bits) noexcept {
  if (simd_in_use() == SimdTarget::kScalar) return row_bits_reference(task, bits);
  HWY_DYNAMIC_DISPATCH(row_bits_in_lanes)(task, bits);
}

void row_bits_reference(const RowBitsTask& task, const RowBits& bits) noexcept {
  for (std::uint64_t* words : {bits.known, bits.with_left, bits.with_above}) {
    std::fill_n(words, words_of(task.width), std::uint64_t{0});
  }
  for (int x = 0; x < task.width; ++x) {
    const int value = task.row[x];
    set_bit(bits.known, x, value != kNoDisparity);
    set_bit(bits.with_left, x, x > 0 && alike(task.row[x - 1], value, task.step));
    set_bit(bits.with_above, x, alike(task.above[x], value, task.step));
  }
}

void wanted_bits(const std::uint8_t* mask, int width, std::uint64_t* bits) noexcept {
  if (simd_in_use() == SimdTarget::kScalar) return wanted_bits_reference(mask, width, bits);
  HWY_DYNAMIC_DISPATCH(wanted_bits_in_lanes)(mask, width, bits);
}

void wanted_bits_reference(const std::uint8_t* mask, int width, std::uint64_t* bits) noexcept {
  std::fill_n(bits, words_of(width), std::uint64_t{0});
  for (int x = 0; x < width; ++x) set_bit(bits, x, mask[x] != 0);
}

}  // namespace stereotrack
#endif
