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

// (w (colour - luma) + 2^13) >> 14 = (2 w (colour - luma) + 2^14) >> 15, which is one instruction, and 128. A colour
// and its own luma never give less than 0, and 256 at most.
template <int kWeight>
Word difference_of(Word colour, Word luma) {
  const auto apart = hn::Sub(hn::BitCast(kSigned, colour), hn::BitCast(kSigned, luma));
  const auto value = hn::Add(hn::MulFixedPoint15(apart, hn::Set(kSigned, 2 * kWeight)), hn::Set(kSigned, 128));
  return hn::BitCast(kWords, hn::Min(value, hn::Set(kSigned, 255)));
}

int unpacked_pixels(const std::uint8_t*, SampleLayout, int, std::uint8_t*) { return 0; }
int bayer_pixels(const BayerRows&, int, const PlaneRow&) { return 0; }

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
    const Word even_b = even_bytes(b);
    const Word odd_b = odd_bytes(b);
    const Word even_r = even_bytes(r);
    const Word odd_r = odd_bytes(r);
    const Word even_y = luma.of(even_b, even_bytes(g), even_r);
    const Word odd_y = luma.of(odd_b, odd_bytes(g), odd_r);
    hn::StoreU(zip_bytes(even_y, odd_y), kBytes, out.y + x);
    if (out.cb == nullptr) continue;
    hn::StoreU(zip_bytes(difference_of<9241>(even_b, even_y), difference_of<9241>(odd_b, odd_y)), kBytes, out.cb + x);
    hn::StoreU(zip_bytes(difference_of<11682>(even_r, even_y), difference_of<11682>(odd_r, odd_y)), kBytes, out.cr + x);
  }
  return x;
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
