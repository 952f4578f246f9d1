#include "pipeline/motion/distance_kernel.hpp"

#include <algorithm>
#include <cstdlib>

#include "pipeline/core/simd.hpp"
#include "pipeline/motion/adaptive_background.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "pipeline/motion/distance_kernel.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#ifndef STEREOTRACK_DISTANCE_KERNEL_LIMITS
#define STEREOTRACK_DISTANCE_KERNEL_LIMITS
namespace stereotrack {
namespace {

constexpr int kStepsPerSd = AdaptiveBackground::kStepsPerSd;
constexpr int kGainDarkest = 20 * 256;  // below, the ratio is mostly noise [8.8]
// From here on a pixel is clipped: it says no more than that it is at least so bright [8.8].
constexpr int kClipped = 250 * 256;
constexpr int kNowDarkest = 4;
constexpr int kNowBrightest = 250;

// The part of a row from `x` on, for the reference to finish.
[[maybe_unused]] ChannelRow rest_of(const ChannelRow& row, int x) noexcept {
  if (row.now == nullptr) return {};
  return {row.now + x, row.mean + x, row.deviation + x, row.shown == nullptr ? nullptr : row.shown + x};
}
[[maybe_unused]] DistanceRow rest_of(const DistanceRow& row, int x) noexcept {
  DistanceRow rest = row;
  rest.y = rest_of(row.y, x);
  rest.cb = rest_of(row.cb, x);
  rest.cr = rest_of(row.cr, x);
  rest.range = row.range + x;
  return rest;
}

}  // namespace
}  // namespace stereotrack
#endif

HWY_BEFORE_NAMESPACE();
namespace stereotrack {
namespace HWY_NAMESPACE {
namespace {

#if HWY_TARGET == HWY_SCALAR

void lit(const std::uint16_t* mean, int gain, int width, std::uint8_t* out) {
  lit_row_reference(mean, gain, width, out);
}
void range(const ThreeRows& in, int width, std::uint8_t* out) { range_row_reference(in, width, out); }
void distance(const DistanceRow& in, int width, std::uint8_t* out) { distance_row_reference(in, width, out); }
void bins_of(const std::uint8_t* now, const std::uint16_t* mean, const std::uint8_t* foreground, int count,
             std::uint16_t* bins) {
  gain_bins_reference(now, mean, foreground, count, bins);
}
int count_of(const std::uint16_t* values, int count, int limit) { return count_up_to_reference(values, count, limit); }

#else

namespace hn = hwy::HWY_NAMESPACE;

void lit(const std::uint16_t* mean, int gain, int width, std::uint8_t* out) {
  const hn::ScalableTag<std::uint16_t> d16;
  const hn::Rebind<std::int16_t, decltype(d16)> di16;
  const hn::Rebind<std::uint8_t, decltype(d16)> d8;
  const auto factor = hn::Set(d16, static_cast<std::uint16_t>(gain));
  const auto most = hn::Set(d16, std::uint16_t{255});
  const int lanes = static_cast<int>(hn::Lanes(d16));
  int x = 0;
  for (; x + lanes <= width; x += lanes) {
    const auto m = hn::LoadU(d16, mean + x);
    // Adding half of 2^16 carries exactly where the lower half's top bit is set.
    const auto carry = hn::ShiftRight<15>(hn::Mul(m, factor));
    const auto value = hn::Min(hn::Add(hn::MulHigh(m, factor), carry), most);
    hn::StoreU(hn::DemoteTo(d8, hn::BitCast(di16, value)), d8, out + x);
  }
  lit_row_reference(mean + x, gain, width - x, out + x);
}

void range(const ThreeRows& in, int width, std::uint8_t* out) {
  const hn::ScalableTag<std::uint8_t> d;
  const int lanes = static_cast<int>(hn::Lanes(d));
  if (width < lanes + 2) {
    range_row_reference(in, width, out);
    return;
  }
  const auto range_at = [&](int x) HWY_ATTR {
    const auto low_of = [&](const std::uint8_t* row) HWY_ATTR {
      return hn::Min(hn::Min(hn::LoadU(d, row + x - 1), hn::LoadU(d, row + x)), hn::LoadU(d, row + x + 1));
    };
    const auto high_of = [&](const std::uint8_t* row) HWY_ATTR {
      return hn::Max(hn::Max(hn::LoadU(d, row + x - 1), hn::LoadU(d, row + x)), hn::LoadU(d, row + x + 1));
    };
    const auto low = hn::Min(hn::Min(low_of(in.above), low_of(in.here)), low_of(in.under));
    const auto high = hn::Max(hn::Max(high_of(in.above), high_of(in.here)), high_of(in.under));
    hn::StoreU(hn::Sub(high, low), d, out + x);
  };
  const int last = width - 1 - lanes;  // the last vector overlaps the one before it
  for (int x = 1; x < last; x += lanes) range_at(x);
  range_at(last);
  // Two columns have two neighbours less: those of a picture two pixels wide.
  const auto border = [&](int from, int at) {
    std::uint8_t pair[2];
    range_row_reference({in.above + from, in.here + from, in.under + from}, 2, pair);
    out[at] = pair[0];
  };
  border(0, 0);
  border(width - 2, width - 1);
}

using Words = hn::ScalableTag<std::uint16_t>;
using Floats = hn::Repartition<float, Words>;
constexpr Words kWords{};
constexpr hn::Rebind<std::uint8_t, Words> kBytes{};
constexpr hn::Rebind<std::int16_t, Words> kSignedWords{};
constexpr hn::Repartition<std::uint32_t, Words> kDoubles{};
constexpr hn::Repartition<std::int32_t, Words> kSigned{};
constexpr Floats kFloats{};
using Word = hn::Vec<Words>;
using Float = hn::Vec<Floats>;

Word word(int value) { return hn::Set(kWords, static_cast<std::uint16_t>(value)); }
Word now_of(const ChannelRow& row, int x) {
  return hn::ShiftLeft<8>(hn::PromoteTo(kWords, hn::LoadU(kBytes, row.now + x)));
}
void store_bytes(Word values, std::uint8_t* out) {
  hn::StoreU(hn::DemoteTo(kBytes, hn::BitCast(kSignedWords, values)), kBytes, out);
}

// The words as floats, even and odd ones apart, which needs no shuffle (little-endian).
struct Pair {
  explicit Pair(Word v)
      : even(
            hn::ConvertTo(kFloats, hn::BitCast(kSigned, hn::And(hn::BitCast(kDoubles, v), hn::Set(kDoubles, 0xFFFF))))),
        odd(hn::ConvertTo(kFloats, hn::BitCast(kSigned, hn::ShiftRight<16>(hn::BitCast(kDoubles, v))))) {}
  Float even;
  Float odd;
};

// n / m, rounded down, exactly, with n = 4 apart < 2^18 and integers only: an n that is k m must not fall below k, and
// one of (k + 1) m - 1 not reach k + 1, which is a part of 1 / ((k + 1) m) > 2^-18 away. Numerators made larger by a
// part of 2^-20 satisfy both, as what follows them errs by 6 roundings of 2^-24 at most.
constexpr float kNumerator = 4.0F * (1.0F + 1.0F / (1 << 20));
static_assert(kStepsPerSd == 4);

Float quotient(Float apart, Float noise) {
  return hn::Floor(hn::Mul(apart, hn::Div(hn::Set(kFloats, kNumerator), noise)));
}

// A division costs much more than a product, so three share one: 1/a = b c / (a b c).
struct Steps {
  Steps(Float luma_apart, Float luma_noise, Float blue_apart, Float blue_noise, Float red_apart, Float red_noise) {
    const Float both = hn::Mul(luma_noise, blue_noise);
    const Float by_all = hn::Div(hn::Set(kFloats, kNumerator), hn::Mul(both, red_noise));
    const Float by_both = hn::Mul(by_all, red_noise);
    luma = hn::Mul(luma_apart, hn::Mul(by_both, blue_noise));
    colour = hn::Max(hn::Mul(blue_apart, hn::Mul(by_both, luma_noise)), hn::Mul(red_apart, hn::Mul(by_all, both)));
  }
  // The larger and half the smaller. Half of a number rounded down, rounded down, is its half rounded down.
  [[nodiscard]] Float combined() const {
    const Float half = hn::Mul(hn::Min(luma, colour), hn::Set(kFloats, 0.5F));
    return hn::Add(hn::Floor(hn::Max(luma, colour)), hn::Floor(half));
  }
  Float luma;
  Float colour;
};

// Integers, saturated at 255: in the lowest byte of each lane, as 2^23 + v holds v in its lowest bits.
auto as_bytes(Float integers) {
  const Float saturated = hn::Min(integers, hn::Set(kFloats, 255.0F));
  return hn::BitCast(kDoubles, hn::Add(saturated, hn::Set(kFloats, 8388608.0F)));
}

void store_steps(Float even, Float odd, std::uint8_t* out) {
  const auto low = hn::And(as_bytes(even), hn::Set(kDoubles, 255));
  store_bytes(hn::BitCast(kWords, hn::Or(low, hn::ShiftLeft<16>(as_bytes(odd)))), out);
}

// range edge 256 / 100, rounded down, exactly: the whole part of the factor in two, each below 2^8 + 1, so that
// products stay words; its fraction is at most 2^-16 too large, which adds less than 255 / 2^16 < 1/100 to a multiple
// of 1/100. From 65535 on it saturates, where no distance reaches.
struct Tolerance {
  explicit Tolerance(int percent)
      : whole(word(std::min(percent * 256 / 100, 256))),
        more(word(percent * 256 / 100 - std::min(percent * 256 / 100, 256))),
        fraction(word((percent * 256 % 100 * 65536 + 99) / 100)) {}
  [[nodiscard]] Word of(Word range) const {
    return hn::SaturatedAdd(hn::SaturatedAdd(hn::Mul(range, whole), hn::Mul(range, more)),
                            hn::MulHigh(range, fraction));
  }
  Word whole;
  Word more;
  Word fraction;
};

Word luma_apart(const DistanceRow& in, Word gain, const Tolerance& tolerance, int x) {
  const Word clipped = word(kClipped);
  const Word now = now_of(in.y, x);
  const Word mean = hn::LoadU(kWords, in.y.mean + x);
  // (mean gain) / 256; what exceeds a word is clipped, as what it becomes is.
  const Word high = hn::Min(hn::MulHigh(mean, gain), word(255));
  const Word expected = hn::Or(hn::ShiftLeft<8>(high), hn::ShiftRight<8>(hn::Mul(mean, gain)));
  const Word most = hn::Max(mean, expected);
  const auto is_clipped = hn::Eq(hn::Max(most, clipped), most);  // then nothing is brighter
  const Word brighter = hn::IfThenZeroElse(is_clipped, hn::SaturatedSub(now, expected));
  const Word apart = hn::Max(hn::SaturatedSub(hn::Min(expected, clipped), now), brighter);
  const Word range = hn::PromoteTo(kWords, hn::LoadU(kBytes, in.range + x));
  return hn::SaturatedSub(apart, tolerance.of(range));
}

// Also stores what is shown of the channel.
Word chroma_apart(const ChannelRow& row, int x) {
  const Word now = now_of(row, x);
  const Word mean = hn::LoadU(kWords, row.mean + x);
  store_bytes(hn::ShiftRight<8>(hn::SaturatedAdd(mean, word(128))), row.shown + x);
  return hn::Or(hn::SaturatedSub(now, mean), hn::SaturatedSub(mean, now));
}

// 5/4 deviation and floor; saturated.
Word noise_of(const ChannelRow& row, Word floor, int x) {
  const Word deviation = hn::LoadU(kWords, row.deviation + x);
  return hn::SaturatedAdd(deviation, hn::Add(hn::ShiftRight<2>(deviation), floor));
}

bool saturates(Word noise) { return !hn::AllFalse(kWords, hn::Eq(noise, word(65535))); }

template <bool kColour>
void distance_of(const DistanceRow& in, int width, std::uint8_t* out) {
  const DistanceRow row = in;  // which bytes written do not alias
  const int lanes = static_cast<int>(hn::Lanes(kWords));
  const Tolerance tolerance(row.edge_percent);
  const Word gain = word(row.gain);
  const Word floor = word(row.noise_floor);
  int x = 0;
  for (; x + lanes <= width; x += lanes) {
    const Word luma_noise = noise_of(row.y, floor, x);
    const Pair luma(luma_apart(row, gain, tolerance, x));
    const Pair luma_by(luma_noise);
    Word most_noise = luma_noise;
    if constexpr (kColour) {
      const Word blue_noise = noise_of(row.cb, floor, x);
      const Word red_noise = noise_of(row.cr, floor, x);
      most_noise = hn::Max(most_noise, hn::Max(blue_noise, red_noise));
      const Pair blue(chroma_apart(row.cb, x));
      const Pair red(chroma_apart(row.cr, x));
      const Pair blue_by(blue_noise);
      const Pair red_by(red_noise);
      const Steps even(luma.even, luma_by.even, blue.even, blue_by.even, red.even, red_by.even);
      const Steps odd(luma.odd, luma_by.odd, blue.odd, blue_by.odd, red.odd, red_by.odd);
      store_steps(even.combined(), odd.combined(), out + x);
    } else {
      store_steps(quotient(luma.even, luma_by.even), quotient(luma.odd, luma_by.odd), out + x);
    }
    if (saturates(most_noise)) {  // noise of more than 200 grey levels: words do not hold it
      distance_row_reference(rest_of(in, x), lanes, out + x);
    }
  }
  distance_row_reference(rest_of(in, x), width - x, out + x);
}

void distance(const DistanceRow& in, int width, std::uint8_t* out) {
  if (in.cb.now != nullptr) {
    distance_of<true>(in, width, out);
  } else {
    distance_of<false>(in, width, out);
  }
}

void bins_of(const std::uint8_t* now, const std::uint16_t* mean, const std::uint8_t* foreground, int count,
             std::uint16_t* bins) {
  const hn::ScalableTag<std::int32_t> di;
  const hn::Rebind<float, decltype(di)> df;
  const hn::Rebind<std::uint16_t, decltype(di)> d16;
  const hn::Rebind<std::uint8_t, decltype(di)> d8;
  const int lanes = static_cast<int>(hn::Lanes(di));
  const auto one = hn::Set(di, 1);
  const auto dropped = hn::Set(di, kGainBins);
  int i = 0;
  // The last pixel's two neighbours are read too, which the row need not have: it is left to the reference.
  for (; i + lanes < count; i += lanes) {
    auto now8 = hn::Zero(d8);
    auto moving8 = now8;
    auto mean16 = hn::Zero(d16);
    auto skip8 = now8;
    auto skip16 = mean16;
    hn::LoadInterleaved3(d8, now + kGainStep * i, now8, skip8, skip8);
    hn::LoadInterleaved3(d8, foreground + kGainStep * i, moving8, skip8, skip8);
    hn::LoadInterleaved3(d16, mean + kGainStep * i, mean16, skip16, skip16);
    const auto value = hn::PromoteTo(di, now8);
    const auto background = hn::Max(hn::PromoteTo(di, mean16), one);
    const auto n = hn::Add(hn::ShiftLeft<16>(value), hn::ShiftRight<1>(background));
    // The float's quotient is off by one at most; what remains of n tells which way.
    auto ratio = hn::ConvertTo(di, hn::Div(hn::ConvertTo(df, n), hn::ConvertTo(df, background)));
    const auto rest = hn::Sub(n, hn::Mul(ratio, background));
    ratio = hn::Add(ratio, hn::VecFromMask(di, hn::Lt(rest, hn::Zero(di))));
    ratio = hn::Sub(ratio, hn::VecFromMask(di, hn::Lt(hn::Sub(background, one), rest)));
    const auto within = [&](auto v, int low, int high) HWY_ATTR {
      return hn::And(hn::Lt(hn::Set(di, low - 1), v), hn::Lt(v, hn::Set(di, high + 1)));
    };
    const auto counts =
        hn::And(hn::And(within(background, kGainDarkest, kClipped), within(value, kNowDarkest, kNowBrightest)),
                hn::Eq(hn::PromoteTo(di, moving8), hn::Zero(di)));
    const auto bin = hn::IfThenElse(counts, hn::Min(ratio, hn::Set(di, kGainBins - 1)), dropped);
    hn::StoreU(hn::DemoteTo(d16, bin), d16, bins + i);
  }
  gain_bins_reference(now + kGainStep * i, mean + kGainStep * i, foreground + kGainStep * i, count - i, bins + i);
}

int count_of(const std::uint16_t* values, int count, int limit) {
  constexpr int kMost = 65535;  // vectors until a lane's count may overflow
  const Word most = word(limit);
  const int lanes = static_cast<int>(hn::Lanes(kWords));
  int sum = 0;
  int i = 0;
  while (i + lanes <= count) {
    const int vectors = std::min((count - i) / lanes, kMost);
    Word counts = hn::Zero(kWords);
    for (int v = 0; v < vectors; ++v, i += lanes) {
      const Word value = hn::LoadU(kWords, values + i);
      counts = hn::Sub(counts, hn::VecFromMask(kWords, hn::Eq(hn::Min(value, most), value)));
    }
    HWY_ALIGN std::uint16_t each[hn::MaxLanes(kWords)];
    hn::Store(counts, kWords, each);
    for (int lane = 0; lane < lanes; ++lane) sum += each[lane];
  }
  return sum + count_up_to_reference(values + i, count - i, limit);
}

#endif

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace stereotrack
HWY_AFTER_NAMESPACE();

#if HWY_ONCE

namespace stereotrack {

namespace {

HWY_EXPORT(lit);
HWY_EXPORT(range);
HWY_EXPORT(distance);
HWY_EXPORT(bins_of);
HWY_EXPORT(count_of);

int steps(int apart, int deviation, int noise_floor) noexcept {
  return apart * kStepsPerSd / (deviation * 5 / 4 + noise_floor);
}

}  // namespace

void lit_row_reference(const std::uint16_t* mean, int gain, int width, std::uint8_t* out) noexcept {
  for (int x = 0; x < width; ++x) {
    out[x] = static_cast<std::uint8_t>(std::min((mean[x] * gain + (1 << 15)) >> 16, 255));
  }
}

void range_row_reference(const ThreeRows& in, int width, std::uint8_t* out) noexcept {
  for (int x = 0; x < width; ++x) {
    int low = 255;
    int high = 0;
    for (const std::uint8_t* row : {in.above, in.here, in.under}) {
      for (int u = std::max(x - 1, 0); u <= std::min(x + 1, width - 1); ++u) {
        low = std::min<int>(low, row[u]);
        high = std::max<int>(high, row[u]);
      }
    }
    out[x] = static_cast<std::uint8_t>(high - low);
  }
}

void distance_row_reference(const DistanceRow& in, int width, std::uint8_t* out) noexcept {
  for (int x = 0; x < width; ++x) {
    const int tolerance = in.range[x] * in.edge_percent * 256 / 100;
    const int now = in.y.now[x] << 8;
    const int mean = in.y.mean[x];
    const int expected = (mean * in.gain) >> 8;
    const bool clipped = std::max(mean, expected) >= kClipped;
    const int apart = std::max(std::min(expected, kClipped) - now, now - (clipped ? 255 << 8 : expected));
    const int luma = steps(std::max(apart - tolerance, 0), in.y.deviation[x], in.noise_floor);
    int colour = 0;
    if (in.cb.now != nullptr) {
      for (const ChannelRow& row : {in.cb, in.cr}) {
        row.shown[x] = static_cast<std::uint8_t>(std::min((row.mean[x] + 128) >> 8, 255));
      }
      colour = std::max(steps(std::abs((in.cb.now[x] << 8) - in.cb.mean[x]), in.cb.deviation[x], in.noise_floor),
                        steps(std::abs((in.cr.now[x] << 8) - in.cr.mean[x]), in.cr.deviation[x], in.noise_floor));
    }
    out[x] = static_cast<std::uint8_t>(std::min(std::max(luma, colour) + std::min(luma, colour) / 2, 255));
  }
}

void gain_bins_reference(const std::uint8_t* now, const std::uint16_t* mean, const std::uint8_t* foreground, int count,
                         std::uint16_t* bins) noexcept {
  for (int i = 0; i < count; ++i) {
    const int background = mean[kGainStep * i];
    const int value = now[kGainStep * i];
    const bool counts = background >= kGainDarkest && background <= kClipped && value >= kNowDarkest &&
                        value <= kNowBrightest && foreground[kGainStep * i] == 0;
    const int ratio = counts ? std::min((value * 65536 + background / 2) / background, kGainBins - 1) : kGainBins;
    bins[i] = static_cast<std::uint16_t>(ratio);
  }
}

int count_up_to_reference(const std::uint16_t* values, int count, int limit) noexcept {
  return static_cast<int>(std::count_if(values, values + count, [limit](int value) { return value <= limit; }));
}

void lit_row(const std::uint16_t* mean, int gain, int width, std::uint8_t* out) noexcept {
  if (simd_in_use() == SimdTarget::kScalar) return lit_row_reference(mean, gain, width, out);
  HWY_DYNAMIC_DISPATCH(lit)(mean, gain, width, out);
}

void range_row(const ThreeRows& in, int width, std::uint8_t* out) noexcept {
  if (simd_in_use() == SimdTarget::kScalar) return range_row_reference(in, width, out);
  HWY_DYNAMIC_DISPATCH(range)(in, width, out);
}

void distance_row(const DistanceRow& in, int width, std::uint8_t* out) noexcept {
  if (simd_in_use() == SimdTarget::kScalar) return distance_row_reference(in, width, out);
  HWY_DYNAMIC_DISPATCH(distance)(in, width, out);
}

void gain_bins(const std::uint8_t* now, const std::uint16_t* mean, const std::uint8_t* foreground, int count,
               std::uint16_t* bins) noexcept {
  if (simd_in_use() == SimdTarget::kScalar) return gain_bins_reference(now, mean, foreground, count, bins);
  HWY_DYNAMIC_DISPATCH(bins_of)(now, mean, foreground, count, bins);
}

int count_up_to(const std::uint16_t* values, int count, int limit) noexcept {
  if (simd_in_use() == SimdTarget::kScalar) return count_up_to_reference(values, count, limit);
  return HWY_DYNAMIC_DISPATCH(count_of)(values, count, limit);
}

}  // namespace stereotrack

#endif
