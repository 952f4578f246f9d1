#include "pipeline/shape/bits_kernel.hpp"

#include <algorithm>
#include <bit>
#include <cstring>

#include "pipeline/core/simd.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "pipeline/shape/bits_kernel.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace stereotrack {
namespace HWY_NAMESPACE {
namespace {

// Returns how many whole words it did.

#if HWY_TARGET == HWY_SCALAR

int words_of(const std::uint8_t*, int, std::uint64_t*) { return 0; }

#else

namespace hn = hwy::HWY_NAMESPACE;

int words_of(const std::uint8_t* pixels, int width, std::uint64_t* words) {
  const hn::CappedTag<std::uint8_t, 64> d;
  const int lanes = static_cast<int>(hn::Lanes(d));
  const int count = width / 64;
  for (int w = 0; w < count; ++w) {
    auto* bytes = reinterpret_cast<std::uint8_t*>(words + w);  // up to 8 from any of them are written
    for (int i = 0; i < 64; i += lanes) {
      const auto set = hn::Ne(hn::LoadU(d, pixels + 64 * w + i), hn::Zero(d));
      hn::StoreMaskBits(d, set, bytes + i / 8);
    }
  }
  return count;
}

#endif

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace stereotrack
HWY_AFTER_NAMESPACE();

#if HWY_ONCE

namespace stereotrack {

namespace {

HWY_EXPORT(words_of);

static_assert(std::endian::native == std::endian::little, "the first pixel must be a word's lowest byte");

/// Bit i: pixels[i] is set, for eight pixels.
std::uint64_t bits_of_eight(const std::uint8_t* pixels) noexcept {
  std::uint64_t bytes;
  std::memcpy(&bytes, pixels, sizeof bytes);
  bytes |= bytes >> 4;
  bytes |= bytes >> 2;
  bytes |= bytes >> 1;  // each byte's lowest bit is now the OR of its eight
  return ((bytes & 0x0101010101010101U) * 0x0102040810204080U) >> 56;
}

/// The other way: 255 in byte i where bit i is set.
std::uint64_t bytes_of_eight(std::uint64_t bits) noexcept {
  // Each byte keeps a bit of its own, and carries into its top bit if that is set.
  const std::uint64_t own = (bits * 0x0101010101010101U) & 0x8040201008040201U;
  return ((own + 0x7F7F7F7F7F7F7F7FU) >> 7 & 0x0101010101010101U) * 255;
}

}  // namespace

void row_bits_reference(const std::uint8_t* pixels, int width, std::uint64_t* words) noexcept {
  for (int x = 0; x < width; x += 64) {
    const int count = std::min(width - x, 64);
    std::uint64_t bits = 0;
    int i = 0;
    for (; i + 8 <= count; i += 8) bits |= bits_of_eight(pixels + x + i) << i;
    for (; i < count; ++i) bits |= static_cast<std::uint64_t>(pixels[x + i] != 0) << i;
    words[x / 64] = bits;
  }
}

void fill_from_bits(const std::uint64_t* words, int width, std::uint8_t* pixels) noexcept {
  int x = 0;
  for (; x + 64 <= width; x += 64) {
    const std::uint64_t bits = words[x / 64];
    if (bits == 0) {
      std::memset(pixels + x, 0, 64);
    } else {
      for (int i = 0; i < 64; i += 8) {
        const std::uint64_t eight = bytes_of_eight(bits >> i & 0xFF);
        std::memcpy(pixels + x + i, &eight, sizeof eight);
      }
    }
  }
  for (; x < width; ++x) pixels[x] = (words[x / 64] >> x % 64 & 1) != 0 ? 255 : 0;
}

void clear_where_bits(const std::uint64_t* words, int width, std::uint8_t* pixels) noexcept {
  for (int x = 0; x < width; x += 64) {
    // Run by run: a mask's words are mostly all of one kind.
    for (std::uint64_t bits = words[x / 64]; bits != 0;) {
      const int begin = std::countr_zero(bits);
      const int count = std::countr_one(bits >> begin);
      std::memset(pixels + x + begin, 0, static_cast<std::size_t>(count));
      bits = begin + count == 64 ? 0 : bits & ~std::uint64_t{0} << (begin + count);
    }
  }
}

void row_bits(const std::uint8_t* pixels, int width, std::uint64_t* words) noexcept {
  const int done = simd_in_use() == SimdTarget::kScalar ? 0 : HWY_DYNAMIC_DISPATCH(words_of)(pixels, width, words);
  row_bits_reference(pixels + 64 * done, width - 64 * done, words + done);
}

}  // namespace stereotrack

#endif
