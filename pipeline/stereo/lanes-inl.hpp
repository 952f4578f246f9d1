// What the matchers' kernels share; compiled once for each instruction set, so the guard is Highway's.
#if defined(STEREOTRACK_STEREO_LANES_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef STEREOTRACK_STEREO_LANES_INL
#undef STEREOTRACK_STEREO_LANES_INL
#else
#define STEREOTRACK_STEREO_LANES_INL
#endif

#include <hwy/highway.h>

#include <cstdint>
#include <type_traits>

#include "pipeline/stereo/disparity.hpp"
#include "pipeline/stereo/lane_layout.hpp"

HWY_BEFORE_NAMESPACE();
namespace stereotrack {
namespace HWY_NAMESPACE {

#if HWY_TARGET != HWY_SCALAR

namespace hn = hwy::HWY_NAMESPACE;

/// Disparities of a pixel stand in lanes of 16 bits.
using Lanes = hn::CappedTag<std::uint16_t, kLaneStep>;
using Vec = hn::Vec<Lanes>;
constexpr int kVector = static_cast<int>(hn::MaxLanes(Lanes()));

/// Pixels between two chunks of lanes, and so whose search for the smallest lane is made together.
constexpr int kBatch = kPixelStep;

/// Calls visit(vectors, lane, whether it is the first): the lanes in chunks that fit the registers, the last chunk
/// first: rising disparities. `lanes` is a multiple of kLaneStep.
template <class Visit>
HWY_INLINE void for_each_chunk(int lanes, const Visit& visit) {
  using Half = std::integral_constant<int, kLaneStep / kVector>;
  using Whole = std::integral_constant<int, 2 * kLaneStep / kVector>;
  const int rest = lanes % (2 * kLaneStep);
  if (rest != 0) visit(Half(), lanes - rest, true);
  for (int lane = lanes - rest - 2 * kLaneStep; lane >= 0; lane -= 2 * kLaneStep) {
    visit(Whole(), lane, rest == 0 && lane == lanes - 2 * kLaneStep);
  }
}

/// d - range.min of the vectors from `lane` on; of padding it is over every true one.
template <int kVectors>
HWY_INLINE void disparities_of(int count, int lane, Vec* ids) {
  for (int k = 0; k < kVectors; ++k) {
    ids[k] = hn::Sub(hn::Set(Lanes(), static_cast<std::uint16_t>(count - 1 - lane - k * kVector)),
                     hn::Iota(Lanes(), std::uint16_t{0}));
  }
}

/// 0xFFFF where id is not in [first, first + count), else 0.
HWY_INLINE Vec outside(Vec id, int first, int count) {
  const Lanes lanes;
  const Vec from_first = hn::Sub(id, hn::Set(lanes, static_cast<std::uint16_t>(first)));
  const Vec limit = hn::Set(lanes, static_cast<std::uint16_t>(count));
  return hn::VecFromMask(lanes, hn::Eq(hn::Max(from_first, limit), from_first));
}

/// Takes what is smaller; of equals, what is there.
HWY_INLINE void keep_smaller(Vec& best, Vec& best_id, Vec value, Vec id) {
  const Vec smaller = hn::Min(best, value);
  best_id = hn::IfThenElse(hn::Eq(smaller, best), best_id, id);
  best = smaller;
}

/// A value and its id as one number, so that the smallest is the smallest value and, of equals, the smallest id.
using Keys = hn::Repartition<std::uint32_t, Lanes>;
using KeyVec = hn::Vec<Keys>;

/// The smaller keys of each lane pair; where they stand does not matter any more.
HWY_INLINE KeyVec keys_of(Vec value, Vec id) {
  const Keys keys;
  const KeyVec lower = hn::BitCast(keys, hn::InterleaveLower(Lanes(), id, value));
  const KeyVec upper = hn::BitCast(keys, hn::InterleaveUpper(Lanes(), id, value));
  return hn::Min(lower, upper);
}

using FourKeys = hn::Full128<std::uint32_t>;

HWY_INLINE hn::Vec<FourKeys> fold_blocks(FourKeys /*tag*/, hn::Vec<FourKeys> v) { return v; }

template <class D>
HWY_INLINE hn::Vec<FourKeys> fold_blocks(D /*tag*/, hn::Vec<D> v) {
  const hn::Half<D> half;
  return fold_blocks(half, hn::Min(hn::LowerHalf(half, v), hn::UpperHalf(half, v)));
}

/// The smallest key of each of four vectors: halves of two vectors are put side by side and the smaller kept.
template <class V>
HWY_INLINE hn::Vec<FourKeys> smallest_of_each(V a, V b, V c, V d) {
#if HWY_ARCH_ARM_A64
  if constexpr (hn::MaxLanes(hn::DFromV<V>()) == 4) {
    return V(vpminq_u32(vpminq_u32(a.raw, b.raw), vpminq_u32(c.raw, d.raw)));
  }
#endif
  const hn::DFromV<V> keys;
  const hn::Repartition<std::uint64_t, hn::DFromV<V> > pairs;
  const V ab = hn::Min(hn::InterleaveLower(keys, a, b), hn::InterleaveUpper(keys, a, b));
  const V cd = hn::Min(hn::InterleaveLower(keys, c, d), hn::InterleaveUpper(keys, c, d));
  const auto ab_pairs = hn::BitCast(pairs, ab);
  const auto cd_pairs = hn::BitCast(pairs, cd);
  return fold_blocks(keys, hn::Min(hn::BitCast(keys, hn::InterleaveLower(pairs, ab_pairs, cd_pairs)),
                                   hn::BitCast(keys, hn::InterleaveUpper(pairs, ab_pairs, cd_pairs))));
}

#endif  // HWY_TARGET != HWY_SCALAR

}  // namespace HWY_NAMESPACE
}  // namespace stereotrack
HWY_AFTER_NAMESPACE();

#endif  // STEREOTRACK_STEREO_LANES_INL
