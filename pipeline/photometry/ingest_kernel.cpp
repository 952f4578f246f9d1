#include "pipeline/photometry/ingest_kernel.hpp"

#include <cstring>

#include "pipeline/core/simd.hpp"
#include "pipeline/photometry/colour.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "pipeline/photometry/ingest_kernel.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "pipeline/core/byte_lanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace stereotrack {
namespace HWY_NAMESPACE {
namespace {

// Each returns how many pixels it did: whole vectors, the rest is the reference's.

#if HWY_TARGET == HWY_SCALAR

int copied_pixels(const std::uint8_t*, int, std::uint8_t*) { return 0; }
int unpacked_pixels(const std::uint8_t*, SampleLayout, int, std::uint8_t*) { return 0; }
int colour_pixels(const std::uint8_t*, ColourOrder, int, const PlaneRow&) { return 0; }
int bayer_pixels(const BayerRows&, int, const PlaneRow&) { return 0; }
int packed_pixels(const std::uint8_t*, PackedOrder, int, const PlaneRow&) { return 0; }
int chroma_pairs(const std::uint8_t*, int, std::uint8_t*, std::uint8_t*) { return 0; }

#else

namespace hn = hwy::HWY_NAMESPACE;

constexpr hn::ScalableTag<std::uint8_t> kBytes{};
constexpr hn::RepartitionToWide<hn::ScalableTag<std::uint8_t> > kWords{};
constexpr hn::RebindToSigned<hn::RepartitionToWide<hn::ScalableTag<std::uint8_t> > > kSigned{};
using Byte = hn::Vec<decltype(kBytes)>;
using Word = hn::Vec<decltype(kWords)>;

int copied_pixels(const std::uint8_t* pixels, int width, std::uint8_t* out) {
  const int lanes = static_cast<int>(hn::Lanes(kBytes));
  int x = 0;
  for (; x + lanes <= width; x += lanes) hn::StoreU(hn::LoadU(kBytes, pixels + x), kBytes, out + x);
  return x;
}

// The weights of 14 bits in two halves, w = 256 high + low, so that words suffice:
//     (w p + 2^13) >> 14 = (high p + 32 + (low p >> 8)) >> 6
// Rounding down twice is rounding down once. The low halves add to 256: 255 times that fits.
class Luma {
 public:
  [[nodiscard]] Word of(Word b, Word g, Word r) const {
    const Word high = hn::Add(hn::Add(hn::Mul(r, high_r_), hn::Mul(g, high_g_)), hn::Mul(b, high_b_));
    const Word low = hn::Add(hn::Add(hn::Mul(r, low_r_), hn::Mul(g, low_g_)), hn::Mul(b, low_b_));
    return hn::ShiftRight<6>(hn::Add(hn::Add(high, hn::Set(kWords, std::uint16_t{32})), hn::ShiftRight<8>(low)));
  }

 private:
  // A compiler that knows a factor makes shifts and additions of the product, which take three times as long.
  static Word factor(int value) {
    const volatile std::uint16_t unknown = static_cast<std::uint16_t>(value);
    return hn::Set(kWords, unknown);
  }
  static_assert(19 * 256 + 35 == 4899 && 37 * 256 + 145 == 9617 && 7 * 256 + 76 == 1868);
  Word high_r_ = factor(19);
  Word high_g_ = factor(37);
  Word high_b_ = factor(7);
  Word low_r_ = factor(35);
  Word low_g_ = factor(145);
  Word low_b_ = factor(76);
};

struct Colours {
  Word b;
  Word g;
  Word r;
};

// (w (colour - luma) + 2^13) >> 14 = (2 w (colour - luma) + 2^14) >> 15, which is one instruction, and 128. A colour
// and its own luma never give less than 0, and 256 at most.
template <int kWeight>
Word difference_of(Word colour, Word luma) {
  const auto apart = hn::Sub(hn::BitCast(kSigned, colour), hn::BitCast(kSigned, luma));
  const auto value = hn::Add(hn::MulFixedPoint15(apart, hn::Set(kSigned, 2 * kWeight)), hn::Set(kSigned, 128));
  return hn::BitCast(kWords, hn::Min(value, hn::Set(kSigned, 255)));
}

// Luma and chroma of the even and the odd pixels of a vector.
void store_colours(const Luma& luma, const Colours& even, const Colours& odd, int x, const PlaneRow& out) {
  const Word even_y = luma.of(even.b, even.g, even.r);
  const Word odd_y = luma.of(odd.b, odd.g, odd.r);
  hn::StoreU(zip_bytes(even_y, odd_y), kBytes, out.y + x);
  if (out.cb == nullptr) return;
  hn::StoreU(zip_bytes(difference_of<9241>(even.b, even_y), difference_of<9241>(odd.b, odd_y)), kBytes, out.cb + x);
  hn::StoreU(zip_bytes(difference_of<11682>(even.r, even_y), difference_of<11682>(odd.r, odd_y)), kBytes, out.cr + x);
}

int colour_pixels(const std::uint8_t* pixels, ColourOrder order, int width, const PlaneRow& out) {
  const Luma luma;
  const int lanes = static_cast<int>(hn::Lanes(kBytes));
  int x = 0;
  for (; x + lanes <= width; x += lanes) {
    Byte first = hn::Zero(kBytes);
    Byte g = first;
    Byte last = first;
    hn::LoadInterleaved3(kBytes, pixels + 3 * x, first, g, last);
    const Byte b = order == ColourOrder::kBlueFirst ? first : last;
    const Byte r = order == ColourOrder::kBlueFirst ? last : first;
    store_colours(luma, {even_bytes(b), even_bytes(g), even_bytes(r)}, {odd_bytes(b), odd_bytes(g), odd_bytes(r)}, x,
                  out);
  }
  return x;
}

Word mean_of(Word a, Word b) { return hn::ShiftRight<1>(hn::Add(hn::Add(a, b), hn::Set(kWords, std::uint16_t{1}))); }
Word mean_of(Word a, Word b, Word c, Word d) {
  return hn::ShiftRight<2>(hn::Add(hn::Add(hn::Add(a, b), hn::Add(c, d)), hn::Set(kWords, std::uint16_t{2})));
}

// What lies on the left of the even pixels and on the right of the odd ones; the others are neighbours of each other.
Word before_even(const std::uint8_t* row) { return even_bytes(hn::LoadU(kBytes, row - 1)); }
Word after_odd(const std::uint8_t* row) { return odd_bytes(hn::LoadU(kBytes, row + 1)); }

template <bool kRed, bool kGreenFirst>
int mosaic_pixels(const BayerRows& rows, int width, const PlaneRow& out) {
  const Luma luma;
  const auto colours = [](Word own, Word green, Word other) {
    return kRed ? Colours{other, green, own} : Colours{own, green, other};
  };
  const int lanes = static_cast<int>(hn::Lanes(kBytes));
  int x = 0;
  for (; x + lanes <= width; x += lanes) {
    const Byte above = hn::LoadU(kBytes, rows.above + x);
    const Byte row = hn::LoadU(kBytes, rows.row + x);
    const Byte below = hn::LoadU(kBytes, rows.below + x);
    const Word even = even_bytes(row);
    const Word odd = odd_bytes(row);
    const Word even_above = even_bytes(above);
    const Word odd_above = odd_bytes(above);
    const Word even_below = even_bytes(below);
    const Word odd_below = odd_bytes(below);
    if constexpr (kGreenFirst) {
      const Colours at_green = colours(mean_of(before_even(rows.row + x), odd), even, mean_of(even_above, even_below));
      const Colours at_colour =
          colours(odd, mean_of(odd_above, odd_below, even, after_odd(rows.row + x)),
                  mean_of(even_above, after_odd(rows.above + x), even_below, after_odd(rows.below + x)));
      store_colours(luma, at_green, at_colour, x, out);
    } else {
      const Colours at_colour =
          colours(even, mean_of(even_above, even_below, before_even(rows.row + x), odd),
                  mean_of(before_even(rows.above + x), odd_above, before_even(rows.below + x), odd_below));
      const Colours at_green = colours(mean_of(even, after_odd(rows.row + x)), odd, mean_of(odd_above, odd_below));
      store_colours(luma, at_colour, at_green, x, out);
    }
  }
  return x;
}

int bayer_pixels(const BayerRows& rows, int width, const PlaneRow& out) {
  if (rows.red) {
    return rows.green_first ? mosaic_pixels<true, true>(rows, width, out)
                            : mosaic_pixels<true, false>(rows, width, out);
  }
  return rows.green_first ? mosaic_pixels<false, true>(rows, width, out)
                          : mosaic_pixels<false, false>(rows, width, out);
}

// Little-endian, as all targets of simd.hpp are.
int word_pixels(const std::uint8_t* row, int bits, int width, std::uint8_t* out) {
  const int lanes = static_cast<int>(hn::Lanes(kBytes));
  int x = 0;
  for (; x + lanes <= width; x += lanes) {
    const Word first = hn::BitCast(kWords, hn::LoadU(kBytes, row + 2 * x));
    const Word second = hn::BitCast(kWords, hn::LoadU(kBytes, row + 2 * x + lanes));
    const Byte low = hn::BitCast(kBytes, hn::ShiftRightSame(first, bits - 8));
    const Byte high = hn::BitCast(kBytes, hn::ShiftRightSame(second, bits - 8));
    hn::StoreU(hn::ConcatEven(kBytes, high, low), kBytes, out + x);
  }
  return x;
}

int packed12_pixels(const std::uint8_t* row, int width, std::uint8_t* out) {
  const int lanes = static_cast<int>(hn::Lanes(kBytes));
  int x = 0;
  for (; x + 2 * lanes <= width; x += 2 * lanes) {
    Byte first = hn::Zero(kBytes);
    Byte second = first;
    Byte rests = first;
    hn::LoadInterleaved3(kBytes, row + 3 * (x / 2), first, second, rests);
    hn::StoreInterleaved2(first, second, kBytes, out + x);
  }
  return x;
}

// 64 pixels are 80 bytes, five blocks of 16: 16 pixels each lie in two neighbours of them, and pixel p is byte p + p/4.
// Which byte of the first block each pixel is, and which of the second; kNone: of neither.
constexpr std::uint8_t kNone = 0x80;
struct Packed10Table {
  alignas(16) std::uint8_t first[4][16];
  alignas(16) std::uint8_t second[4][16];
};
constexpr Packed10Table packed10_table() {
  Packed10Table table{};
  for (int block = 0; block < 4; ++block) {
    for (int i = 0; i < 16; ++i) {
      const int pixel = 16 * block + i;
      const int at = pixel + pixel / 4 - 16 * block;
      table.first[block][i] = at < 16 ? static_cast<std::uint8_t>(at) : kNone;
      table.second[block][i] = at < 16 ? kNone : static_cast<std::uint8_t>(at - 16);
    }
  }
  return table;
}

int packed10_pixels(const std::uint8_t* row, int width, std::uint8_t* out) {
  constexpr hn::FixedTag<std::uint8_t, 16> kBlock;
  static constexpr Packed10Table kTable = packed10_table();
  int x = 0;
  for (; x + 64 <= width; x += 64, row += 80) {
    auto first = hn::LoadU(kBlock, row);
    for (int block = 0; block < 4; ++block) {
      const auto second = hn::LoadU(kBlock, row + 16 * (block + 1));
      const auto pixels = hn::Or(hn::TableLookupBytesOr0(first, hn::Load(kBlock, kTable.first[block])),
                                 hn::TableLookupBytesOr0(second, hn::Load(kBlock, kTable.second[block])));
      hn::StoreU(pixels, kBlock, out + x + 16 * block);
      first = second;
    }
  }
  return x;
}

int unpacked_pixels(const std::uint8_t* row, SampleLayout layout, int width, std::uint8_t* out) {
  switch (layout) {
    case SampleLayout::kBytes: break;
    case SampleLayout::kWords10: return word_pixels(row, 10, width, out);
    case SampleLayout::kWords12: return word_pixels(row, 12, width, out);
    case SampleLayout::kWords16: return word_pixels(row, 16, width, out);
    case SampleLayout::kPacked10: return packed10_pixels(row, width, out);
    case SampleLayout::kPacked12: return packed12_pixels(row, width, out);
  }
  return copied_pixels(row, width, out);
}

// Cb of the pairs Cb Cr for both pixels of each, and Cr.
void store_chroma(Byte pairs, std::uint8_t* cb, std::uint8_t* cr) {
  const Word blue = even_bytes(pairs);
  const Word red = odd_bytes(pairs);
  hn::StoreU(zip_bytes(blue, blue), kBytes, cb);
  hn::StoreU(zip_bytes(red, red), kBytes, cr);
}

int packed_pixels(const std::uint8_t* pixels, PackedOrder order, int width, const PlaneRow& out) {
  const int lanes = static_cast<int>(hn::Lanes(kBytes));
  int x = 0;
  for (; x + lanes <= width; x += lanes) {
    Byte first = hn::Zero(kBytes);
    Byte second = first;
    hn::LoadInterleaved2(kBytes, pixels + 2 * x, first, second);
    const bool luma_first = order == PackedOrder::kLumaFirst;
    hn::StoreU(luma_first ? first : second, kBytes, out.y + x);
    if (out.cb != nullptr) store_chroma(luma_first ? second : first, out.cb + x, out.cr + x);
  }
  return x;
}

int chroma_pairs(const std::uint8_t* pairs, int width, std::uint8_t* cb, std::uint8_t* cr) {
  const int lanes = static_cast<int>(hn::Lanes(kBytes));
  int x = 0;
  for (; x + lanes <= width; x += lanes) store_chroma(hn::LoadU(kBytes, pairs + x), cb + x, cr + x);
  return x;
}

#endif

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace stereotrack
HWY_AFTER_NAMESPACE();

#if HWY_ONCE

namespace stereotrack {

namespace {

HWY_EXPORT(copied_pixels);
HWY_EXPORT(unpacked_pixels);
HWY_EXPORT(colour_pixels);
HWY_EXPORT(bayer_pixels);
HWY_EXPORT(packed_pixels);
HWY_EXPORT(chroma_pairs);

PlaneRow rest_of(const PlaneRow& row, int x) noexcept {
  if (row.cb == nullptr) return {row.y + x, nullptr, nullptr};
  return {row.y + x, row.cb + x, row.cr + x};
}

}  // namespace

void copy_row_reference(const std::uint8_t* pixels, int width, std::uint8_t* out) noexcept {
  const volatile std::uint8_t* from = pixels;  // else compilers call memcpy()
  for (int x = 0; x < width; ++x) out[x] = from[x];
}

void unpack_row_reference(const std::uint8_t* row, SampleLayout layout, int width, std::uint8_t* out) noexcept {
  for (int x = 0; x < width; ++x) out[x] = sample_of(layout, row, x);
}

namespace {

void put_colour(int b, int g, int r, int x, const PlaneRow& out) noexcept {
  const std::uint8_t y = luma(b, g, r);
  out.y[x] = y;
  if (out.cb == nullptr) return;
  out.cb[x] = chroma_blue(b, y);
  out.cr[x] = chroma_red(r, y);
}

}  // namespace

void colour_row_reference(const std::uint8_t* pixels, ColourOrder order, int width, const PlaneRow& out) noexcept {
  const int blue = order == ColourOrder::kBlueFirst ? 0 : 2;
  for (int x = 0; x < width; ++x) {
    const std::uint8_t* pixel = pixels + 3 * x;
    put_colour(pixel[blue], pixel[1], pixel[2 - blue], x, out);
  }
}

void bayer_row_reference(const BayerRows& rows, int width, const PlaneRow& out) noexcept {
  const auto& [above, row, below, red, green_first] = rows;
  for (int x = 0; x < width; ++x) {
    const bool at_green = (x % 2 == 0) == green_first;
    const int green = at_green ? row[x] : (above[x] + below[x] + row[x - 1] + row[x + 1] + 2) / 4;
    const int own = at_green ? (row[x - 1] + row[x + 1] + 1) / 2 : row[x];
    const int other =
        at_green ? (above[x] + below[x] + 1) / 2 : (above[x - 1] + above[x + 1] + below[x - 1] + below[x + 1] + 2) / 4;
    put_colour(red ? other : own, green, red ? own : other, x, out);
  }
}

void packed_row_reference(const std::uint8_t* pixels, PackedOrder order, int width, const PlaneRow& out) noexcept {
  const int luma = order == PackedOrder::kLumaFirst ? 0 : 1;
  const int chroma = 1 - luma;
  for (int x = 0; x < width; x += 2) {
    const std::uint8_t* pair = pixels + 2 * x;
    out.y[x] = pair[luma];
    out.y[x + 1] = pair[luma + 2];
    if (out.cb != nullptr) {
      out.cb[x] = out.cb[x + 1] = pair[chroma];
      out.cr[x] = out.cr[x + 1] = pair[chroma + 2];
    }
  }
}

void chroma_pairs_row_reference(const std::uint8_t* pairs, int width, std::uint8_t* cb, std::uint8_t* cr) noexcept {
  for (int x = 0; x < width; x += 2) {
    cb[x] = cb[x + 1] = pairs[x];
    cr[x] = cr[x + 1] = pairs[x + 1];
  }
}

void copy_row(const std::uint8_t* pixels, int width, std::uint8_t* out) noexcept {
  const int done = simd_in_use() == SimdTarget::kScalar ? 0 : HWY_DYNAMIC_DISPATCH(copied_pixels)(pixels, width, out);
  copy_row_reference(pixels + done, width - done, out + done);
}

void unpack_row(const std::uint8_t* row, SampleLayout layout, int width, std::uint8_t* out) noexcept {
  if (layout == SampleLayout::kBytes) return copy_row(row, width, out);
  const int done =
      simd_in_use() == SimdTarget::kScalar ? 0 : HWY_DYNAMIC_DISPATCH(unpacked_pixels)(row, layout, width, out);
  unpack_row_reference(row + row_bytes(layout, done), layout, width - done, out + done);
}

void colour_row(const std::uint8_t* pixels, ColourOrder order, int width, const PlaneRow& out) noexcept {
  const int done =
      simd_in_use() == SimdTarget::kScalar ? 0 : HWY_DYNAMIC_DISPATCH(colour_pixels)(pixels, order, width, out);
  colour_row_reference(pixels + 3 * done, order, width - done, rest_of(out, done));
}

void bayer_row(const BayerRows& rows, int width, const PlaneRow& out) noexcept {
  const int done = simd_in_use() == SimdTarget::kScalar ? 0 : HWY_DYNAMIC_DISPATCH(bayer_pixels)(rows, width, out);
  const BayerRows rest{rows.above + done, rows.row + done, rows.below + done, rows.red, rows.green_first};
  bayer_row_reference(rest, width - done, rest_of(out, done));
}

void packed_row(const std::uint8_t* pixels, PackedOrder order, int width, const PlaneRow& out) noexcept {
  const int done =
      simd_in_use() == SimdTarget::kScalar ? 0 : HWY_DYNAMIC_DISPATCH(packed_pixels)(pixels, order, width, out);
  packed_row_reference(pixels + 2 * done, order, width - done, rest_of(out, done));
}

void chroma_pairs_row(const std::uint8_t* pairs, int width, std::uint8_t* cb, std::uint8_t* cr) noexcept {
  const int done = simd_in_use() == SimdTarget::kScalar ? 0 : HWY_DYNAMIC_DISPATCH(chroma_pairs)(pairs, width, cb, cr);
  chroma_pairs_row_reference(pairs + done, width - done, cb + done, cr + done);
}

void HistogramCounter::add_row(const std::uint8_t* pixels, int width) noexcept {
  int x = 0;
  for (; x + 8 <= width; x += 8) {
    std::uint64_t eight = 0;
    std::memcpy(&eight, pixels + x, sizeof eight);
    for (std::size_t i = 0; i < 8; ++i) ++tables_[i % 4][eight >> (8 * i) & 0xFF];
  }
  for (; x < width; ++x) ++tables_[0][pixels[x]];
}

Histogram HistogramCounter::sum() const noexcept {
  Histogram sum = tables_[0];
  for (std::size_t table = 1; table < tables_.size(); ++table) {
    for (std::size_t level = 0; level < sum.size(); ++level) sum[level] += tables_[table][level];
  }
  return sum;
}

}  // namespace stereotrack

#endif
