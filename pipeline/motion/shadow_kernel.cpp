#include "pipeline/motion/shadow_kernel.hpp"

#include <algorithm>
#include <cstdlib>

#include "pipeline/core/simd.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "pipeline/motion/shadow_kernel.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#ifndef STEREOTRACK_SHADOW_KERNEL_CONSTANTS
#define STEREOTRACK_SHADOW_KERNEL_CONSTANTS
namespace stereotrack {
namespace {

constexpr int kReach = 2;
constexpr int kBrightestPercent = 97;  // above, the light is the same
constexpr int kBrightestWide = 200;    // stereo has spoken: it may be brighter, too

}  // namespace
}  // namespace stereotrack
#endif

HWY_BEFORE_NAMESPACE();
namespace stereotrack {
namespace HWY_NAMESPACE {
namespace {

// Each returns the first pixel that it has left to the reference.

#if HWY_TARGET == HWY_SCALAR

int look(const LookPlanes&, const LookTolerances&, int, int from, int, std::uint8_t*) { return from; }
int outvote(ImageView<const std::int8_t>, int, std::uint8_t*, int*) { return 0; }

#else

namespace hn = hwy::HWY_NAMESPACE;

constexpr hn::ScalableTag<std::int32_t> kInts{};
constexpr hn::Rebind<float, hn::ScalableTag<std::int32_t> > kFloats{};
constexpr hn::Rebind<std::uint8_t, hn::ScalableTag<std::int32_t> > kPixels{};
using Ints = hn::Vec<hn::ScalableTag<std::int32_t> >;

Ints ints(int value) { return hn::Set(kInts, value); }
Ints load(const std::uint8_t* at) { return hn::PromoteTo(kInts, hn::LoadU(kPixels, at)); }
auto at_most(Ints a, Ints b) { return hn::Not(hn::Lt(b, a)); }

int look(const LookPlanes& in, const LookTolerances& tolerances, int v, int from, int to, std::uint8_t* looks) {
  const int lanes = static_cast<int>(hn::Lanes(kInts));
  const int top = std::max(v - kReach, 0);
  const int bottom = std::min(v + kReach, in.y.height - 1);
  const int count = (bottom - top + 1) * (2 * kReach + 1);
  int x = from;
  for (; x < to && x >= kReach && x + lanes + kReach <= in.y.width; x += lanes) {
    Ints now = hn::Zero(kInts);
    Ints before = hn::Zero(kInts);
    for (int w = top; w <= bottom; ++w) {
      for (int u = x - kReach; u <= x + kReach; ++u) {
        now = hn::Add(now, load(in.y.row(w) + u));
        before = hn::Add(before, load(in.y_background.row(w) + u));
      }
    }
    const auto known = hn::Lt(hn::Zero(kInts), before);
    // 256 now / before, rounded down, exactly, as in the distance kernel: the numerator is below 2^21.
    const auto numerator = hn::Add(hn::ConvertTo(kFloats, hn::ShiftLeft<8>(now)), hn::Set(kFloats, 0.5F));
    const Ints ratio = hn::ConvertTo(kInts, hn::Div(numerator, hn::ConvertTo(kFloats, hn::Max(before, ints(1)))));
    // ratio before <= 256 now, so that neither a term nor the sum outgrows 2 x 25 x 65280.
    Ints residual = hn::Zero(kInts);
    for (int w = top; w <= bottom; ++w) {
      for (int u = x - kReach; u <= x + kReach; ++u) {
        const Ints expected = hn::Mul(load(in.y_background.row(w) + u), ratio);
        residual = hn::Add(residual, hn::Abs(hn::Sub(hn::ShiftLeft<8>(load(in.y.row(w) + u)), expected)));
      }
    }
    const Ints percent = hn::Mul(ratio, ints(100));
    Ints change = hn::Zero(kInts);  // of the chroma, the larger one
    if (!in.cb.empty()) {
      const auto change_of = [&](const std::uint8_t* plane, const std::uint8_t* background) HWY_ATTR {
        const Ints value = hn::ShiftLeft<8>(hn::Sub(load(plane + x), ints(128)));
        return hn::Abs(hn::Sub(value, hn::Mul(hn::Sub(load(background + x), ints(128)), ratio)));
      };
      change =
          hn::Max(change_of(in.cb.row(v), in.cb_background.row(v)), change_of(in.cr.row(v), in.cr_background.row(v)));
    }
    Ints bits = hn::Zero(kInts);
    for (const int slack : {1, kWideSlack}) {
      const bool wide = slack > 1;
      const auto texture = hn::And(known, at_most(residual, ints(tolerances.texture * 256 * slack * count)));
      auto light = hn::And(at_most(ints(tolerances.darkest_percent * 256), hn::Mul(percent, ints(slack))),
                           hn::Lt(percent, ints(kBrightestPercent * 256)));
      if (wide) light = hn::Or(light, hn::Lt(percent, ints(kBrightestWide * 256)));
      const auto same = hn::And(hn::And(texture, light), at_most(change, ints(tolerances.chroma * 256 * slack)));
      bits = hn::Or(bits, hn::IfThenElseZero(texture, ints(wide ? kTextureWide : kTexture)));
      bits = hn::Or(bits, hn::IfThenElseZero(same, ints(wide ? kSameLookWide : kSameLook)));
    }
    hn::StoreU(hn::DemoteTo(kPixels, bits), kPixels, looks + x);
  }
  return std::min(x, to);
}

int outvote(ImageView<const std::int8_t> verdicts, int v, std::uint8_t* mask, int* cleared) {
  const hn::CappedTag<std::int8_t, kVerdictFrame> d;
  const hn::RebindToUnsigned<decltype(d)> du;
  const int lanes = static_cast<int>(hn::Lanes(d));
  int x = 0;
  for (; x + lanes <= verdicts.width; x += lanes) {
    const auto set = hn::LoadU(du, mask + x);
    if (hn::AllTrue(du, hn::Eq(set, hn::Zero(du)))) continue;
    auto sum = hn::Zero(d);
    for (int w = v - kReach; w <= v + kReach; ++w) {
      for (int u = x - kReach; u <= x + kReach; ++u) sum = hn::Add(sum, hn::LoadU(d, verdicts.row(w) + u));
    }
    const auto background = hn::BitCast(du, hn::VecFromMask(d, hn::Lt(hn::Zero(d), sum)));
    const auto rest = hn::AndNot(background, set);
    *cleared += static_cast<int>(hn::CountTrue(du, hn::Ne(rest, set)));
    hn::StoreU(rest, du, mask + x);
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

HWY_EXPORT(look);
HWY_EXPORT(outvote);

std::uint8_t look_at(const LookPlanes& in, const LookTolerances& tolerances, int x, int y) noexcept {
  int now = 0;
  int before = 0;
  int count = 0;
  const auto for_each_neighbour = [&](auto&& fn) {
    for (int v = std::max(y - kReach, 0); v <= std::min(y + kReach, in.y.height - 1); ++v) {
      for (int u = std::max(x - kReach, 0); u <= std::min(x + kReach, in.y.width - 1); ++u) fn(u, v);
    }
  };
  for_each_neighbour([&](int u, int v) {
    now += in.y.at(u, v);
    before += in.y_background.at(u, v);
    ++count;
  });
  if (before == 0) return 0;
  const int ratio = now * 256 / before;
  int residual = 0;
  for_each_neighbour(
      [&](int u, int v) { residual += std::abs(in.y.at(u, v) * 256 - in.y_background.at(u, v) * ratio); });
  const auto change = [&](int value, int background) {
    return std::abs((value - 128) * 256 - (background - 128) * ratio);
  };
  int looks = 0;
  for (const int slack : {1, kWideSlack}) {
    const bool wide = slack > 1;
    if (residual > tolerances.texture * 256 * slack * count) continue;
    looks |= wide ? kTextureWide : kTexture;
    const bool darker =
        ratio * 100 * slack >= tolerances.darkest_percent * 256 && ratio * 100 < kBrightestPercent * 256;
    const bool lit = wide && ratio * 100 < kBrightestWide * 256;
    const int limit = tolerances.chroma * 256 * slack;
    const bool colour_kept = in.cb.empty() || (change(in.cb.at(x, y), in.cb_background.at(x, y)) <= limit &&
                                               change(in.cr.at(x, y), in.cr_background.at(x, y)) <= limit);
    if ((darker || lit) && colour_kept) looks |= wide ? kSameLookWide : kSameLook;
  }
  return static_cast<std::uint8_t>(looks);
}

int clear_outvoted_part(ImageView<const std::int8_t> verdicts, int v, int from, std::uint8_t* mask) noexcept {
  int cleared = 0;
  for (int x = from; x < verdicts.width; ++x) {
    if (mask[x] == 0) continue;
    int sum = 0;
    for (int w = v - kReach; w <= v + kReach; ++w) {
      for (int u = x - kReach; u <= x + kReach; ++u) sum += verdicts.at(u, w);
    }
    if (sum <= 0) continue;
    mask[x] = 0;
    ++cleared;
  }
  return cleared;
}

}  // namespace

void look_row_reference(const LookPlanes& in, const LookTolerances& tolerances, int v, int from, int to,
                        std::uint8_t* looks) noexcept {
  for (int x = from; x < to; ++x) looks[x] = look_at(in, tolerances, x, v);
}

int clear_outvoted_reference(ImageView<const std::int8_t> verdicts, int v, std::uint8_t* mask) noexcept {
  return clear_outvoted_part(verdicts, v, 0, mask);
}

void look_row(const LookPlanes& in, const LookTolerances& tolerances, int v, int from, int to,
              std::uint8_t* looks) noexcept {
  if (simd_in_use() == SimdTarget::kScalar) return look_row_reference(in, tolerances, v, from, to, looks);
  const int inner = std::min(std::max(from, kReach), to);
  look_row_reference(in, tolerances, v, from, inner, looks);
  const int rest = HWY_DYNAMIC_DISPATCH(look)(in, tolerances, v, inner, to, looks);
  look_row_reference(in, tolerances, v, rest, to, looks);
}

int clear_outvoted(ImageView<const std::int8_t> verdicts, int v, std::uint8_t* mask) noexcept {
  if (simd_in_use() == SimdTarget::kScalar) return clear_outvoted_reference(verdicts, v, mask);
  int cleared = 0;
  const int rest = HWY_DYNAMIC_DISPATCH(outvote)(verdicts, v, mask, &cleared);
  return cleared + clear_outvoted_part(verdicts, v, rest, mask);
}

}  // namespace stereotrack

#endif
