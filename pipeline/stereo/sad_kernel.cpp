#include "pipeline/stereo/sad_kernel.hpp"

#include <algorithm>
#include <cstdlib>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "pipeline/stereo/sad_kernel.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "pipeline/stereo/lanes-inl.hpp"

#ifndef STEREOTRACK_SAD_KERNEL_COMMON
#define STEREOTRACK_SAD_KERNEL_COMMON
namespace stereotrack {
namespace {

/// A window of 11 x 11 pixels sums up to 30,855: twice that and one fit 16 bits.
[[maybe_unused]] constexpr int kLargestPairedBlock = 11;

}  // namespace
}  // namespace stereotrack
#endif

HWY_BEFORE_NAMESPACE();
namespace stereotrack {
namespace HWY_NAMESPACE {
namespace {

#if HWY_TARGET == HWY_SCALAR

DisparityCounts match_in_lanes(const SadTask& task, SadScratch& scratch) { return sad_reference(task, scratch); }

#else

/// As many bytes as there are lanes in one or two vectors.
template <int kVectors>
using Bytes = hn::CappedTag<std::uint8_t, static_cast<std::size_t>(kVectors >= 2 ? 2 * kVector : kVector)>;

template <class D, class V>
HWY_INLINE V distance(D /*tag*/, V a, V b) {
#if HWY_ARCH_ARM_A64
  return V(vabdq_u8(a.raw, b.raw));  // Highway has no name for it yet
#else
  return hn::Or(hn::SaturatedSub(a, b), hn::SaturatedSub(b, a));
#endif
}

#if HWY_ARCH_X86
// Products of unsigned and signed bytes, summed in pairs; Highway has no name for it yet.
template <std::size_t N>
HWY_INLINE auto weigh_pairs(hn::Vec128<std::uint8_t, N> v, hn::Vec128<std::int8_t, N> weights) {
  return hn::Vec128<std::uint16_t, N / 2>{_mm_maddubs_epi16(v.raw, weights.raw)};
}
#if HWY_TARGET <= HWY_AVX2
HWY_INLINE auto weigh_pairs(hn::Vec256<std::uint8_t> v, hn::Vec256<std::int8_t> weights) {
  return hn::Vec256<std::uint16_t>{_mm256_maddubs_epi16(v.raw, weights.raw)};
}
HWY_INLINE auto quarters_in_pairs(hn::Vec256<std::uint8_t> v) {
  return hn::Vec256<std::uint8_t>{_mm256_permute4x64_epi64(v.raw, _MM_SHUFFLE(3, 1, 2, 0))};
}
#endif
#if HWY_TARGET <= HWY_AVX3
HWY_INLINE auto weigh_pairs(hn::Vec512<std::uint8_t> v, hn::Vec512<std::int8_t> weights) {
  return hn::Vec512<std::uint16_t>{_mm512_maddubs_epi16(v.raw, weights.raw)};
}
HWY_INLINE auto quarters_in_pairs(hn::Vec512<std::uint8_t> v) {
  const __m512i order = _mm512_setr_epi64(0, 4, 1, 5, 2, 6, 3, 7);
  return hn::Vec512<std::uint8_t>{_mm512_permutexvar_epi64(order, v.raw)};
}
#endif
#endif

/// Where sums of 16 bits stand in the vectors of a chunk. Bytes become two vectors of 16 bits block by block of 128
/// bits, so that with longer vectors
///   - two vectors get their bytes in such an order that lanes end up as counted,
///   - of more, vectors 2i and 2i + 1 share lanes 2i kVector and following, block by block in turns.
template <int kVectors>
inline constexpr bool kInOrder = kVectors <= 2 || kVector <= 8;

template <int kVectors, class V8>
HWY_INLINE V8 ordered(V8 bytes) {
#if HWY_ARCH_X86 && HWY_TARGET <= HWY_AVX2
  if constexpr (kVectors == 2) return quarters_in_pairs(bytes);
#endif
  return bytes;
}

#if HWY_ARCH_ARM_A64
HWY_INLINE uint8x16x4_t load_four(const std::uint8_t* from) { return vld1q_u8_x4(from); }
#endif

/// Adds entering - leaving, or twice that, to lanes of 16 bits modulo 2^16: one vector or two.
template <int kVectors, bool kTwice, class V8>
HWY_INLINE void change(V8 entering, V8 leaving, Vec* sums) {
  const Lanes lanes;
  if constexpr (kVectors == 1) {
    const Vec once = hn::Sub(hn::PromoteTo(lanes, entering), hn::PromoteTo(lanes, leaving));
    sums[0] = hn::Add(sums[0], kTwice ? hn::Add(once, once) : once);
  } else {
#if HWY_ARCH_X86
    const Bytes<kVectors> bytes;
    const hn::Repartition<std::uint16_t, Bytes<kVectors> > pairs;
    const hn::RebindToSigned<Bytes<kVectors> > as_signed;
    const auto weights = hn::BitCast(as_signed, hn::Set(pairs, kTwice ? 0xFE02 : 0xFF01));
    sums[0] = hn::Add(sums[0], weigh_pairs(hn::InterleaveLower(bytes, entering, leaving), weights));
    sums[1] = hn::Add(sums[1], weigh_pairs(hn::InterleaveUpper(bytes, entering, leaving), weights));
#elif HWY_ARCH_ARM_A64
    const uint8x16_t weight = vdupq_n_u8(kTwice ? 2 : 1);
    const auto half = [](uint8x16_t v) HWY_ATTR { return vget_low_u8(v); };
    sums[0] = Vec(vmlsl_u8(vmlal_u8(sums[0].raw, half(entering.raw), half(weight)), half(leaving.raw), half(weight)));
    sums[1] = Vec(vmlsl_high_u8(vmlal_high_u8(sums[1].raw, entering.raw, weight), leaving.raw, weight));
#else
    static_assert(!kTwice);
    const hn::Half<Bytes<kVectors> > half;
    const auto add = [&](Vec sum, auto in, auto out) HWY_ATTR {
      return hn::Add(sum, hn::Sub(hn::PromoteTo(lanes, in), hn::PromoteTo(lanes, out)));
    };
    sums[0] = add(sums[0], hn::LowerHalf(half, entering), hn::LowerHalf(half, leaving));
    sums[1] = add(sums[1], hn::UpperHalf(half, entering), hn::UpperHalf(half, leaving));
#endif
  }
}

/// The vectors that begin at `from`.
template <int kCount, class D>
HWY_INLINE void load(D d, const hn::TFromD<D>* from, hn::Vec<D>* to) {
#if HWY_ARCH_ARM_A64
  // One instruction for four of them.
  if constexpr (kCount >= 4 && hn::MaxLanes(D()) * sizeof(hn::TFromD<D>) == 16) {
    for (int i = 0; i < kCount; i += 4, from += 4 * hn::MaxLanes(D())) {
      const auto four = load_four(from);
      for (int k = 0; k < 4; ++k) to[i + k] = hn::Vec<D>(four.val[k]);
    }
    return;
  }
#endif
  for (int i = 0; i < kCount; ++i) to[i] = hn::LoadU(d, from + static_cast<std::size_t>(i) * hn::MaxLanes(D()));
}

/// Sums from and to memory. Unrolled by hand: what is indexed by a variable anywhere stands in memory everywhere.
template <int kCount>
HWY_INLINE void load_sums(const std::uint16_t* from, Vec* to) {
  if constexpr (kCount > 0) {
    load_sums<kCount - 1>(from, to);
    to[kCount - 1] = hn::Load(Lanes(), from + (kCount - 1) * kVector);
  }
}
template <int kCount>
HWY_INLINE void store_sums(const Vec* from, std::uint16_t* to) {
  if constexpr (kCount > 0) {
    store_sums<kCount - 1>(from, to);
    hn::Store(from[kCount - 1], Lanes(), to + (kCount - 1) * kVector);
  }
}

#if HWY_ARCH_ARM_A64
/// A grey as it fills a vector of bytes fastest.
using Grey = std::uint8_t;
HWY_INLINE std::uint8_t* left_greys(SadScratch& s) { return s.left_bytes.data(); }
HWY_INLINE void copy_greys(const std::uint8_t* HWY_RESTRICT in, int count, Grey* HWY_RESTRICT out) {
  std::copy_n(in, count, out);
}
#else
/// A grey as it fills a vector of bytes fastest: four times.
using Grey = std::uint32_t;
HWY_INLINE std::uint32_t* left_greys(SadScratch& s) { return s.left_greys.data(); }
HWY_INLINE void copy_greys(const std::uint8_t* HWY_RESTRICT in, int count, Grey* HWY_RESTRICT out) {
  constexpr std::uint32_t kFour = 0x01010101;
  const hn::Rebind<std::uint8_t, Keys> bytes;
  constexpr int kStep = static_cast<int>(hn::MaxLanes(Keys()));
  const auto copy = [&](int i) HWY_ATTR {
    hn::StoreU(hn::Mul(hn::PromoteTo(Keys(), hn::LoadU(bytes, in + i)), hn::Set(Keys(), kFour)), Keys(), out + i);
  };
  int i = 0;
  for (; i + kStep <= count; i += kStep) copy(i);
  if (i == count) return;
  if (count >= kStep) return copy(count - kStep);
  for (; i < count; ++i) out[i] = in[i] * kFour;
}
#endif

/// The best lanes of a batch's pixels.
struct BatchBest {
  static constexpr int kKeys = kVector / 2;
  HWY_ALIGN std::uint32_t lanes[kSadPixelStep * kKeys];  ///< a vector of keys for each pixel
  HWY_ALIGN std::uint32_t keys[kSadPixelStep];           ///< the smallest of each

  template <bool kFirst>
  HWY_INLINE void offer(int pixel, KeyVec offered) {
    std::uint32_t* at = lanes + pixel * kKeys;
    if constexpr (!kFirst) offered = hn::Min(offered, hn::Load(Keys(), at));
    hn::Store(offered, Keys(), at);
  }

  /// Of the first `pixels`, rounded up to fours.
  HWY_INLINE void find(int pixels) {
    for (int j = 0; j < pixels; j += 4) {
      const auto vector = [&](int pixel) HWY_ATTR { return hn::Load(Keys(), lanes + (j + pixel) * kKeys); };
      hn::Store(smallest_of_each(vector(0), vector(1), vector(2), vector(3)), FourKeys(), keys + j);
    }
  }

  /// Ids from `pixel` on, as many as d has; those that are larger as kLargestId.
  static constexpr std::uint16_t kLargestId = 0x7FFF;
  using Eight = hn::Full128<std::uint16_t>;
  using Four = hn::Half<Eight>;
  [[nodiscard]] HWY_INLINE hn::Vec<Eight> ids(Eight d, int pixel) const { return narrow(d, pixel, pixel + 4); }
  [[nodiscard]] HWY_INLINE hn::Vec<Four> ids(Four /*d*/, int pixel) const {
    return hn::LowerHalf(narrow(Eight(), pixel, pixel));
  }

  template <class D, class V>
  [[nodiscard]] static HWY_INLINE V disparity(D d, V id, int smallest) {
    static_assert(kDisparityScale == 16);
    return hn::ShiftLeft<4>(hn::Add(id, hn::Set(d, static_cast<std::uint16_t>(smallest))));
  }

  /// The first `pixels` ids as disparities.
  HWY_INLINE void disparities(int smallest, int pixels, std::uint16_t* HWY_RESTRICT out) const {
    const auto write = [&](auto d, int j) HWY_ATTR { hn::StoreU(disparity(d, ids(d, j), smallest), d, out + j); };
    int j = 0;
    for (; j + 8 <= pixels; j += 8) write(Eight(), j);
    if (j + 4 <= pixels) {
      write(Four(), j);
      j += 4;
    }
    for (; j < pixels; ++j) out[j] = static_cast<std::uint16_t>((smallest + id(j)) * kDisparityScale);
  }

  [[nodiscard]] std::uint16_t id(int pixel) const { return static_cast<std::uint16_t>(keys[pixel]); }

 private:
  [[nodiscard]] HWY_INLINE hn::Vec<Eight> narrow(Eight eight, int first, int second) const {
    const FourKeys four;
    const hn::Repartition<std::int32_t, FourKeys> as_signed;
    const auto four_ids = [&](int pixel) HWY_ATTR {
      return hn::BitCast(as_signed, hn::And(hn::Load(four, keys + pixel), hn::Set(four, 0xFFFFU)));
    };
    // Vectors of 128 bits stay in order.
    return hn::BitCast(
        eight, hn::ReorderDemote2To(hn::Repartition<std::int16_t, FourKeys>(), four_ids(first), four_ids(second)));
  }
};

/// Which partners a pass meets.
enum class Partners {
  kAll,         ///< every lane has one
  kPadded,      ///< every lane that is not padding
  kSome,        ///< they are looked up
  kSomePadded,  ///< likewise, and there is padding
  kNone,        ///< no column enters
};
constexpr bool are_looked_up(Partners p) { return p == Partners::kSome || p == Partners::kSomePadded; }
constexpr bool are_padded(Partners p) { return p == Partners::kPadded || p == Partners::kSomePadded; }

/// kPairs: sums are kept twice as large, and bit 0 says in which half of its chunk a lane stands: then the smaller of
/// two lanes, one of each half, knows where it comes from. Where instructions for it are at hand and 16 bits hold it.
template <bool kPairs>
class SadLanes {
 public:
  SadLanes(const SadTask& task, SadScratch& scratch) noexcept
      : task_(task),
        s_(scratch),
        radius_(task.geometry.radius),
        block_(2 * radius_ + 1),
        layout_(task.geometry, task.wanted.box),
        lanes_(layout_.lanes),
        padding_(lanes_ - layout_.count),
        smallest_(task.geometry.range.min - padding_),
        columns_(layout_.columns),
        end_entering_(layout_.first_column + columns_ - radius_),
        all_exist_(padding_ == 0 && layout_.first_partner == 0 && layout_.end_partner == layout_.partners) {}

  [[nodiscard]] DisparityCounts run() noexcept {
    const Rect& box = task_.wanted.box;
    const int height = task_.left.height;
    const int first_row = std::max(box.top - radius_, 0);
    std::fill_n(s_.column_sums.data(), std::ptrdiff_t{before() + columns_} * lanes_, std::uint16_t{0});
    std::fill_n(s_.partner_exists.data(), layout_.partners, std::uint8_t{0});
    std::fill_n(s_.partner_exists.data() + layout_.first_partner, layout_.end_partner - layout_.first_partner,
                std::uint8_t{0xFF});
    const int end_clipped = std::clamp(radius_ - layout_.partner, 0, layout_.partners);
    std::fill_n(s_.partner_clips.data(), end_clipped, std::uint8_t{0xFF});
    std::fill_n(s_.partner_clips.data() + end_clipped, layout_.partners - end_clipped, std::uint8_t{0});
    std::fill_n(s_.right_greys.data(), layout_.partners, std::uint8_t{0});
    for (int x = box.left; x < box.right(); ++x) {
      const auto i = static_cast<std::size_t>(x - layout_.first_column);
      s_.limits[i] = WindowLimits(task_.geometry, x);
      rank(x, s_.limits[i]);
    }
    ranked_end_ = std::min(ranked_end_, end_entering_);
    for (int x = std::max(end_entering_, box.left); x < box.right(); ++x) {
      const WindowLimits& limits = s_.limits[static_cast<std::size_t>(x - layout_.first_column)];
      end_is_whole_ = end_is_whole_ && limits.first_whole == 0 && limits.end_whole == layout_.count;
    }
    // The first rows take the place of none; of other rows there were zeros.
    const int end_fresh = std::min(box.top + radius_, height);
    const std::ptrdiff_t row_size = std::ptrdiff_t{columns_} * lanes_;
    const int fresh = end_fresh - first_row;
    std::fill_n(s_.distances.data() + fresh * row_size, (block_ - fresh) * row_size, std::uint8_t{0});
    for (int y = first_row; y < end_fresh; ++y) {
      read_row(y);
      enter_columns<true>(0, columns_);
    }
    for (int y = box.top; y < box.bottom(); ++y) {
      read_row(y + radius_);
      match_row(y);
    }
    return counts_;
  }

 private:
  /// RankedKeys of a column, where it can have them; such columns stand side by side.
  void rank(int x, const WindowLimits& limits) noexcept {
    const BlockGeometry& g = task_.geometry;
    // In the leftmost columns the left picture's end clips windows, too: for partner_clips they are all clipped.
    const int end_whole =
        std::clamp(x - radius_ - g.offset + 1 - g.range.min, int{limits.first_whole}, int{limits.end});
    const int clipped = limits.end - end_whole;
    if (block_ > RankedKeys::kLargestBlock || limits.first != limits.first_whole || limits.first == limits.end ||
        clipped >= RankedKeys::kRanks) {
      return;
    }
    if (ranked_end_ != x) ranked_begin_ = x;
    ranked_end_ = x + 1;
    const auto i = static_cast<std::size_t>(x - layout_.first_column);
    RankedKeys& ranked = s_.ranked[i];
    ranked.lane = layout_.count - limits.end;
    for (int slot = 0; slot < RankedKeys::kRanks; ++slot) {
      const bool exists = slot < clipped;
      ranked.weights[slot] = exists ? RankedKeys::weight(g.columns(x, g.range.min + limits.end - 1 - slot)) : 0;
      ranked.ranks[slot] = exists ? static_cast<std::uint32_t>(clipped - slot) : ~0U;
    }
    s_.whole_weights[i] = end_whole == limits.first ? RankedKeys::kNoWeight : RankedKeys::weight(g.columns(x));
    s_.rank_zero[i] = static_cast<std::uint32_t>(end_whole - 1 + padding_);
  }

  /// Columns of zeros before the first.
  [[nodiscard]] int before() const { return radius_ + 1; }

  /// Sums of a chunk as keys carry the bit that is taken out here: (2 sum + upper) << 16 | id becomes
  /// 2 sum << 16 | id + upper * half a chunk, so that keys of several chunks are comparable.
  template <int kVectors, class D>
  static HWY_INLINE hn::Vec<D> comparable(D keys, hn::Vec<D> v) {
    if constexpr (kPairs && kVectors >= 2) {
      constexpr int kHalf = kVectors / 2 * kVector;
      static_assert(kHalf == kLaneStep || 2 * kHalf == kLaneStep);
      const auto upper = hn::And(v, hn::Set(keys, 0x10000U));
      return hn::Add(hn::Sub(v, upper), hn::ShiftRight < kHalf == kLaneStep ? 11 : 12 > (upper));
    } else {
      return v;
    }
  }

  /// Of a comparable key.
  [[nodiscard]] static std::uint32_t sum_of(std::uint32_t key) { return key >> (kPairs ? 17 : 16); }

  template <int kCount>
  static HWY_INLINE void mark_each(const Vec* marks, Vec* window) {
    if constexpr (kCount > 0) {
      mark_each<kCount - 1>(marks, window);
      window[kCount - 1] = hn::Or(window[kCount - 1], marks[kCount - 1]);
    }
  }

  /// What the passes over a chunk of lanes know.
  template <int kVectors>
  struct Chunk {
    Vec ids[kVectors];                             ///< d - range.min + padding, so that those of padding come first
    Vec marks[kVectors];                           ///< what a window's sum starts with
    hn::Vec<Bytes<kVectors> > partners[kVectors];  ///< 0 for padding; every second is used, where bytes take two

    HWY_INLINE Chunk(const LaneLayout& layout, int lane) {
      const Lanes lanes;
      const Bytes<kVectors> bytes;
      constexpr int kStep = static_cast<int>(hn::MaxLanes(Bytes<kVectors>())) / kVector;
      const Vec iota = hn::Iota(lanes, std::uint16_t{0});
      for (int k = 0; k < kVectors; ++k) {
        const Vec at = kInOrder<kVectors>
                           ? hn::Add(iota, hn::Set(lanes, static_cast<std::uint16_t>(k * kVector)))
                           : hn::Add(hn::Add(iota, hn::And(iota, hn::Set(lanes, 8))),
                                     hn::Set(lanes, static_cast<std::uint16_t>(k / 2 * 2 * kVector + k % 2 * 8)));
        ids[k] = hn::Sub(hn::Set(lanes, static_cast<std::uint16_t>(layout.lanes - 1 - lane)), at);
        const bool upper = kPairs && k < kVectors / 2;
        marks[k] = hn::Or(outside(ids[k], layout.lanes - layout.count, layout.count),
                          hn::Set(lanes, static_cast<std::uint16_t>(upper ? 1 : 0)));
      }
      for (int k = 0; k < kVectors; k += kStep) {
        const auto true_ones = static_cast<std::uint8_t>(std::clamp(layout.count - lane - k * kVector, 0, 255));
        partners[k] = hn::VecFromMask(bytes, hn::Lt(hn::Iota(bytes, std::uint8_t{0}), hn::Set(bytes, true_ones)));
      }
    }
  };

  /// The greys of the row that enters the window; outside the picture, equal ones that change no sum. Its distances
  /// take the place of those of the row that leaves.
  void read_row(int y) noexcept {
    slot_ = slot_ + 1 == block_ ? 0 : slot_ + 1;
    const int existing = layout_.end_partner - layout_.first_partner;
    std::uint8_t* right = s_.right_greys.data() + layout_.first_partner;
    if (y < task_.left.height) {
      copy_greys(task_.left.row(y) + layout_.first_column, columns_, left_greys(s_));
      std::copy_n(task_.right.row(y) + layout_.partner + layout_.first_partner, existing, right);
    } else {
      std::fill_n(left_greys(s_), columns_, Grey{0});
      std::fill_n(right, existing, std::uint8_t{0});
    }
  }

  /// Where a column and its partners stand. A copy by value: what lies behind pointers of pointers would be read again
  /// after each store.
  struct Column {
    const Grey* left;
    const std::uint8_t* right;
    const std::uint8_t* exists;
    const std::uint8_t* clips;
    std::uint8_t* distances;
    std::uint16_t* sums;
    std::ptrdiff_t stride;

    HWY_INLINE void advance() {
      ++left, ++right, ++exists, ++clips;
      distances += stride, sums += stride;
    }
  };

  [[nodiscard]] HWY_INLINE Column column(int i, int lane) const {
    const std::ptrdiff_t at = std::ptrdiff_t{i} + lane;
    return {left_greys(s_) + i,
            s_.right_greys.data() + at,
            s_.partner_exists.data() + at,
            s_.partner_clips.data() + at - radius_,
            s_.distances.data() + (std::ptrdiff_t{slot_} * columns_ + i) * lanes_ + lane,
            s_.column_sums.data() + std::ptrdiff_t{before() + i} * lanes_ + lane,
            lanes_};
  }
  /// The column that the window of pixel x loses.
  [[nodiscard]] HWY_INLINE const std::uint16_t* column_before(int x, int lane) const {
    return s_.column_sums.data() + std::ptrdiff_t{before() + x - radius_ - 1 - layout_.first_column} * lanes_ + lane;
  }

  /// Brings a column's sums to the new row and adds them to the window's. kFresh: no row leaves.
  template <int kVectors, Partners kPartners, bool kFresh = false>
  static HWY_INLINE void enter(const Column& at, const Chunk<kVectors>& chunk, Vec* window) {
    const Lanes lanes;
    const Bytes<kVectors> bytes;
    constexpr int kStep = static_cast<int>(hn::MaxLanes(Bytes<kVectors>())) / kVector;
    const auto left = hn::BitCast(bytes, hn::Set(hn::Repartition<Grey, Bytes<kVectors> >(), *at.left));
    constexpr int kBytes = kVectors / kStep;
    hn::Vec<Bytes<kVectors> > entering[kBytes];
    hn::Vec<Bytes<kVectors> > leaving[kBytes];
    load<kBytes>(bytes, at.right, entering);
    for (int i = 0; i < kBytes; ++i) entering[i] = distance(bytes, left, entering[i]);
    if constexpr (are_looked_up(kPartners)) {
      hn::Vec<Bytes<kVectors> > exists[kBytes];
      load<kBytes>(bytes, at.exists, exists);
      for (int i = 0; i < kBytes; ++i) entering[i] = hn::And(entering[i], exists[i]);
    }
    if constexpr (are_padded(kPartners)) {
      for (int i = 0; i < kBytes; ++i) entering[i] = hn::And(entering[i], chunk.partners[i * kStep]);
    }
    for (int i = 0; i < kBytes; ++i) entering[i] = ordered<kVectors>(entering[i]);
    if constexpr (kFresh) {
      for (int i = 0; i < kBytes; ++i) leaving[i] = hn::Zero(bytes);
    } else {
      load<kBytes>(bytes, at.distances, leaving);
    }
    for (int i = 0; i < kBytes; ++i) hn::StoreU(entering[i], bytes, at.distances + i * kStep * kVector);
    // Four at a time: neighbours are read and written in one instruction where there is such a one.
    constexpr int kFew = std::min(kVectors, 4);
    for (int k = 0; k < kVectors; k += kFew) {
      Vec sums[kFew];
      for (int i = 0; i < kFew; ++i) sums[i] = hn::Load(lanes, at.sums + (k + i) * kVector);
      for (int i = 0; i < kFew; i += kStep) {
        change<kVectors, kPairs>(entering[(k + i) / kStep], leaving[(k + i) / kStep], sums + i);
      }
      for (int i = 0; i < kFew; ++i) hn::Store(sums[i], lanes, at.sums + (k + i) * kVector);
      for (int i = 0; i < kFew; ++i) window[k + i] = hn::Add(window[k + i], sums[i]);
    }
  }

  template <int kVectors>
  static HWY_INLINE void leave(const std::uint16_t* gone, Vec* window) {
    for (int k = 0; k < kVectors; ++k) window[k] = hn::Sub(window[k], hn::Load(Lanes(), gone + k * kVector));
  }

  /// The smaller keys of each lane pair; not yet comparable.
  template <int kVectors>
  static HWY_INLINE KeyVec best_keys(const Chunk<kVectors>& chunk, const Vec* sums) {
    constexpr bool kHalves = kPairs && kVectors >= 2;
    constexpr int kFirst = kHalves ? kVectors / 2 : 0;
    const auto smaller = [&](int k) HWY_ATTR {
      if constexpr (kHalves) return hn::Min(sums[k - kFirst], sums[k]);
      return sums[k];
    };
    Vec smallest = smaller(kVectors - 1);
    Vec id = chunk.ids[kVectors - 1];
    for (int k = kVectors - 2; k >= kFirst; --k) keep_smaller(smallest, id, smaller(k), chunk.ids[k]);
    return keys_of(smallest, id);
  }

  /// Sums of a chunk, lanes in their order.
  template <int kVectors>
  static HWY_INLINE void store_in_order(const Vec* sums, std::uint16_t* to) {
    const Lanes lanes;
    for (int k = 0; k < kVectors; ++k) {
      if constexpr (kInOrder<kVectors>) {
        hn::Store(sums[k], lanes, to + k * kVector);
      } else {
        const hn::Half<Lanes> half;
        static_assert(kVectors * 16 == 2 * kLaneStep);
        std::uint16_t* at = to + k / 2 * 2 * kVector + k % 2 * 8;
        hn::Store(hn::LowerHalf(half, sums[k]), half, at);
        hn::Store(hn::UpperHalf(half, sums[k]), half, at + 16);
      }
    }
  }

  /// Moves the window to the next pixel, and finds the best keys of whole windows there. Where partners are looked up
  /// all sums are kept, too.
  template <int kVectors, Partners kPartners>
  static HWY_INLINE KeyVec step(Column& entering, const std::uint16_t*& gone, std::uint16_t*& kept,
                                const Chunk<kVectors>& chunk, Vec* window) {
    if constexpr (kPartners != Partners::kNone) enter<kVectors, kPartners>(entering, chunk, window);
    leave<kVectors>(gone, window);
    gone += entering.stride;
    if constexpr (are_looked_up(kPartners)) {
      store_in_order<kVectors>(window, kept);
      kept += entering.stride;
      Vec whole[kVectors];
      for (int k = 0; k < kVectors; ++k) whole[k] = window[k];
      exclude<kVectors>(entering.clips, whole);
      entering.advance();
      return best_keys<kVectors>(chunk, whole);
    } else {
      entering.advance();
      return best_keys<kVectors>(chunk, window);
    }
  }

  /// Lanes whose byte is 0xFF.
  template <int kVectors>
  static HWY_INLINE void exclude(const std::uint8_t* clips, Vec* sums) {
    const Bytes<kVectors> bytes;
    const Lanes lanes;
    if constexpr (kVectors == 1) {
      const hn::RebindToSigned<Lanes> as_signed;
      const auto wide = hn::PromoteTo(as_signed, hn::BitCast(hn::RebindToSigned<Bytes<1> >(), hn::LoadU(bytes, clips)));
      sums[0] = hn::Or(sums[0], hn::BitCast(lanes, wide));
    } else {
      constexpr int kStep = static_cast<int>(hn::MaxLanes(Bytes<kVectors>())) / kVector;
      static_assert(kStep == 2);
      hn::Vec<Bytes<kVectors> > vectors[kVectors / kStep];
      load<kVectors / kStep>(bytes, clips, vectors);
      for (int k = 0; k < kVectors; k += kStep) {
        const auto clipped = ordered<kVectors>(vectors[k / kStep]);
        sums[k] = hn::Or(sums[k], hn::BitCast(lanes, hn::InterleaveLower(bytes, clipped, clipped)));
        sums[k + 1] = hn::Or(sums[k + 1], hn::BitCast(lanes, hn::InterleaveUpper(bytes, clipped, clipped)));
      }
    }
  }

  /// Columns [begin, end) of the region.
  template <int kVectors, Partners kPartners, bool kFresh>
  HWY_INLINE void change_columns(int lane, int begin, int end) const {
    if (begin >= end) return;
    const Chunk<kVectors> chunk(layout_, lane);
    Column at = column(begin, lane);
    for (int i = begin; i < end; ++i, at.advance()) {
      Vec unused[kVectors];
      for (int k = 0; k < kVectors; ++k) unused[k] = hn::Zero(Lanes());
      enter<kVectors, kPartners, kFresh>(at, chunk, unused);
    }
  }
  template <bool kFresh>
  void enter_columns(int begin, int end) const {
    for_each_chunk(lanes_, [&](auto vectors, int lane, bool) {
      if (all_exist_) {
        change_columns<vectors(), Partners::kAll, kFresh>(lane, begin, end);
      } else {
        change_columns<vectors(), Partners::kSomePadded, kFresh>(lane, begin, end);
      }
    });
  }

  /// The window just left of the row's first pixel, and all columns that the row's windows do not reach.
  template <int kVectors, Partners kPartners>
  HWY_INLINE void start_row(int lane, Span span) const {
    const Chunk<kVectors> chunk(layout_, lane);
    const int begin = std::max(span.first - radius_, 0) - layout_.first_column;
    const int middle = std::min(span.first + radius_ - layout_.first_column, columns_);
    const int end = std::min(span.last + radius_ + 1 - layout_.first_column, columns_);
    change_columns<kVectors, kPartners, false>(lane, 0, begin);
    // The column before the first is what the first pixel's window loses; before the region's first stand zeros.
    Vec window[kVectors];
    load_sums<kVectors>(column_before(begin + radius_ + layout_.first_column, lane), window);
    mark_each<kVectors>(chunk.marks, window);
    Column at = column(begin, lane);
    for (int i = begin; i < middle; ++i, at.advance()) enter<kVectors, kPartners>(at, chunk, window);
    store_sums<kVectors>(window, s_.window_sums.data() + lane);
    change_columns<kVectors, kPartners, false>(lane, end, columns_);
  }

  /// Moves the window over `size` pixels, fours, from x on, where every disparity's window is whole, or has lost as
  /// many columns as the others (kNone). Where partners are looked up: where the right picture's left end clips some
  /// windows, whose sums are kept.
  template <int kVectors, Partners kPartners, bool kFirst>
  HWY_INLINE void slide(int lane, int x, int size, BatchBest& best) const {
    const Chunk<kVectors> chunk(layout_, lane);
    Vec window[kVectors];
    load_sums<kVectors>(s_.window_sums.data() + lane, window);
    Column entering = column(x + radius_ - layout_.first_column, lane);
    const std::uint16_t* gone = column_before(x, lane);
    std::uint16_t* kept = s_.batch_sums.data() + lane;
    for (int j = 0; j < size; j += 4) {
      KeyVec keys[4];
      for (int i = 0; i < 4; ++i) keys[i] = step<kVectors, kPartners>(entering, gone, kept, chunk, window);
      const FourKeys four;
      auto found = comparable<kVectors>(four, smallest_of_each(keys[0], keys[1], keys[2], keys[3]));
      if constexpr (!kFirst) found = hn::Min(found, hn::Load(four, best.keys + j));
      hn::Store(found, four, best.keys + j);
    }
    store_sums<kVectors>(window, s_.window_sums.data() + lane);
  }

  /// The same where anything may clip windows: all sums are kept, and only whole windows are offered.
  template <int kVectors, bool kFirst>
  HWY_INLINE void slide_clipped(int lane, int x, int size, BatchBest& best) const {
    const Chunk<kVectors> chunk(layout_, lane);
    Vec window[kVectors];
    load_sums<kVectors>(s_.window_sums.data() + lane, window);
    Column entering = column(x + radius_ - layout_.first_column, lane);
    const std::uint16_t* gone = column_before(x, lane);
    const std::ptrdiff_t stride = lanes_;
    const WindowLimits* limits = s_.limits.data() + (x - layout_.first_column);
    std::uint16_t* kept = s_.batch_sums.data() + lane;
    for (int j = 0; j < size; ++j, entering.advance(), gone += stride, kept += stride) {
      if (x + j < end_entering_) enter<kVectors, Partners::kSomePadded>(entering, chunk, window);
      leave<kVectors>(gone, window);
      store_in_order<kVectors>(window, kept);
      Vec whole[kVectors];
      for (int k = 0; k < kVectors; ++k) {
        const int whole_windows = limits[j].end_whole - limits[j].first_whole;
        whole[k] = hn::Or(window[k], outside(chunk.ids[k], limits[j].first_whole + padding_, whole_windows));
      }
      best.offer<kFirst>(j, comparable<kVectors>(Keys(), best_keys<kVectors>(chunk, whole)));
    }
    store_sums<kVectors>(window, s_.window_sums.data() + lane);
  }

  /// Of all lanes; kPadded is what the first chunk's are where there is padding.
  template <Partners kPartners, Partners kPadded>
  void slide_all(int x, int size) noexcept {
    BatchBest& best = best_;
    const bool padded = padding_ != 0;
    for_each_chunk(lanes_, [&](auto vectors, int lane, bool first) {
      if (!first) {
        slide<vectors(), kPartners, false>(lane, x, size, best);
      } else if (padded) {
        slide<vectors(), kPadded, true>(lane, x, size, best);
      } else {
        slide<vectors(), kPartners, true>(lane, x, size, best);
      }
    });
  }

  void match_clipped(int x, int size) noexcept {
    BatchBest& best = best_;
    for_each_chunk(lanes_, [&](auto vectors, int lane, bool first) {
      if (first) {
        slide_clipped<vectors(), true>(lane, x, size, best);
      } else {
        slide_clipped<vectors(), false>(lane, x, size, best);
      }
    });
    best.find(size);
    for (int j = 0; j < size; ++j) {
      best.keys[j] = choose(x + j, j);
      nones_ += best.keys[j] == kNoId ? 1 : 0;
    }
  }

  void match_ranked(int x, int size) noexcept {
    slide_all<Partners::kSome, Partners::kSomePadded>(x, size);
    for (int j = 0; j < size; j += 4) choose_four(x + j, j);
  }

  /// The best candidates of pixels x..x+3, the j-th and following of their batch, of those with whole windows and those
  /// without, where all four have RankedKeys.
  HWY_INLINE void choose_four(int x, int j) noexcept {
    const FourKeys four;
    const hn::Rebind<std::uint16_t, FourKeys> narrow;
    constexpr int kShift = kPairs ? 1 : 0;
    const std::size_t i = static_cast<std::size_t>(x - layout_.first_column);
    const RankedKeys* ranked = &s_.ranked[i];
    const auto clipped = [&](int pixel) HWY_ATTR {
      const RankedKeys& r = ranked[pixel];
      const std::uint16_t* sums = s_.batch_sums.data() + std::ptrdiff_t{j + pixel} * lanes_ + r.lane;
      const auto keys = [&](int slot) HWY_ATTR {
        const auto sum = hn::ShiftRight<kShift>(hn::PromoteTo(four, hn::LoadU(narrow, sums + slot)));
        return hn::Add(hn::Mul(sum, hn::Load(four, r.weights + slot)), hn::Load(four, r.ranks + slot));
      };
      return radius_ <= 4 ? keys(0) : hn::Min(keys(0), keys(4));
    };
    const auto whole = hn::LoadU(four, best_.keys + j);
    const auto whole_id = hn::And(whole, hn::Set(four, 0xFFFFU));
    const auto whole_key = hn::Mul(hn::ShiftRight<16 + kShift>(whole), hn::LoadU(four, s_.whole_weights.data() + i));
    const auto best = hn::Min(whole_key, smallest_of_each(clipped(0), clipped(1), clipped(2), clipped(3)));
    const auto rank = hn::And(best, hn::Set(four, RankedKeys::kRanks - 1U));
    const auto clipped_id = hn::Add(rank, hn::LoadU(four, s_.rank_zero.data() + i));
    hn::StoreU(hn::IfThenElse(hn::Eq(rank, hn::Zero(four)), whole_id, clipped_id), four, best_.keys + j);
  }

  /// The best candidate of pixel x, the j-th of its batch, likewise; any limits, and exact fractions.
  [[nodiscard]] std::uint32_t choose(int x, int j) const noexcept {
    const BlockGeometry& g = task_.geometry;
    const WindowLimits limits = s_.limits[static_cast<std::size_t>(x - layout_.first_column)];
    const std::uint16_t* sums = s_.batch_sums.data() + std::ptrdiff_t{j} * lanes_ + (layout_.count - 1);
    SadCandidate winner;
    const auto offer = [&](int id, std::uint32_t sum, int columns) {
      const SadCandidate candidate{id, sum, static_cast<std::uint32_t>(columns)};
      if (candidate.better_than(winner)) winner = candidate;
    };
    const auto offer_clipped = [&](int id) {
      offer(id, std::uint32_t{sums[-id]} >> (kPairs ? 1 : 0), g.columns(x, g.range.min + id));
    };
    // Rising disparities, so that of equals the smallest stays.
    for (int id = limits.first; id < limits.first_whole; ++id) offer_clipped(id);
    if (limits.first_whole < limits.end_whole) offer(best_.id(j) - padding_, sum_of(best_.keys[j]), g.columns(x));
    for (int id = limits.end_whole; id < limits.end; ++id) offer_clipped(id);
    return winner.disparity < 0 ? kNoId : static_cast<std::uint32_t>(winner.disparity + padding_);
  }

  void match_row(int y) noexcept {
    const Span span = task_.wanted.span(y);
    if (span.empty()) {
      enter_columns<false>(0, columns_);
      return;
    }
    for_each_chunk(lanes_, [&](auto vectors, int lane, bool) {
      if (all_exist_) {
        start_row<vectors(), Partners::kAll>(lane, span);
      } else {
        start_row<vectors(), Partners::kSomePadded>(lane, span);
      }
    });
    const int end_ranked = std::min(ranked_end_, span.last + 1);
    for (int x = span.first; x <= span.last;) {
      // What is left of the fours goes the general way.
      int size = layout_.batch(x, span.last, kSadPixelStep);
      nones_ = 0;
      if (layout_.is_inner(x) && size >= 4) {
        size = size / 4 * 4;
        slide_all<Partners::kAll, Partners::kPadded>(x, size);
      } else if (x >= end_entering_ && end_is_whole_ && size >= 4) {
        size = size / 4 * 4;
        slide_all<Partners::kNone, Partners::kNone>(x, size);
      } else if (x >= ranked_begin_ && end_ranked - x >= 4) {
        // The last four may have inner pixels, too.
        size = std::min((size + 3) / 4 * 4, (end_ranked - x) / 4 * 4);
        match_ranked(x, size);
      } else {
        if (x < ranked_begin_) size = std::min(size, ranked_begin_ - x);
        match_clipped(x, size);
      }
      if (task_.mask.empty()) {
        write_all(x, y, size);
      } else {
        write(x, y, size);
      }
      x += size;
    }
  }

  /// Of the batch's pixels those that are wanted.
  void write(int x, int y, int size) noexcept {
    const std::uint8_t* mask = task_.mask.row(y) + x;
    std::uint16_t* out = task_.out.row(y) + x;
    std::size_t wanted = 0;
    std::size_t border = 0;
    const auto write_some = [&](auto d, int j) HWY_ATTR {
      const hn::Rebind<std::uint8_t, decltype(d)> bytes;
      const auto found = best_.ids(d, j);
      const auto none = hn::Eq(found, hn::Set(d, BatchBest::kLargestId));
      const auto some = BatchBest::disparity(d, found, smallest_);
      const auto asked = hn::Ne(hn::PromoteTo(d, hn::LoadU(bytes, mask + j)), hn::Zero(d));
      const auto values = hn::IfThenElse(none, hn::Set(d, kNoDisparity), some);
      hn::StoreU(hn::IfThenElse(asked, values, hn::LoadU(d, out + j)), d, out + j);
      wanted += hn::CountTrue(d, asked);
      if (nones_ != 0) border += hn::CountTrue(d, hn::And(asked, none));
    };
    int j = 0;
    for (; j + 8 <= size; j += 8) write_some(BatchBest::Eight(), j);
    if (j + 4 <= size) {
      write_some(BatchBest::Four(), j);
      j += 4;
    }
    for (; j < size; ++j) {
      if (mask[j] == 0) continue;
      const bool none = best_.id(j) == kNoId;
      ++wanted;
      border += none ? 1 : 0;
      out[j] = none ? kNoDisparity : static_cast<std::uint16_t>((smallest_ + best_.id(j)) * kDisparityScale);
    }
    counts_.wanted += static_cast<std::int64_t>(wanted);
    counts_.border += static_cast<std::int64_t>(border);
    counts_.matched += static_cast<std::int64_t>(wanted - border);
  }

  /// The same where all are wanted.
  void write_all(int x, int y, int size) noexcept {
    std::uint16_t* out = task_.out.row(y) + x;
    best_.disparities(smallest_, size, out);
    counts_.wanted += size;
    counts_.matched += size - nones_;
    counts_.border += nones_;
    if (nones_ == 0) return;
    for (int j = 0; j < size; ++j) out[j] = best_.id(j) == kNoId ? kNoDisparity : out[j];
  }

  static constexpr std::uint32_t kNoId = 0xFFFF;

  const SadTask& task_;
  SadScratch& s_;
  int radius_;
  int block_;
  LaneLayout layout_;
  int lanes_;
  int padding_;   ///< of lanes_
  int smallest_;  ///< disparity of id 0, maybe of padding [px]
  int columns_;
  int end_entering_;          ///< from this pixel on no column enters the window
  bool all_exist_;            ///< each lane of each column has a partner
  bool end_is_whole_ = true;  ///< at the left picture's right end all windows of a pixel have as many columns
  int slot_ = -1;             ///< of distances, of the row that enters
  int ranked_begin_ = 0;      ///< pixels [begin, end) have RankedKeys
  int ranked_end_ = -1;
  int nones_ = 0;   ///< pixels of the batch without a candidate
  BatchBest best_;  ///< the batch's winners, ids as of Chunk; kNoId where there is no candidate
  DisparityCounts counts_;
};

DisparityCounts match_in_lanes(const SadTask& task, SadScratch& scratch) {
#if HWY_ARCH_X86 || HWY_ARCH_ARM_A64
  if (2 * task.geometry.radius + 1 <= kLargestPairedBlock) return SadLanes<true>(task, scratch).run();
#endif
  return SadLanes<false>(task, scratch).run();
}

#endif

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace stereotrack
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace stereotrack {

HWY_EXPORT(match_in_lanes);

SadScratch SadScratch::create(int width, int block, int disparities, Arena& arena) noexcept {
  const auto columns = static_cast<std::size_t>(width);
  const auto lanes = static_cast<std::size_t>(padded_lanes(disparities));
  SadScratch s;
  s.distances = arena.array<std::uint8_t>(static_cast<std::size_t>(block) * columns * lanes);
  s.column_sums = arena.array<std::uint16_t>((columns + static_cast<std::size_t>(block / 2) + 1) * lanes);
  s.window_sums = arena.array<std::uint16_t>(lanes);
  s.batch_sums = arena.array<std::uint16_t>(lanes * kSadPixelStep + kLaneStep);  // read in vectors
  s.reference_sums = arena.array<std::uint32_t>(lanes);
  s.limits = arena.array<WindowLimits>(columns);
  s.ranked = arena.array<RankedKeys>(columns);
  s.whole_weights = arena.array<std::uint32_t>(columns);
  s.rank_zero = arena.array<std::uint32_t>(columns);
  s.left_greys = arena.array<std::uint32_t>(columns);
  s.left_bytes = arena.array<std::uint8_t>(columns);
  s.right_greys = arena.array<std::uint8_t>(columns + lanes);
  s.partner_exists = arena.array<std::uint8_t>(columns + lanes);
  s.partner_clips = arena.array<std::uint8_t>(columns + lanes);
  return s;
}

DisparityCounts sad_lanes(const SadTask& task, SadScratch& scratch) noexcept {
  return HWY_DYNAMIC_DISPATCH(match_in_lanes)(task, scratch);
}

DisparityCounts sad_reference(const SadTask& task, SadScratch& scratch) noexcept {
  const BlockGeometry& g = task.geometry;
  const Rect& box = task.wanted.box;
  const int height = task.left.height;
  const int d_min = g.range.min;
  const int lanes = g.range.count();
  const int first_column = std::max(box.left - g.radius, 0);
  const int end_column = std::min(box.right() + g.radius, g.left_width);
  const int first_row = std::max(box.top - g.radius, 0);
  const auto column = [&](int x) { return scratch.column_sums.data() + std::ptrdiff_t{x - first_column} * lanes; };
  std::uint32_t* window = scratch.reference_sums.data();

  std::fill(column(first_column), column(end_column), std::uint16_t{0});
  const auto change_row = [&](int y, int sign) {
    for (int x = first_column; x < end_column; ++x) {
      for (int d = g.first(x); d <= g.last(x); ++d) {
        const int distance = std::abs(task.left.at(x, y) - task.right.at(x - d - g.offset, y));
        std::uint16_t& sum = column(x)[d - d_min];
        sum = static_cast<std::uint16_t>(sum + sign * distance);
      }
    }
  };
  const auto change_window = [&](int x, int sign) {
    for (int i = 0; i < lanes; ++i) window[i] += static_cast<std::uint32_t>(sign * column(x)[i]);
  };

  DisparityCounts counts;
  for (int y = first_row; y < std::min(box.top + g.radius, height); ++y) change_row(y, 1);
  for (int y = box.top; y < box.bottom(); ++y) {
    if (y + g.radius < height) change_row(y + g.radius, 1);
    if (y - g.radius - 1 >= first_row) change_row(y - g.radius - 1, -1);
    const Span span = task.wanted.span(y);
    if (span.empty()) continue;
    const int begin = std::max(span.first - g.radius, 0);
    std::fill_n(window, lanes, 0U);
    for (int x = begin; x < std::min(span.first + g.radius, g.left_width); ++x) change_window(x, 1);
    for (int x = span.first; x <= span.last; ++x) {
      if (x + g.radius < g.left_width) change_window(x + g.radius, 1);
      if (x - g.radius - 1 >= begin) change_window(x - g.radius - 1, -1);
      if (!is_wanted(task.mask, x, y)) continue;
      SadCandidate winner;
      for (int d = g.first(x); d <= g.last(x); ++d) {
        const SadCandidate candidate{d, window[d - d_min], static_cast<std::uint32_t>(g.columns(x, d))};
        if (candidate.better_than(winner)) winner = candidate;
      }
      ++counts.wanted;
      ++(winner.disparity < 0 ? counts.border : counts.matched);
      task.out.at(x, y) =
          winner.disparity < 0 ? kNoDisparity : static_cast<std::uint16_t>(winner.disparity * kDisparityScale);
    }
  }
  return counts;
}

}  // namespace stereotrack
#endif
