#include "pipeline/photometry/colour_kernel.hpp"

#include "pipeline/core/simd.hpp"
#include "pipeline/photometry/chroma.hpp"
#include "pipeline/photometry/gray.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "pipeline/photometry/colour_kernel.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "pipeline/core/byte_lanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace stereotrack {
namespace HWY_NAMESPACE {
namespace {

// Each returns how many pixels it did: whole vectors, the rest is the reference's.

#if HWY_TARGET == HWY_SCALAR

int luma_of(const std::uint8_t*, int, std::uint8_t*) { return 0; }
int chroma_of(const std::uint8_t*, const std::uint8_t*, int, std::uint8_t*, std::uint8_t*) { return 0; }

#else

namespace hn = hwy::HWY_NAMESPACE;

constexpr hn::ScalableTag<std::uint8_t> kBytes{};
constexpr hn::RepartitionToWide<hn::ScalableTag<std::uint8_t> > kWords{};
constexpr hn::RebindToSigned<hn::RepartitionToWide<hn::ScalableTag<std::uint8_t> > > kSigned{};

// The weights of 14 bits in two halves, w = 256 high + low, so that words suffice:
//     (w p + 2^13) >> 14 = (high p + 32 + (low p >> 8)) >> 6
// Rounding down twice is rounding down once. The low halves add to 256: 255 times that fits.
template <class V>
V weighted(V b, V g, V r) {
  const auto times = [](V v, int weight)
                         HWY_ATTR { return hn::Mul(v, hn::Set(kWords, static_cast<std::uint16_t>(weight))); };
  static_assert(19 * 256 + 35 == 4899 && 37 * 256 + 145 == 9617 && 7 * 256 + 76 == 1868);
  const V high = hn::Add(hn::Add(times(r, 19), times(g, 37)), times(b, 7));
  const V low = hn::Add(hn::Add(times(r, 35), times(g, 145)), times(b, 76));
  const V sum = hn::Add(hn::Add(high, hn::Set(kWords, std::uint16_t{32})), hn::ShiftRight<8>(low));
  return hn::ShiftRight<6>(sum);
}

int luma_of(const std::uint8_t* bgr, int width, std::uint8_t* luma) {
  const int lanes = static_cast<int>(hn::Lanes(kBytes));
  int x = 0;
  for (; x + lanes <= width; x += lanes) {
    auto b = hn::Zero(kBytes);
    auto g = b;
    auto r = b;
    hn::LoadInterleaved3(kBytes, bgr + 3 * x, b, g, r);
    hn::StoreU(zip_bytes(weighted(even_bytes(b), even_bytes(g), even_bytes(r)),
                         weighted(odd_bytes(b), odd_bytes(g), odd_bytes(r))),
               kBytes, luma + x);
  }
  return x;
}

// The same of a difference: 255 high and 255 low fit a signed word.
template <int kHigh, int kLow, class V>
V difference_of(V colour, V luma) {
  const auto apart = hn::Sub(hn::BitCast(kSigned, colour), hn::BitCast(kSigned, luma));
  const auto high = hn::Mul(apart, hn::Set(kSigned, kHigh));
  const auto low = hn::ShiftRight<8>(hn::Mul(apart, hn::Set(kSigned, kLow)));
  const auto sum = hn::ShiftRight<6>(hn::Add(hn::Add(high, low), hn::Set(kSigned, 32)));
  const auto value = hn::Add(sum, hn::Set(kSigned, 128));
  return hn::BitCast(kWords, hn::Min(hn::Max(value, hn::Zero(kSigned)), hn::Set(kSigned, 255)));
}

int chroma_of(const std::uint8_t* bgr, const std::uint8_t* luma, int width, std::uint8_t* cb, std::uint8_t* cr) {
  static_assert(36 * 256 + 25 == 9241 && 46 * 256 - 94 == 11682);
  const int lanes = static_cast<int>(hn::Lanes(kBytes));
  int x = 0;
  for (; x + lanes <= width; x += lanes) {
    auto b = hn::Zero(kBytes);
    auto g = b;
    auto r = b;
    hn::LoadInterleaved3(kBytes, bgr + 3 * x, b, g, r);
    const auto y = hn::LoadU(kBytes, luma + x);
    hn::StoreU(zip_bytes(difference_of<36, 25>(even_bytes(b), even_bytes(y)),
                         difference_of<36, 25>(odd_bytes(b), odd_bytes(y))),
               kBytes, cb + x);
    hn::StoreU(zip_bytes(difference_of<46, -94>(even_bytes(r), even_bytes(y)),
                         difference_of<46, -94>(odd_bytes(r), odd_bytes(y))),
               kBytes, cr + x);
  }
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

HWY_EXPORT(luma_of);
HWY_EXPORT(chroma_of);

}  // namespace

void luma_row_reference(const std::uint8_t* bgr, int width, std::uint8_t* luma) noexcept {
  for (int x = 0; x < width; ++x) luma[x] = stereotrack::luma(bgr[3 * x], bgr[3 * x + 1], bgr[3 * x + 2]);
}

void chroma_row_reference(const std::uint8_t* bgr, const std::uint8_t* luma, int width, std::uint8_t* cb,
                          std::uint8_t* cr) noexcept {
  for (int x = 0; x < width; ++x) {
    cb[x] = chroma_blue(bgr[3 * x], luma[x]);
    cr[x] = chroma_red(bgr[3 * x + 2], luma[x]);
  }
}

void luma_row(const std::uint8_t* bgr, int width, std::uint8_t* luma) noexcept {
  const int done = simd_in_use() == SimdTarget::kScalar ? 0 : HWY_DYNAMIC_DISPATCH(luma_of)(bgr, width, luma);
  luma_row_reference(bgr + 3 * done, width - done, luma + done);
}

void chroma_row(const std::uint8_t* bgr, const std::uint8_t* luma, int width, std::uint8_t* cb,
                std::uint8_t* cr) noexcept {
  const int done = simd_in_use() == SimdTarget::kScalar ? 0 : HWY_DYNAMIC_DISPATCH(chroma_of)(bgr, luma, width, cb, cr);
  chroma_row_reference(bgr + 3 * done, luma + done, width - done, cb + done, cr + done);
}

}  // namespace stereotrack

#endif
