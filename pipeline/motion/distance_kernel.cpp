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
  return {row.now + x, row.mean + x, row.deviation + x};
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

void distance(const DistanceRow& in, int width, std::uint8_t* out) {
  const hn::ScalableTag<std::int32_t> di;
  const hn::Rebind<std::uint32_t, decltype(di)> du;
  const hn::Rebind<float, decltype(di)> df;
  const hn::Rebind<std::uint16_t, decltype(di)> d16;
  const hn::Rebind<std::uint8_t, decltype(di)> d8;
  const int lanes = static_cast<int>(hn::Lanes(di));
  // range edge 256 / 100 = range scale / 2^15, rounded down, exactly: scale is at most 1 too large, which adds less
  // than 255 / 2^15 < 1/100 to a multiple of 1/100. The product stays below 2^32.
  const auto edge = static_cast<std::uint32_t>(in.edge_percent) * 256;
  const auto scale = hn::Set(du, ((edge << 15) + 99) / 100);
  const auto gain = hn::Set(di, in.gain);
  const auto floor = hn::Set(di, in.noise_floor);
  const auto clipped = hn::Set(di, kClipped);
  const auto unclipped = hn::Set(di, kClipped - 1);
  const auto white = hn::Set(di, 255 << 8);
  const auto half = hn::Set(df, 0.5F);
  const auto load = [&](const ChannelRow& row, int x)
                        HWY_ATTR { return hn::ShiftLeft<8>(hn::PromoteTo(di, hn::LoadU(d8, row.now + x))); };
  const auto mean_of = [&](const ChannelRow& row, int x)
                           HWY_ATTR { return hn::PromoteTo(di, hn::LoadU(d16, row.mean + x)); };
  const auto in_steps = [&](auto apart, const ChannelRow& row, int x) HWY_ATTR {
    const auto deviation = hn::PromoteTo(di, hn::LoadU(d16, row.deviation + x));
    const auto noise = hn::Add(hn::Add(deviation, hn::ShiftRight<2>(deviation)), floor);  // 5/4 and floor
    // n / m, rounded down, exactly: (n + 1/2) / m is at least 1/(2 m) away from any integer, and a float's division is
    // off by n / m 2^-24, less than that as n < 2^21 (a look-alike good to 2^-22 would do).
    const auto n = hn::ConvertTo(df, hn::ShiftLeft<2>(apart));
    static_assert(kStepsPerSd == 1 << 2);
    return hn::ConvertTo(di, hn::Div(hn::Add(n, half), hn::ConvertTo(df, noise)));
  };
  const bool colour = in.cb.now != nullptr;
  int x = 0;
  for (; x + lanes <= width; x += lanes) {
    const auto range = hn::PromoteTo(du, hn::LoadU(d8, in.range + x));
    const auto tolerance = hn::BitCast(di, hn::ShiftRight<15>(hn::Mul(range, scale)));
    const auto now = load(in.y, x);
    const auto mean = mean_of(in.y, x);
    const auto expected = hn::ShiftRight<8>(hn::Mul(mean, gain));
    const auto is_clipped = hn::Lt(unclipped, hn::Max(mean, expected));
    const auto apart =
        hn::Max(hn::Sub(hn::Min(expected, clipped), now), hn::Sub(now, hn::IfThenElse(is_clipped, white, expected)));
    const auto luma = in_steps(hn::Max(hn::Sub(apart, tolerance), hn::Zero(di)), in.y, x);
    auto sum = luma;
    if (colour) {
      const auto blue = in_steps(hn::Abs(hn::Sub(load(in.cb, x), mean_of(in.cb, x))), in.cb, x);
      const auto red = in_steps(hn::Abs(hn::Sub(load(in.cr, x), mean_of(in.cr, x))), in.cr, x);
      const auto both = hn::Max(blue, red);
      sum = hn::Add(hn::Max(luma, both), hn::ShiftRight<1>(hn::Min(luma, both)));
    }
    hn::StoreU(hn::DemoteTo(d8, sum), d8, out + x);  // saturates
  }
  DistanceRow rest = in;
  rest.y = rest_of(in.y, x);
  rest.cb = rest_of(in.cb, x);
  rest.cr = rest_of(in.cr, x);
  rest.range = in.range + x;
  distance_row_reference(rest, width - x, out + x);
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

}  // namespace stereotrack

#endif
