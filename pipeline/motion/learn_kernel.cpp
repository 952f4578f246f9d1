#include "pipeline/motion/learn_kernel.hpp"

#include <algorithm>
#include <bit>
#include <cstdlib>
#include <utility>

#include "pipeline/core/simd.hpp"
#include "pipeline/motion/adaptive_background.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "pipeline/motion/learn_kernel.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#ifndef STEREOTRACK_LEARN_KERNEL_CONSTANTS
#define STEREOTRACK_LEARN_KERNEL_CONSTANTS
namespace stereotrack {
namespace {

// A fresh pixel's deviation [8.8] and how many frames that guess weighs: one frame says nothing about noise.
constexpr int kPriorDeviation = 3 * 256;
constexpr int kPriorFrames = 8;
// How far a pixel may be from its candidate and still be the same look [8.8].
constexpr int kCandidateReach = 12 * 256;
// A bounded sample may pull this far beyond its deviations [8.8]: a deviation of 0 must be able to grow, as 8 bits of a
// still picture have none.
constexpr int kPullAtLeast = 256;
constexpr int kForget = AdaptiveBackground::kForget;
constexpr int kGhost = AdaptiveBackground::kGhost;
constexpr int kGhostFrames = AdaptiveBackground::kGhostFrames;

}  // namespace
}  // namespace stereotrack
#endif

HWY_BEFORE_NAMESPACE();
namespace stereotrack {
namespace HWY_NAMESPACE {
namespace {

#if HWY_TARGET == HWY_SCALAR

int learn(const LearnRow& row, const LearnRates& rates, int width) { return learn_row_reference(row, rates, width); }

#else

namespace hn = hwy::HWY_NAMESPACE;

using Words = hn::ScalableTag<std::uint16_t>;
using Floats = hn::Repartition<float, Words>;
constexpr Words kWords{};
constexpr hn::Repartition<std::uint32_t, Words> kDoubles{};
constexpr hn::Repartition<std::int32_t, Words> kSigned{};
constexpr Floats kFloats{};
using Word = hn::Vec<Words>;
using Float = hn::Vec<Floats>;

Word word(int value) { return hn::Set(kWords, static_cast<std::uint16_t>(value)); }

// The words as floats: even and odd ones apart, which needs no shuffle (little-endian).
Float even_floats(Word v) {
  return hn::ConvertTo(kFloats, hn::BitCast(kSigned, hn::And(hn::BitCast(kDoubles, v), hn::Set(kDoubles, 0xFFFF))));
}
Float odd_floats(Word v) {
  return hn::ConvertTo(kFloats, hn::BitCast(kSigned, hn::ShiftRight<16>(hn::BitCast(kDoubles, v))));
}

// For divide(): of divisors d, 1 <= d <= 1032.
Float even_reciprocal(Word d) { return hn::Div(hn::Set(kFloats, 1.0F), even_floats(d)); }
Float odd_reciprocal(Word d) { return hn::Div(hn::Set(kFloats, 1.0F), odd_floats(d)); }

// n / d, rounded down, exactly: (n + 1/2) / d is at least 1/(2 d) away from any integer, and the reciprocal and its
// product together are off by a part of 2^-23 of it, where 2^-17 would do as n < 2^16. The sum is exact.
Word divide(Word n, Float even_reciprocal, Float odd_reciprocal) {
  const auto half = hn::Set(kFloats, 0.5F);
  const auto even = hn::ConvertTo(kSigned, hn::Mul(hn::Add(even_floats(n), half), even_reciprocal));
  const auto odd = hn::ConvertTo(kSigned, hn::Mul(hn::Add(odd_floats(n), half), odd_reciprocal));
  return hn::BitCast(kWords, hn::Or(even, hn::ShiftLeft<16>(odd)));
}

Word distance_of(Word a, Word b) { return hn::Sub(hn::Max(a, b), hn::Min(a, b)); }
auto at_least(Word a, Word b) { return hn::Eq(hn::Max(a, b), a); }

// from + (to - from) / d, the quotient rounded towards 0.
Word step_towards(Word from, Word to, Float even_reciprocal, Float odd_reciprocal) {
  const Word step = divide(distance_of(from, to), even_reciprocal, odd_reciprocal);
  return hn::IfThenElse(at_least(to, from), hn::Add(from, step), hn::Sub(from, step));
}

// One divisor d of all lanes, 2 <= d < 2^15, as a multiplication (Granlund and Montgomery, "Division by invariant
// integers using multiplication", 1994): with l = ceil(log2 d) and m = floor(2^16 (2^l - d) / d) + 1,
//     n / d = (t + (n - t) / 2) / 2^(l - 1),  t = m n / 2^16,    each rounded down, exactly for n < 2^16.
struct Divisor {
  explicit Divisor(int d)
      : shift(static_cast<int>(std::bit_width(static_cast<unsigned>(d - 1))) - 1),
        factor(word((65536 * ((2 << shift) - d)) / d + 1)) {}
  int shift;  ///< l - 1
  Word factor;
};
Word divide(Word n, const Divisor& by) {
  const Word t = hn::MulHigh(by.factor, n);
  return hn::ShiftRightSame(hn::Add(t, hn::ShiftRight<1>(hn::Sub(n, t))), by.shift);
}

/// Each lane's own divisor.
struct Divisors {
  explicit Divisors(Word d) : even(even_reciprocal(d)), odd(odd_reciprocal(d)) {}
  Float even;
  Float odd;
};
Word divide(Word n, const Divisors& by) { return divide(n, by.even, by.odd); }

/// From one value to another: one of the ways is 0, the other is their distance.
struct Apart {
  Apart(Word from, Word to) : up(hn::SaturatedSub(to, from)), down(hn::SaturatedSub(from, to)) {}
  Apart(Word from, Word to, Word most) : Apart(from, to) {
    up = hn::Min(up, most);
    down = hn::Min(down, most);
  }
  [[nodiscard]] Word distance() const { return hn::Or(up, down); }
  /// As step_towards(); the step is no longer than the way.
  template <class By>
  [[nodiscard]] Word step_from(Word from, const By& by) const {
    const Word step = divide(distance(), by);
    return hn::Sub(hn::Add(from, hn::Min(step, up)), hn::Min(step, down));
  }
  Word up;
  Word down;
};

Word now_of(const LearnRow::Channel& channel, int x) {
  const hn::Rebind<std::uint8_t, Words> d8;
  return hn::ShiftLeft<8>(hn::PromoteTo(kWords, hn::LoadU(d8, channel.now + x)));
}

// How far a sample pulls at most.
Word farthest(Word deviation, int pull) {
  if (pull == 0) return word(65535);
  Word most = word(kPullAtLeast);
  for (int i = 0; i < pull; ++i) most = hn::SaturatedAdd(most, deviation);
  return most;
}

// Vectors in which all pixels are background.
template <class By>
void learn_calm(const LearnRow& row, const LearnRates& rates, int x, const By& by_rate, const By& by_slower) {
  for (int c = 0; c < row.count; ++c) {
    const LearnRow::Channel& channel = row.channels[c];
    const Word mean = hn::LoadU(kWords, channel.mean + x);
    const Word deviation = hn::LoadU(kWords, channel.deviation + x);
    const Word most = farthest(deviation, rates.pull);
    const Apart from_mean(mean, now_of(channel, x), most);
    const Apart from_deviation(deviation, from_mean.distance());
    hn::StoreU(from_mean.step_from(mean, by_rate), kWords, channel.mean + x);
    hn::StoreU(from_deviation.step_from(deviation, by_slower), kWords, channel.deviation + x);
  }
  const Word one = word(1);
  const Word age = hn::Add(hn::LoadU(kWords, row.age + x), one);
  hn::StoreU(hn::Min(age, word(rates.absorb)), kWords, row.age + x);
  hn::StoreU(hn::SaturatedSub(hn::LoadU(kWords, row.candidate_age + x), one), kWords, row.candidate_age + x);
}

// Vectors in which not all pixels are background: each kind is worked out for all lanes, and each
// takes its own. rate: of background pixels.
int learn_mixed(const LearnRow& row, const LearnRates& rates, int x, Word mask, Word rate) {
  const Word zero = hn::Zero(kWords);
  const Word one = word(1);
  const Word prior = word(kPriorDeviation);
  const Word age = hn::LoadU(kWords, row.age + x);
  const Word candidate_age = hn::LoadU(kWords, row.candidate_age + x);
  const auto fresh = hn::Or(hn::Eq(age, zero), hn::Eq(mask, word(kForget)));
  const auto calm = hn::AndNot(fresh, hn::Eq(mask, zero));
  const auto moving = hn::Not(hn::Or(fresh, calm));

  auto renewed = hn::Eq(candidate_age, zero);
  for (int c = 0; c < row.count; ++c) {
    const Word apart = distance_of(now_of(row.channels[c], x), hn::LoadU(kWords, row.channels[c].candidate + x));
    renewed = hn::Or(renewed, hn::Not(at_least(word(kCandidateReach), apart)));
  }
  const Word seen = hn::IfThenElse(renewed, one, hn::Add(candidate_age, one));
  const Word enough = hn::IfThenElse(hn::Eq(mask, word(kGhost)), word(kGhostFrames), word(rates.absorb));
  const auto lasting = hn::Or(hn::Not(at_least(hn::Max(age, word(kPriorFrames)), seen)), at_least(seen, enough));
  const auto exchanged = hn::And(hn::AndNot(renewed, moving), lasting);

  const Word slower = hn::Add(rate, word(kPriorFrames));
  const Word candidate_rate = hn::Min(seen, word(rates.window));
  const Float rate_even = even_reciprocal(rate);
  const Float rate_odd = odd_reciprocal(rate);
  const Float slower_even = even_reciprocal(slower);
  const Float slower_odd = odd_reciprocal(slower);
  const Float candidate_even = even_reciprocal(candidate_rate);
  const Float candidate_odd = odd_reciprocal(candidate_rate);
  for (int c = 0; c < row.count; ++c) {
    const LearnRow::Channel& channel = row.channels[c];
    const Word now = now_of(channel, x);
    const Word mean = hn::LoadU(kWords, channel.mean + x);
    const Word deviation = hn::LoadU(kWords, channel.deviation + x);
    const Word candidate = hn::LoadU(kWords, channel.candidate + x);
    const Word followed = hn::IfThenElse(renewed, now, step_towards(candidate, now, candidate_even, candidate_odd));
    const Word most = farthest(deviation, rates.pull);
    const Word near = hn::Min(hn::Max(now, hn::SaturatedSub(mean, most)), hn::SaturatedAdd(mean, most));
    const Word calm_mean = step_towards(mean, near, rate_even, rate_odd);
    const Word calm_deviation = step_towards(deviation, distance_of(near, mean), slower_even, slower_odd);

    const Word kept_mean = hn::IfThenElse(exchanged, followed, hn::IfThenElse(calm, calm_mean, mean));
    const Word kept_deviation = hn::IfThenElse(calm, calm_deviation, deviation);
    const Word kept_candidate = hn::IfThenElse(moving, followed, candidate);
    hn::StoreU(hn::IfThenElse(fresh, now, kept_mean), kWords, channel.mean + x);
    hn::StoreU(hn::IfThenElse(hn::Or(exchanged, fresh), prior, kept_deviation), kWords, channel.deviation + x);
    hn::StoreU(hn::IfThenElse(exchanged, mean, kept_candidate), kWords, channel.candidate + x);
  }
  const Word older = hn::Min(hn::Add(age, one), word(rates.absorb));
  const Word kept_age = hn::IfThenElse(exchanged, seen, hn::IfThenElse(calm, older, age));
  hn::StoreU(hn::IfThenElse(fresh, one, kept_age), kWords, row.age + x);
  const Word moving_age = hn::IfThenElse(exchanged, hn::ShiftRight<1>(age), seen);
  const Word kept_candidate_age = hn::IfThenElse(moving, moving_age, hn::SaturatedSub(candidate_age, one));
  hn::StoreU(hn::IfThenElse(fresh, zero, kept_candidate_age), kWords, row.candidate_age + x);
  return static_cast<int>(hn::CountTrue(kWords, moving));
}

int learn(const LearnRow& row, const LearnRates& rates, int width) {
  const hn::Rebind<std::uint8_t, Words> d8;
  const int lanes = static_cast<int>(hn::Lanes(kWords));
  const Word zero = hn::Zero(kWords);
  const Word one = word(1);
  const Word window = word(rates.window);
  Word rate = window;
  Divisor by_rate(rates.window);
  Divisor by_slower(rates.window + kPriorFrames);
  int changed = 0;
  int x = 0;
  for (; x + lanes <= width; x += lanes) {
    const Word mask = hn::PromoteTo(kWords, hn::LoadU(d8, row.mask + x));
    const Word age = hn::LoadU(kWords, row.age + x);
    const Word rate_here = hn::Min(hn::Add(age, one), window);
    if (!hn::AllTrue(kWords, hn::AndNot(hn::Eq(age, zero), hn::Eq(mask, zero)))) {
      changed += learn_mixed(row, rates, x, mask, rate_here);
      continue;
    }
    // Neighbours are mostly of one age, above all after a while.
    if (!hn::AllTrue(kWords, hn::Eq(rate, rate_here))) {
      const int first = hn::GetLane(rate_here);
      if (!hn::AllTrue(kWords, hn::Eq(word(first), rate_here))) {
        learn_calm(row, rates, x, Divisors(rate_here), Divisors(hn::Add(rate_here, word(kPriorFrames))));
        continue;
      }
      rate = rate_here;
      by_rate = Divisor(first);
      by_slower = Divisor(first + kPriorFrames);
    }
    learn_calm(row, rates, x, by_rate, by_slower);
  }
  LearnRow rest = row;
  for (int c = 0; c < row.count; ++c) {
    const LearnRow::Channel& channel = row.channels[c];
    rest.channels[c] = {channel.now + x, channel.mean + x, channel.deviation + x, channel.candidate + x};
  }
  rest.age = row.age + x;
  rest.candidate_age = row.candidate_age + x;
  rest.mask = row.mask + x;
  return changed + learn_row_reference(rest, rates, width - x);
}

#endif

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace stereotrack
HWY_AFTER_NAMESPACE();

#if HWY_ONCE

namespace stereotrack {

namespace {

HWY_EXPORT(learn);

int now_at(const LearnRow::Channel& channel, int x) noexcept { return channel.now[x] << 8; }

void forget(const LearnRow& row, int x) noexcept {
  for (int c = 0; c < row.count; ++c) {
    row.channels[c].mean[x] = static_cast<std::uint16_t>(now_at(row.channels[c], x));
    row.channels[c].deviation[x] = kPriorDeviation;
  }
  row.age[x] = 1;
  row.candidate_age[x] = 0;
}

void blend(const LearnRow& row, const LearnRates& rates, int x) noexcept {
  const int rate = std::min(row.age[x] + 1, rates.window);
  for (int c = 0; c < row.count; ++c) {
    const LearnRow::Channel& channel = row.channels[c];
    const int deviation = channel.deviation[x];
    const int most = rates.pull == 0 ? 65535 : rates.pull * deviation + kPullAtLeast;
    const int apart = std::clamp(now_at(channel, x) - channel.mean[x], -most, most);
    channel.mean[x] = static_cast<std::uint16_t>(channel.mean[x] + apart / rate);
    channel.deviation[x] =
        static_cast<std::uint16_t>(deviation + (std::abs(apart) - deviation) / (rate + kPriorFrames));
  }
  row.age[x] = static_cast<std::uint16_t>(std::min(row.age[x] + 1, rates.absorb));
  if (row.candidate_age[x] > 0) --row.candidate_age[x];
}

bool near_candidate(const LearnRow& row, int x) noexcept {
  return std::all_of(row.channels.begin(), row.channels.begin() + row.count, [x](const LearnRow::Channel& channel) {
    return std::abs(now_at(channel, x) - channel.candidate[x]) <= kCandidateReach;
  });
}

void learn_candidate(const LearnRow& row, const LearnRates& rates, int x) noexcept {
  std::uint16_t& age = row.age[x];
  std::uint16_t& candidate_age = row.candidate_age[x];
  if (candidate_age == 0 || !near_candidate(row, x)) {
    for (int c = 0; c < row.count; ++c) {
      row.channels[c].candidate[x] = static_cast<std::uint16_t>(now_at(row.channels[c], x));
    }
    candidate_age = 1;
    return;
  }
  ++candidate_age;
  for (int c = 0; c < row.count; ++c) {
    std::uint16_t& candidate = row.channels[c].candidate[x];
    const int apart = now_at(row.channels[c], x) - candidate;
    candidate = static_cast<std::uint16_t>(candidate + apart / std::min<int>(candidate_age, rates.window));
  }
  // A look must last at least kPriorFrames: a slow object in the first frames is no background.
  const int enough = row.mask[x] == kGhost ? kGhostFrames : rates.absorb;
  if (candidate_age <= std::max<int>(age, kPriorFrames) && candidate_age < enough) return;
  for (int c = 0; c < row.count; ++c) {
    std::swap(row.channels[c].mean[x], row.channels[c].candidate[x]);
    row.channels[c].deviation[x] = kPriorDeviation;
  }
  std::swap(age, candidate_age);
  candidate_age = static_cast<std::uint16_t>(candidate_age / 2);
}

}  // namespace

int learn_row_reference(const LearnRow& row, const LearnRates& rates, int width) noexcept {
  int changed = 0;
  for (int x = 0; x < width; ++x) {
    if (row.age[x] == 0 || row.mask[x] == kForget) {
      forget(row, x);
    } else if (row.mask[x] == 0) {
      blend(row, rates, x);
    } else {
      learn_candidate(row, rates, x);
      ++changed;
    }
  }
  return changed;
}

int learn_row(const LearnRow& row, const LearnRates& rates, int width) noexcept {
  if (simd_in_use() == SimdTarget::kScalar) return learn_row_reference(row, rates, width);
  return HWY_DYNAMIC_DISPATCH(learn)(row, rates, width);
}

}  // namespace stereotrack

#endif
