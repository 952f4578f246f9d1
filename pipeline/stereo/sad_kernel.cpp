#include "pipeline/stereo/sad_kernel.hpp"

#include <algorithm>
#include <cstdlib>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "pipeline/stereo/sad_kernel.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "pipeline/stereo/lanes-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace stereotrack {
namespace HWY_NAMESPACE {
namespace {

#if HWY_TARGET == HWY_SCALAR

DisparityCounts match_in_lanes(const SadTask& task, SadScratch& scratch) { return sad_reference(task, scratch); }

#else

HWY_INLINE Vec distance(Vec a, Vec b) {
#if HWY_ARCH_ARM
  return hn::Sub(hn::Max(a, b), hn::Min(a, b));  // one instruction there
#else
  const hn::RebindToSigned<Lanes> as_signed;
  return hn::BitCast(Lanes(), hn::Abs(hn::BitCast(as_signed, hn::Sub(a, b))));
#endif
}

/// A row of greys as lanes.
HWY_INLINE void widen(const std::uint8_t* HWY_RESTRICT in, int count, std::uint16_t* HWY_RESTRICT out) {
  const hn::Rebind<std::uint8_t, Lanes> bytes;
  int i = 0;
  for (; i + kVector <= count; i += kVector) {
    hn::StoreU(hn::PromoteTo(Lanes(), hn::LoadU(bytes, in + i)), Lanes(), out + i);
  }
  for (; i < count; ++i) out[i] = in[i];
}

/// What is asked of a batch of pixels.
enum class Batches {
  kInner,   ///< every disparity's window is whole
  kPadded,  ///< likewise, but some lanes are padding
  kBorder,  ///< windows are clipped
};

class SadLanes {
 public:
  SadLanes(const SadTask& task, SadScratch& scratch) noexcept
      : task_(task),
        s_(scratch),
        radius_(task.geometry.radius),
        layout_(task.geometry, task.wanted.box),
        lanes_(layout_.lanes),
        columns_(layout_.columns) {}

  [[nodiscard]] DisparityCounts run() noexcept {
    const Rect& box = task_.wanted.box;
    const int height = task_.left.height;
    const int first_row = std::max(box.top - radius_, 0);
    std::fill_n(s_.column_sums.data(), std::ptrdiff_t{columns_ + 1} * lanes_, std::uint16_t{0});
    std::fill_n(s_.partner_exists.data(), layout_.partners, std::uint16_t{0});
    std::fill_n(s_.partner_exists.data() + layout_.first_partner, layout_.end_partner - layout_.first_partner,
                std::uint16_t{0xFFFF});
    for (int i = 0; i < columns_; ++i) {
      s_.limits[static_cast<std::size_t>(i)] = WindowLimits(task_.geometry, layout_.first_column + i);
    }
    clear(s_.left_leaves, s_.right_leaves);
    clear(s_.left_enters, s_.right_enters);
    for (int y = first_row; y < std::min(box.top + radius_, height); ++y) {
      read_row(y, s_.left_enters, s_.right_enters);
      for_each_chunk(lanes_, [&](auto vectors, int lane, bool) { change_columns<vectors()>(lane, 0, columns_); });
    }
    for (int y = box.top; y < box.bottom(); ++y) {
      // Outside the picture, greys of 0 in both rows change no sum.
      if (y + radius_ < height) {
        read_row(y + radius_, s_.left_enters, s_.right_enters);
      } else {
        clear(s_.left_enters, s_.right_enters);
      }
      if (y - radius_ - 1 >= first_row) read_row(y - radius_ - 1, s_.left_leaves, s_.right_leaves);
      match_row(y);
    }
    return counts_;
  }

 private:
  void clear(std::span<std::uint16_t> left, std::span<std::uint16_t> right) const noexcept {
    std::fill_n(left.data(), columns_, std::uint16_t{0});
    std::fill_n(right.data(), layout_.partners, std::uint16_t{0});
  }

  void read_row(int y, std::span<std::uint16_t> left, std::span<std::uint16_t> right) const noexcept {
    widen(task_.left.row(y) + layout_.first_column, columns_, left.data());
    const std::ptrdiff_t partner = layout_.partner + layout_.first_partner;
    widen(task_.right.row(y) + partner, layout_.end_partner - layout_.first_partner,
          right.data() + layout_.first_partner);
  }

  /// Where a column and its partners stand. A copy by value: what lies behind pointers of pointers would be read again
  /// after each store.
  struct Column {
    const std::uint16_t* left_enters;
    const std::uint16_t* left_leaves;
    const std::uint16_t* right_enters;
    const std::uint16_t* right_leaves;
    const std::uint16_t* partner_exists;
    std::uint16_t* sums;
    std::ptrdiff_t stride;

    HWY_INLINE void advance() {
      ++left_enters, ++left_leaves, ++right_enters, ++right_leaves, ++partner_exists;
      sums += stride;
    }
  };

  [[nodiscard]] HWY_INLINE Column column(int i, int lane) const {
    const std::ptrdiff_t at = std::ptrdiff_t{i} + lane;
    return {s_.left_enters.data() + i,
            s_.left_leaves.data() + i,
            s_.right_enters.data() + at,
            s_.right_leaves.data() + at,
            s_.partner_exists.data() + at,
            s_.column_sums.data() + std::ptrdiff_t{i + 1} * lanes_ + lane,
            lanes_};
  }

  /// Brings a column's sums to the new row and adds them to the window's.
  template <int kVectors, bool kBorder>
  static HWY_INLINE void enter(const Column& column, Vec* window) {
    const Lanes lanes;
    const Vec grey_enters = hn::Set(lanes, *column.left_enters);
    const Vec grey_leaves = hn::Set(lanes, *column.left_leaves);
    for (int k = 0; k < kVectors; ++k) {
      Vec change = hn::Sub(distance(grey_enters, hn::LoadU(lanes, column.right_enters + k * kVector)),
                           distance(grey_leaves, hn::LoadU(lanes, column.right_leaves + k * kVector)));
      if constexpr (kBorder) change = hn::And(change, hn::LoadU(lanes, column.partner_exists + k * kVector));
      const Vec sum = hn::Add(hn::Load(lanes, column.sums + k * kVector), change);
      hn::Store(sum, lanes, column.sums + k * kVector);
      window[k] = hn::Add(window[k], sum);
    }
  }

  /// Columns [begin, end) of the region.
  template <int kVectors>
  HWY_INLINE void change_columns(int lane, int begin, int end) const {
    Vec unused[kVectors];
    for (int k = 0; k < kVectors; ++k) unused[k] = hn::Zero(Lanes());
    Column at = column(begin, lane);
    for (int i = begin; i < end; ++i, at.advance()) enter<kVectors, true>(at, unused);
  }

  /// The window just left of the row's first pixel, and all columns that the row's windows do not reach.
  template <int kVectors>
  HWY_INLINE void start_row(int lane, Span span) const {
    const Lanes lanes;
    const int begin = std::max(span.first - radius_, 0) - layout_.first_column;
    const int middle = std::min(span.first + radius_ - layout_.first_column, columns_);
    const int end = std::min(span.last + radius_ + 1 - layout_.first_column, columns_);
    change_columns<kVectors>(lane, 0, begin);
    // The column before the first is what the first pixel's window loses; before the region's first stand zeros.
    const std::uint16_t* before = s_.column_sums.data() + std::ptrdiff_t{begin} * lanes_ + lane;
    Vec window[kVectors];
    for (int k = 0; k < kVectors; ++k) window[k] = hn::Load(lanes, before + k * kVector);
    Column at = column(begin, lane);
    for (int i = begin; i < middle; ++i, at.advance()) enter<kVectors, true>(at, window);
    for (int k = 0; k < kVectors; ++k) hn::Store(window[k], lanes, s_.window_sums.data() + lane + k * kVector);
    change_columns<kVectors>(lane, end, columns_);
  }

  /// Moves the window over `size` pixels from x on and offers each lane's sum.
  template <int kVectors, Batches kBatches, bool kFirst>
  HWY_INLINE void slide(int lane, int x, int size, BatchBest& best) const {
    constexpr bool kBorder = kBatches == Batches::kBorder;
    const Lanes lanes;
    Vec window[kVectors];
    Vec ids[kVectors];
    Vec padding[kVectors];
    disparities_of<kVectors>(layout_.count, lane, ids);
    for (int k = 0; k < kVectors; ++k) {
      window[k] = hn::Load(lanes, s_.window_sums.data() + lane + k * kVector);
      if constexpr (kBatches == Batches::kPadded) padding[k] = outside(ids[k], 0, layout_.count);
    }
    Column entering = column(x + radius_ - layout_.first_column, lane);
    const std::uint16_t* gone =
        s_.column_sums.data() + std::ptrdiff_t{x - radius_ - layout_.first_column} * lanes_ + lane;
    const std::ptrdiff_t stride = lanes_;
    const int last_entering = columns_ - 1 - radius_ + layout_.first_column;
    const int first_leaving = layout_.first_column + radius_;
    const WindowLimits* limits = s_.limits.data() + (x - layout_.first_column);
    std::uint16_t* kept = s_.batch_sums.data() + lane;
    for (int j = 0; j < size; ++j, entering.advance(), gone += stride) {
      if (!kBorder || x + j <= last_entering) enter<kVectors, kBorder>(entering, window);
      if (!kBorder || x + j >= first_leaving) {
        for (int k = 0; k < kVectors; ++k) window[k] = hn::Sub(window[k], hn::Load(lanes, gone + k * kVector));
      }
      const auto sums = [&](int k) HWY_ATTR {
        if constexpr (kBorder)
          return hn::Or(window[k], outside(ids[k], limits[j].first_whole, limits[j].end_whole - limits[j].first_whole));
        if constexpr (kBatches == Batches::kPadded) return hn::Or(window[k], padding[k]);
        return window[k];
      };
      Vec smallest = sums(kVectors - 1);
      Vec id = ids[kVectors - 1];
      for (int k = kVectors - 2; k >= 0; --k) keep_smaller(smallest, id, sums(k), ids[k]);
      best.offer<kFirst>(j, keys_of(smallest, id));
      if constexpr (kBorder) {
        for (int k = 0; k < kVectors; ++k) hn::Store(window[k], lanes, kept + k * kVector);
        kept += stride;
      }
    }
    for (int k = 0; k < kVectors; ++k) hn::Store(window[k], lanes, s_.window_sums.data() + lane + k * kVector);
  }

  template <Batches kBatches>
  void slide_all(int x, int size, BatchBest& best) const noexcept {
    for_each_chunk(lanes_, [&](auto vectors, int lane, bool first) {
      if (first) {
        slide<vectors(), kBatches, true>(lane, x, size, best);
      } else {
        slide<vectors(), kBatches == Batches::kPadded ? Batches::kInner : kBatches, false>(lane, x, size, best);
      }
    });
  }

  /// The best candidate of pixel x, the j-th of its batch, of those with whole windows and those without.
  [[nodiscard]] HWY_INLINE int with_clipped(int x, int j, const BatchBest& best) const {
    const BlockGeometry& g = task_.geometry;
    const WindowLimits limits = s_.limits[static_cast<std::size_t>(x - layout_.first_column)];
    const std::uint16_t* sums = s_.batch_sums.data() + std::ptrdiff_t{j} * lanes_ + (layout_.count - 1);
    SadCandidate winner;
    // Rising disparities, so that of equals the smallest stays. No branches: which wins cannot be foretold.
    const auto offer = [&](int id, std::uint32_t sum, int columns) HWY_ATTR {
      const SadCandidate candidate{id, sum, static_cast<std::uint32_t>(columns)};
      const std::uint32_t takes = 0U - static_cast<std::uint32_t>(candidate.better_than(winner));
      winner.disparity ^= (winner.disparity ^ id) & static_cast<int>(takes);
      winner.sum ^= (winner.sum ^ sum) & takes;
      winner.columns ^= (winner.columns ^ candidate.columns) & takes;
    };
    const int d = g.range.min;
    for (int id = limits.first; id < limits.first_whole; ++id) offer(id, sums[-id], g.columns(x, d + id));
    if (limits.first_whole < limits.end_whole) offer(best.id(j), best.value(j), g.columns(x));
    for (int id = limits.end_whole; id < limits.end; ++id) offer(id, sums[-id], g.columns(x, d + id));
    return winner.disparity < 0 ? -1 : g.range.min + winner.disparity;
  }

  void match_row(int y) noexcept {
    const Span span = task_.wanted.span(y);
    if (span.empty()) {
      for_each_chunk(lanes_, [&](auto vectors, int lane, bool) { change_columns<vectors()>(lane, 0, columns_); });
      return;
    }
    for_each_chunk(lanes_, [&](auto vectors, int lane, bool) { start_row<vectors()>(lane, span); });
    std::uint16_t* out = task_.out.row(y);
    BatchBest& best = best_;
    for (int x = span.first; x <= span.last;) {
      const int size = layout_.batch(x, span.last);
      const bool inner = layout_.is_inner(x);
      if (!inner) {
        slide_all<Batches::kBorder>(x, size, best);
      } else if (layout_.count != lanes_) {
        slide_all<Batches::kPadded>(x, size, best);
      } else {
        slide_all<Batches::kInner>(x, size, best);
      }
      best.find(size);
      if (inner && task_.mask.empty()) {
        best.disparities(task_.geometry.range.min, size, out + x);
        counts_.wanted += size;
        counts_.matched += size;
      } else {
        write(x, y, size, inner, best);
      }
      x += size;
    }
  }

  void write(int x, int y, int size, bool inner, const BatchBest& best) noexcept {
    std::uint16_t* out = task_.out.row(y);
    for (int j = 0; j < size; ++j) {
      if (!is_wanted(task_.mask, x + j, y)) continue;
      const int d = inner ? task_.geometry.range.min + best.id(j) : with_clipped(x + j, j, best);
      ++counts_.wanted;
      ++(d < 0 ? counts_.border : counts_.matched);
      out[x + j] = d < 0 ? kNoDisparity : static_cast<std::uint16_t>(d * kDisparityScale);
    }
  }

  const SadTask& task_;
  SadScratch& s_;
  int radius_;
  LaneLayout layout_;
  int lanes_;
  int columns_;
  BatchBest best_{};
  DisparityCounts counts_;
};

DisparityCounts match_in_lanes(const SadTask& task, SadScratch& scratch) { return SadLanes(task, scratch).run(); }

#endif

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace stereotrack
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace stereotrack {

HWY_EXPORT(match_in_lanes);

SadScratch SadScratch::create(int width, int disparities, Arena& arena) noexcept {
  const auto columns = static_cast<std::size_t>(width);
  const auto lanes = static_cast<std::size_t>(padded_lanes(disparities));
  SadScratch s;
  s.column_sums = arena.array<std::uint16_t>((columns + 1) * lanes);
  s.window_sums = arena.array<std::uint16_t>(lanes);
  s.batch_sums = arena.array<std::uint16_t>(lanes * kPixelStep);
  s.reference_sums = arena.array<std::uint32_t>(lanes);
  s.limits = arena.array<WindowLimits>(columns);
  s.left_enters = arena.array<std::uint16_t>(columns);
  s.left_leaves = arena.array<std::uint16_t>(columns);
  s.right_enters = arena.array<std::uint16_t>(columns + lanes);
  s.right_leaves = arena.array<std::uint16_t>(columns + lanes);
  s.partner_exists = arena.array<std::uint16_t>(columns + lanes);
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
