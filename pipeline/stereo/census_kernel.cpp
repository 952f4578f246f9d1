#include "pipeline/stereo/census_kernel.hpp"

#include <algorithm>
#include <bit>
#include <cstdlib>
#include <iterator>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "pipeline/stereo/census_kernel.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "pipeline/stereo/lanes-inl.hpp"

#ifndef STEREOTRACK_CENSUS_KERNEL_COMMON
#define STEREOTRACK_CENSUS_KERNEL_COMMON
namespace stereotrack {

namespace {

constexpr std::uint16_t kNoCost = 0xFFFF;

/// One of the 24 neighbours whose order with the centre is a bit of the code.
struct Neighbour {
  std::int8_t x;
  std::int8_t y;
};

constexpr std::array<Neighbour, 24> kNeighbours = [] {
  std::array<Neighbour, 24> white{};
  std::size_t count = 0;
  for (int y = -3; y <= 3; ++y) {
    for (int x = -3; x <= 3; ++x) {
      if ((x + y) % 2 != 0) white[count++] = {static_cast<std::int8_t>(x), static_cast<std::int8_t>(y)};
    }
  }
  return white;
}();

/// Multiplied by it and shifted by 24, costs of up to 21 x 21 x 24 x 21 are divided by 1..21 exactly.
constexpr int kInverseBits = 24;
constexpr std::array<std::uint64_t, 22> kInverse = [] {
  std::array<std::uint64_t, 22> inverse{};
  for (std::size_t n = 1; n < inverse.size(); ++n) inverse[n] = (std::uint64_t{1} << kInverseBits) / n + 1;
  return inverse;
}();

/// Bit i is set where neighbour i is not darker than the centre. (Distances do not mind which way round.)
[[maybe_unused]] std::uint32_t census_code(const ImageView<const std::uint8_t>& picture, int x, int y) noexcept {
  const std::uint8_t centre = picture.at(x, y);
  std::uint32_t code = 0;
  for (std::size_t i = 0; i < kNeighbours.size(); ++i) {
    const int column = std::clamp(x + kNeighbours[i].x, 0, picture.width - 1);
    const int row = std::clamp(y + kNeighbours[i].y, 0, picture.height - 1);
    code |= static_cast<std::uint32_t>(picture.at(column, row) >= centre) << i;
  }
  return code;
}

[[maybe_unused]] std::uint32_t gradient(const std::uint8_t* row, int x, int width) noexcept {
  return static_cast<std::uint32_t>(std::abs(row[std::min(x + 1, width - 1)] - row[std::max(x - 1, 0)]));
}

/// The last step of both ways: the left-right check, once all pixels of the row have bid for their partners.
[[maybe_unused]] void check_row(const CensusTask& task, const CensusScratch& scratch, const LaneLayout& layout,
                                Span span, std::uint16_t* raw, DisparityCounts& counts) noexcept {
  const std::uint16_t* values = scratch.values.data() - layout.first_column;
  const std::uint16_t* ids = scratch.ids.data() - layout.first_column;
  const std::uint16_t* back = scratch.right_ids.data() + (layout.count - 1 - layout.first_column);
  const int limit = task.left_right_px;
  std::int32_t rejected = 0;
  for (int x = span.first; x <= span.last; ++x) {
    const std::uint16_t value = values[x];
    if (limit < 0 || value == kNoDisparity) {
      raw[x] = value;
      continue;
    }
    const int away = std::abs(back[x - ids[x]] - ids[x]);
    rejected += away > limit ? 1 : 0;
    raw[x] = away > limit ? kNoDisparity : value;
  }
  counts.left_right += rejected;
}

}  // namespace

}  // namespace stereotrack
#endif

HWY_BEFORE_NAMESPACE();
namespace stereotrack {
namespace HWY_NAMESPACE {
namespace {

#if HWY_TARGET == HWY_SCALAR

DisparityCounts match_in_lanes(const CensusTask& task, CensusScratch& scratch) {
  return census_reference(task, scratch);
}

#else

/// As many bytes as there are lanes in one or two vectors.
template <int kVectors>
using Bytes = hn::CappedTag<std::uint8_t, static_cast<std::size_t>(kVectors >= 2 ? 2 * kVector : kVector)>;

using PixelBytes = hn::CappedTag<std::uint8_t, static_cast<std::size_t>(kLaneStep)>;

/// Codes of columns [begin, end) of row y into planes that start with column begin; kLaneStep more cells may be
/// written.
HWY_INLINE void census_row(const ImageView<const std::uint8_t>& picture, int y, int begin, int end,
                           std::uint8_t* const (&planes)[3]) {
  const PixelBytes d;
  constexpr int kPixels = static_cast<int>(hn::MaxLanes(PixelBytes()));
  const auto one_by_one = [&](int from, int to) {
    for (int x = from; x < to; ++x) {
      const std::uint32_t code = census_code(picture, x, y);
      for (int plane = 0; plane < 3; ++plane) planes[plane][x - begin] = static_cast<std::uint8_t>(code >> (8 * plane));
    }
  };
  // Vectors must see seven whole columns; the last one is moved back to do so.
  const int last = picture.width - 3 - kPixels;
  const int inner_begin = std::clamp(3, begin, end);
  const int inner_end = std::clamp(picture.width - 3, inner_begin, end);
  if (last < inner_begin) {
    one_by_one(begin, end);
    return;
  }
  one_by_one(begin, inner_begin);
  one_by_one(inner_end, end);
  const std::uint8_t* rows[7];
  for (int j = 0; j < 7; ++j) rows[j] = picture.row(std::clamp(y + j - 3, 0, picture.height - 1));
  for (int next = inner_begin; next < inner_end; next += kPixels) {
    const int x = std::min(next, last);
    const auto centre = hn::LoadU(d, rows[3] + x);
    for (int plane = 0; plane < 3; ++plane) {
      auto code = hn::Zero(d);
      for (int bit = 0; bit < 8; ++bit) {
        const Neighbour at = kNeighbours[static_cast<std::size_t>(8 * plane + bit)];
        const auto neighbour = hn::LoadU(d, rows[at.y + 3] + x + at.x);
        const auto not_darker = hn::VecFromMask(d, hn::Eq(hn::Max(neighbour, centre), neighbour));
        code = hn::Or(code, hn::And(not_darker, hn::Set(d, static_cast<std::uint8_t>(1 << bit))));
      }
      hn::StoreU(code, d, planes[plane] + (x - begin));
    }
  }
}

class CensusLanes {
 public:
  CensusLanes(const CensusTask& task, CensusScratch& scratch) noexcept
      : task_(task),
        s_(scratch),
        radius_(task.geometry.radius),
        block_(2 * radius_ + 1),
        layout_(task.geometry, task.wanted.box),
        lanes_(layout_.lanes),
        stride_(lanes_ + kLaneStep) {}

  [[nodiscard]] DisparityCounts run() noexcept {
    const Rect& box = task_.wanted.box;
    const int height = task_.left.height;
    first_row_ = std::max(box.top - radius_, 0);
    std::fill_n(s_.column_sums.data(), std::ptrdiff_t{layout_.columns + 1} * lanes_, std::uint16_t{0});
    std::fill_n(s_.distances.data(), std::ptrdiff_t{block_} * layout_.columns * lanes_, std::uint8_t{0});
    std::fill_n(s_.gradient_sums.data(), layout_.columns, 0U);
    std::fill_n(s_.costs.data(), kPixelStep * std::ptrdiff_t{stride_} + kLaneStep, kNoCost);
    std::fill_n(s_.partner_exists.data(), layout_.partners, std::uint8_t{0});
    std::fill_n(s_.partner_exists.data() + layout_.first_partner, layout_.end_partner - layout_.first_partner,
                std::uint8_t{0xFF});
    std::fill_n(s_.no_partner.data(), layout_.partners, std::uint8_t{0});
    for (int i = 0; i < layout_.columns; ++i) {
      s_.limits[static_cast<std::size_t>(i)] = WindowLimits(task_.geometry, layout_.first_column + i);
    }
    for (int y = first_row_; y < std::min(box.top + radius_, height); ++y) {
      read_row(y);
      for_each_chunk(
          lanes_, [&](auto vectors, int lane, bool) HWY_ATTR { change_columns<vectors()>(lane, 0, layout_.columns); });
    }
    for (int y = box.top; y < box.bottom(); ++y) {
      read_row(y + radius_);
      match_row(y);
    }
    return counts_;
  }

 private:
  HWY_INLINE void add_gradients(int y, std::uint32_t sign) const {
    const int width = task_.left.width;
    const int first = layout_.first_column;
    const int end = first + layout_.columns;
    const std::uint8_t* HWY_RESTRICT row = task_.left.row(y);
    std::uint32_t* HWY_RESTRICT sums = s_.gradient_sums.data() - first;
    const int inner_begin = std::max(first, 1);
    const int inner_end = std::min(end, width - 1);
    if (first < inner_begin) sums[first] += sign * gradient(row, first, width);
    for (int x = inner_begin; x < inner_end; ++x) {
      sums[x] += sign * static_cast<std::uint32_t>(std::abs(row[x + 1] - row[x - 1]));
    }
    if (std::max(inner_end, inner_begin) < end) sums[end - 1] += sign * gradient(row, end - 1, width);
  }

  /// The row that enters the window takes the place of the one that leaves it.
  void read_row(int y) noexcept {
    enters_ = y < task_.left.height;
    slot_ = s_.distances.data() + std::ptrdiff_t{(y - first_row_) % block_} * layout_.columns * lanes_;
    if (y - block_ >= first_row_) add_gradients(y - block_, ~0U);
    if (!enters_) return;
    add_gradients(y, 1U);
    const int begin = layout_.first_column;
    census_row(task_.left, y, begin, begin + layout_.columns,
               {s_.left_codes[0].data() + kLaneStep, s_.left_codes[1].data() + kLaneStep,
                s_.left_codes[2].data() + kLaneStep});
    const int at = kLaneStep + layout_.first_partner;
    census_row(task_.right, y, layout_.partner + layout_.first_partner, layout_.partner + layout_.end_partner,
               {s_.right_codes[0].data() + at, s_.right_codes[1].data() + at, s_.right_codes[2].data() + at});
  }

  struct Column {
    const std::uint8_t* left;  ///< planes are `left_plane` apart
    std::ptrdiff_t left_plane;
    const std::uint8_t* right;
    std::ptrdiff_t right_plane;
    const std::uint8_t* exists;
    std::uint8_t* distances;
    std::uint16_t* sums;
    std::ptrdiff_t stride;

    HWY_INLINE void advance() {
      ++left, ++right, ++exists;
      distances += stride, sums += stride;
    }
  };

  [[nodiscard]] HWY_INLINE Column column(int i, int lane) const {
    const std::ptrdiff_t at = std::ptrdiff_t{i} + lane;
    return {s_.left_codes[0].data() + kLaneStep + i,
            s_.left_codes[1].data() - s_.left_codes[0].data(),
            s_.right_codes[0].data() + kLaneStep + at,
            s_.right_codes[1].data() - s_.right_codes[0].data(),
            (enters_ ? s_.partner_exists.data() : s_.no_partner.data()) + at,
            slot_ + std::ptrdiff_t{i} * lanes_ + lane,
            s_.column_sums.data() + std::ptrdiff_t{i + 1} * lanes_ + lane,
            lanes_};
  }

  /// Brings a column's sums to the new row and adds them to the window's.
  template <int kVectors, bool kBorder>
  static HWY_INLINE void enter(const Column& at, Vec* window) {
    const Bytes<kVectors> bytes;
    constexpr int kLanes = static_cast<int>(hn::MaxLanes(Bytes<kVectors>()));
    const auto left0 = hn::Set(bytes, at.left[0]);
    const auto left1 = hn::Set(bytes, at.left[at.left_plane]);
    const auto left2 = hn::Set(bytes, at.left[2 * at.left_plane]);
    for (int k = 0; k < kVectors; k += kLanes / kVector) {
      const std::uint8_t* right = at.right + k * kVector;
      const auto bits0 = hn::PopulationCount(hn::Xor(left0, hn::LoadU(bytes, right)));
      const auto bits1 = hn::PopulationCount(hn::Xor(left1, hn::LoadU(bytes, right + at.right_plane)));
      const auto bits2 = hn::PopulationCount(hn::Xor(left2, hn::LoadU(bytes, right + 2 * at.right_plane)));
      auto distance = hn::Add(hn::Add(bits0, bits1), bits2);
      if constexpr (kBorder) distance = hn::And(distance, hn::LoadU(bytes, at.exists + k * kVector));
      std::uint8_t* kept = at.distances + k * kVector;
      const auto change = hn::Sub(distance, hn::LoadU(bytes, kept));
      hn::StoreU(distance, bytes, kept);
      if constexpr (kLanes == kVector) {
        add<kVectors>(at, k, change, window);
      } else {
        const hn::Half<Bytes<kVectors> > half;
        add<kVectors>(at, k, hn::LowerHalf(half, change), window);
        add<kVectors>(at, k + 1, hn::UpperHalf(half, change), window);
      }
    }
  }

  template <int kVectors, class V8>
  static HWY_INLINE void add(const Column& at, int k, V8 change, Vec* window) {
    const Lanes lanes;
    const hn::RebindToSigned<Lanes> signed_lanes;
    const hn::Rebind<std::int8_t, Lanes> signed_bytes;
    const Vec wide = hn::BitCast(lanes, hn::PromoteTo(signed_lanes, hn::BitCast(signed_bytes, change)));
    const Vec sum = hn::Add(hn::Load(lanes, at.sums + k * kVector), wide);
    hn::Store(sum, lanes, at.sums + k * kVector);
    window[k] = hn::Add(window[k], sum);
  }

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
    const int middle = std::min(span.first + radius_ - layout_.first_column, layout_.columns);
    const int end = std::min(span.last + radius_ + 1 - layout_.first_column, layout_.columns);
    change_columns<kVectors>(lane, 0, begin);
    // The column before the first is what the first pixel's window loses; before the region's first stand zeros.
    const std::uint16_t* before = s_.column_sums.data() + std::ptrdiff_t{begin} * lanes_ + lane;
    Vec window[kVectors];
    for (int k = 0; k < kVectors; ++k) window[k] = hn::Load(lanes, before + k * kVector);
    Column at = column(begin, lane);
    for (int i = begin; i < middle; ++i, at.advance()) enter<kVectors, true>(at, window);
    for (int k = 0; k < kVectors; ++k) hn::Store(window[k], lanes, s_.window_sums.data() + lane + k * kVector);
    change_columns<kVectors>(lane, end, layout_.columns);
  }

  /// Cells of the j-th pixel of a batch.
  [[nodiscard]] HWY_INLINE std::uint16_t* costs(int j) const {
    return s_.costs.data() + kLaneStep + std::ptrdiff_t{j} * stride_;
  }

  /// Moves the window over `size` pixels from x on and leaves each lane's cost.
  template <int kVectors, bool kBorder, bool kFirst>
  HWY_INLINE void slide(int lane, int x, int size, BatchBest& best) const {
    const Lanes lanes;
    Vec window[kVectors];
    Vec ids[kVectors];
    disparities_of<kVectors>(layout_.count, lane, ids);
    for (int k = 0; k < kVectors; ++k) window[k] = hn::Load(lanes, s_.window_sums.data() + lane + k * kVector);
    const int i = x - layout_.first_column;
    Column entering = column(i + radius_, lane);
    const std::uint16_t* gone = s_.column_sums.data() + std::ptrdiff_t{i - radius_} * lanes_ + lane;
    std::uint16_t* kept = costs(0) + lane;
    const std::ptrdiff_t stride = lanes_;
    const std::ptrdiff_t cost_stride = stride_;
    const WindowLimits* limits = s_.limits.data() + i;
    const int last_entering = layout_.columns - 1 - radius_ - i;
    const int first_leaving = radius_ - i;
    const int count = layout_.count;
    for (int j = 0; j < size; ++j, entering.advance(), gone += stride, kept += cost_stride) {
      if (!kBorder || j <= last_entering) enter<kVectors, kBorder>(entering, window);
      if (!kBorder || j >= first_leaving) {
        for (int k = 0; k < kVectors; ++k) window[k] = hn::Sub(window[k], hn::Load(lanes, gone + k * kVector));
      }
      Vec smallest = hn::Set(lanes, kNoCost);
      Vec id = smallest;
      for (int k = kVectors - 1; k >= 0; --k) {
        Vec cost = window[k];
        if constexpr (kBorder) {
          cost = hn::Or(cost, outside(ids[k], limits[j].first, limits[j].end - limits[j].first));
        } else if constexpr (kFirst) {
          cost = hn::Or(cost, outside(ids[k], 0, count));
        }
        hn::Store(cost, lanes, kept + k * kVector);
        if constexpr (!kBorder) keep_smaller(smallest, id, cost, ids[k]);
      }
      if constexpr (!kBorder) best.offer<kFirst>(j, keys_of(smallest, id));
    }
    for (int k = 0; k < kVectors; ++k) hn::Store(window[k], lanes, s_.window_sums.data() + lane + k * kVector);
  }

  /// Clipped windows count as if they had all columns.
  HWY_INLINE void scale_clipped(int x, std::uint16_t* costs) const {
    const BlockGeometry& g = task_.geometry;
    const WindowLimits limits = s_.limits[static_cast<std::size_t>(x - layout_.first_column)];
    std::uint16_t* cost = costs + (layout_.count - 1);
    const auto scale = [cost, block = static_cast<std::uint64_t>(block_)](int id, std::uint64_t inverse) HWY_ATTR {
      cost[-id] = static_cast<std::uint16_t>((cost[-id] * block * inverse) >> kInverseBits);
    };
    const auto inverse = [](int columns) HWY_ATTR { return kInverse[static_cast<std::size_t>(columns)]; };
    const int d = g.range.min;
    for (int id = limits.first; id < limits.first_whole; ++id) scale(id, inverse(g.columns(x, d + id)));
    for (int id = limits.end_whole; id < limits.end; ++id) scale(id, inverse(g.columns(x, d + id)));
    if (g.columns(x) == block_) return;
    const std::uint64_t whole = inverse(g.columns(x));
    for (int id = limits.first_whole; id < limits.end_whole; ++id) scale(id, whole);
  }

  /// The best of costs that are in memory.
  HWY_INLINE void offer_costs(int size, BatchBest& best) const {
    const Lanes lanes;
    for (int j = 0; j < size; ++j) {
      const std::uint16_t* cost = costs(j);
      Vec smallest = hn::Set(lanes, kNoCost);
      Vec best_id = smallest;
      Vec id;
      for (int lane = lanes_ - kVector; lane >= 0; lane -= kVector) {
        disparities_of<1>(layout_.count, lane, &id);
        keep_smaller(smallest, best_id, hn::Load(lanes, cost + lane), id);
      }
      best.offer<true>(j, keys_of(smallest, best_id));
    }
  }

  /// Every pixel bids for its right partners, wanted or not, gated or not: of equals the smaller disparity, which is
  /// the left-most pixel.
  HWY_INLINE void bid(int x, int size) const {
    const Lanes lanes;
    const int begin = x - layout_.first_column;
    const Vec one = hn::Set(lanes, std::uint16_t{1});
    for (int at = 0; at < lanes_ + size - 1; at += kVector) {
      std::uint16_t* right_costs = s_.right_costs.data() + begin + at;
      std::uint16_t* right_ids = s_.right_ids.data() + begin + at;
      Vec best = hn::LoadU(lanes, right_costs);
      Vec best_id = hn::LoadU(lanes, right_ids);
      const int first = std::max(at - lanes_ + 1, 0);
      const int last = std::min(at + kVector - 1, size - 1);
      Vec id;
      disparities_of<1>(layout_.count, at - first, &id);
      const std::uint16_t* cost = costs(first) + (at - first);
      const std::ptrdiff_t step = stride_ - 1;
      for (int j = first; j <= last; ++j, cost += step, id = hn::Add(id, one)) {
        keep_smaller(best, best_id, hn::LoadU(lanes, cost), id);
      }
      hn::StoreU(best, lanes, right_costs);
      hn::StoreU(best_id, lanes, right_ids);
    }
  }

  /// A batch, in columns of a table so that loops over it become vectors.
  struct Pixels {
    HWY_ALIGN std::int32_t cost[kBatch];
    HWY_ALIGN std::int32_t id[kBatch];
    HWY_ALIGN std::int32_t before[kBatch];    ///< cost of the next smaller disparity
    HWY_ALIGN std::int32_t after[kBatch];     ///< and of the next larger
    HWY_ALIGN std::int32_t rival[kBatch];     ///< smallest cost elsewhere
    HWY_ALIGN std::int32_t shift[kBatch];     ///< sub-pixel [1/16 px]
    HWY_ALIGN std::int32_t gradient[kBatch];  ///< sum over the window
    HWY_ALIGN std::int32_t area[kBatch];      ///< of the window [px]
    HWY_ALIGN std::int32_t wanted[kBatch];    ///< 0 or 1
    HWY_ALIGN std::int32_t value[kBatch];     ///< disparity [1/16 px]
  };

  /// The costs around the best are taken out, so that the smallest of the rest is the rival.
  HWY_INLINE void find_rivals(int size, const BatchBest& best, BatchBest& rivals, Pixels& pixels) const {
    const Lanes lanes;
    const int last_id = layout_.count - 1;
    std::uint16_t* row = costs(0) + last_id;
    const std::ptrdiff_t stride = stride_;
    for (int j = 0; j < size; ++j, row += stride) {
      const std::uint32_t key = best.keys[j];
      pixels.id[j] = static_cast<int>(key & 0xFFFFU);
      pixels.cost[j] = static_cast<int>(key >> 16);
      // Without a candidate the id says nothing.
      std::uint16_t* cost = row - std::min(pixels.id[j], last_id);
      pixels.before[j] = cost[1];
      pixels.after[j] = cost[-1];
      cost[-1] = cost[0] = cost[1] = kNoCost;
    }
    for (int j = 0; j < size; ++j) {
      const std::uint16_t* cost = costs(j);
      Vec smallest = hn::Load(lanes, cost);
      for (int lane = kVector; lane < lanes_; lane += kVector) {
        smallest = hn::Min(smallest, hn::Load(lanes, cost + lane));
      }
      rivals.offer<true>(j, keys_of(smallest, smallest));
    }
    rivals.find(size);
    for (int j = 0; j < kBatch; ++j) pixels.rival[j] = static_cast<int>(rivals.keys[j] >> 16);
  }

  /// (before - after) 16 / (2 slope), rounded to the nearest, halves away from zero, by counting the half steps
  /// that it reaches: at most 8.
  HWY_INLINE void find_shifts(int size, Pixels& pixels) const {
    const hn::CappedTag<std::int32_t, static_cast<std::size_t>(kBatch)> d;
    for (int j = 0; j < size; j += static_cast<int>(hn::MaxLanes(d))) {
      const auto cost = hn::Load(d, pixels.cost + j);
      const auto before = hn::Load(d, pixels.before + j);
      const auto after = hn::Load(d, pixels.after + j);
      const auto slope = hn::Sub(hn::Max(before, after), cost);
      const auto difference = hn::Sub(before, after);
      auto left = hn::Sub(hn::ShiftLeft<4>(hn::Abs(difference)), slope);
      const auto step = hn::Add(slope, slope);
      auto shift = hn::Zero(d);
      for (int k = 0; k < kDisparityScale / 2; ++k) {
        // A reached step is a mask of ones: -1.
        shift = hn::Add(shift, hn::VecFromMask(d, hn::Lt(left, hn::Zero(d))));
        left = hn::Sub(left, step);
      }
      shift = hn::Add(shift, hn::Set(d, kDisparityScale / 2));
      const auto sign = hn::VecFromMask(d, hn::Lt(difference, hn::Zero(d)));
      shift = hn::Sub(hn::Xor(shift, sign), sign);
      const auto none = hn::Set(d, std::int32_t{kNoCost});
      const auto ends = hn::Or(hn::Or(hn::Eq(before, none), hn::Eq(after, none)), hn::Eq(difference, hn::Zero(d)));
      hn::Store(hn::IfThenZeroElse(ends, shift), d, pixels.shift + j);
    }
  }

  /// What the gates want to know of the windows.
  HWY_INLINE void describe(int x, int y, int size, Pixels& pixels) {
    const int rows = std::min(y + radius_, task_.left.height - 1) - std::max(y - radius_, 0) + 1;
    const int first = x - layout_.first_column;
    const int end = layout_.columns;
    const std::uint32_t* sums = s_.gradient_sums.data();
    std::uint32_t gradient = gradient_;
    for (int j = 0; j < size; ++j) {
      const int entering = first + j + radius_;
      const int leaving = first + j - radius_ - 1;
      if (entering < end) gradient += sums[entering];
      if (leaving >= first_gradient_) gradient -= sums[leaving];
      pixels.gradient[j] = static_cast<int>(gradient);
    }
    gradient_ = gradient;
    const bool inner = layout_.is_inner(x);
    for (int j = 0; j < size; ++j) pixels.area[j] = rows * (inner ? block_ : task_.geometry.columns(x + j));
    std::fill_n(pixels.wanted, kBatch, 0);
    for (int j = 0; j < size; ++j) pixels.wanted[j] = is_wanted(task_.mask, x + j, y) ? 1 : 0;
  }

  /// Gates, and the disparity of what passes them. All of the table, so that its length is known; the rest of it is
  /// not wanted.
  HWY_INLINE void judge(int x, int size, Pixels& pixels) {
    const int texture = task_.texture;
    const int uniqueness = 100 + task_.uniqueness;
    const int asks_rivals = task_.uniqueness > 0 ? 1 : 0;
    const int d_min = task_.geometry.range.min;
    int wanted = 0;
    int border = 0;
    int flat = 0;
    int ambiguous = 0;
    for (int j = 0; j < kBatch; ++j) {
      const int asked = pixels.wanted[j];
      const int exists = asked & static_cast<int>(pixels.cost[j] != kNoCost);
      const int textured = exists & static_cast<int>(pixels.gradient[j] * 16 >= texture * pixels.area[j]);
      const int rivalled = asks_rivals & static_cast<int>(pixels.rival[j] != kNoCost) &
                           static_cast<int>(pixels.rival[j] * 100 <= pixels.cost[j] * uniqueness);
      const int value = (pixels.id[j] + d_min) * kDisparityScale + pixels.shift[j];
      const int passes = textured & (1 - rivalled);
      pixels.value[j] = passes != 0 ? value : kNoDisparity;
      wanted += asked;
      border += asked - exists;
      flat += exists - textured;
      ambiguous += textured - passes;
    }
    counts_.wanted += wanted;
    counts_.border += border;
    counts_.texture += flat;
    counts_.uniqueness += ambiguous;
    std::uint16_t* HWY_RESTRICT values = s_.values.data() + (x - layout_.first_column);
    std::uint16_t* HWY_RESTRICT ids = s_.ids.data() + (x - layout_.first_column);
    for (int j = 0; j < size; ++j) values[j] = static_cast<std::uint16_t>(pixels.value[j]);
    for (int j = 0; j < size; ++j) ids[j] = static_cast<std::uint16_t>(pixels.id[j]);
  }

  template <bool kBorder>
  HWY_INLINE void slide_all(int x, int size, BatchBest& best) const {
    for_each_chunk(lanes_, [&](auto vectors, int lane, bool first) HWY_ATTR {
      if (first) {
        slide<vectors(), kBorder, true>(lane, x, size, best);
      } else {
        slide<vectors(), kBorder, false>(lane, x, size, best);
      }
    });
  }

  void match_row(int y) noexcept {
    std::uint16_t* raw = task_.raw.row(y);
    std::fill_n(raw + task_.wanted.box.left, task_.wanted.box.width, kNoDisparity);
    const Span span = task_.wanted.span(y);
    if (span.empty()) {
      for_each_chunk(
          lanes_, [&](auto vectors, int lane, bool) HWY_ATTR { change_columns<vectors()>(lane, 0, layout_.columns); });
      return;
    }
    for_each_chunk(lanes_, [&](auto vectors, int lane, bool) HWY_ATTR { start_row<vectors()>(lane, span); });
    first_gradient_ = std::max(span.first - radius_, 0) - layout_.first_column;
    gradient_ = 0;
    for (int i = first_gradient_; i < std::min(span.first + radius_ - layout_.first_column, layout_.columns); ++i) {
      gradient_ += s_.gradient_sums[static_cast<std::size_t>(i)];
    }
    const bool checks = task_.left_right_px >= 0;
    if (checks) std::fill_n(s_.right_costs.data(), layout_.partners, kNoCost);
    BatchBest& best = best_;
    BatchBest& rivals = rivals_;
    Pixels& pixels = pixels_;
    for (int x = span.first; x <= span.last;) {
      const int size = layout_.batch(x, span.last);
      // Where no row enters, distances are masked away as they are beside the borders.
      if (enters_ && layout_.is_inner(x)) {
        slide_all<false>(x, size, best);
      } else {
        slide_all<true>(x, size, best);
        for (int j = 0; j < size; ++j) scale_clipped(x + j, costs(j));
        offer_costs(size, best);
      }
      best.find(size);
      if (checks) bid(x, size);
      find_rivals(size, best, rivals, pixels);
      find_shifts(size, pixels);
      describe(x, y, size, pixels);
      judge(x, size, pixels);
      x += size;
    }
    check_row(task_, s_, layout_, span, raw, counts_);
  }

  const CensusTask& task_;
  CensusScratch& s_;
  int radius_;
  int block_;
  LaneLayout layout_;
  int lanes_;
  int stride_;  ///< of costs
  int first_row_ = 0;
  bool enters_ = false;
  std::uint8_t* slot_ = nullptr;  ///< of distances, of the row that enters
  int first_gradient_ = 0;
  std::uint32_t gradient_ = 0;  ///< of the window
  BatchBest best_{};
  BatchBest rivals_{};
  Pixels pixels_{};
  DisparityCounts counts_;
};

DisparityCounts match_in_lanes(const CensusTask& task, CensusScratch& scratch) {
  return CensusLanes(task, scratch).run();
}

#endif

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace stereotrack
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace stereotrack {

HWY_EXPORT(match_in_lanes);

CensusScratch CensusScratch::create(int width, int block, int disparities, Arena& arena) noexcept {
  const auto columns = static_cast<std::size_t>(width);
  const auto lanes = static_cast<std::size_t>(padded_lanes(disparities));
  const std::size_t partners = columns + lanes + kLaneStep;
  CensusScratch s;
  s.distances = arena.array<std::uint8_t>(static_cast<std::size_t>(block) * columns * lanes);
  s.column_sums = arena.array<std::uint16_t>((columns + 1) * lanes);
  s.window_sums = arena.array<std::uint16_t>(lanes);
  s.costs = arena.array<std::uint16_t>(kPixelStep * (lanes + kLaneStep) + kLaneStep);
  s.gradient_sums = arena.array<std::uint32_t>(columns);
  s.limits = arena.array<WindowLimits>(columns);
  // Planes lie one behind the other.
  const auto codes = [&](std::size_t length) {
    const std::span<std::uint8_t> all = arena.array<std::uint8_t>(3 * length);
    if (all.empty()) return Codes{};
    return Codes{all.first(length), all.subspan(length, length), all.last(length)};
  };
  s.left_codes = codes(columns + 2 * kLaneStep);
  s.right_codes = codes(partners + 2 * kLaneStep);
  s.partner_exists = arena.array<std::uint8_t>(partners);
  s.no_partner = arena.array<std::uint8_t>(partners);
  s.right_costs = arena.array<std::uint16_t>(partners);
  s.right_ids = arena.array<std::uint16_t>(partners);
  s.values = arena.array<std::uint16_t>(columns);
  s.ids = arena.array<std::uint16_t>(columns);
  s.reference_left = arena.array<std::uint32_t>(columns);
  s.reference_right = arena.array<std::uint32_t>(partners);
  return s;
}

DisparityCounts census_lanes(const CensusTask& task, CensusScratch& scratch) noexcept {
  return HWY_DYNAMIC_DISPATCH(match_in_lanes)(task, scratch);
}

namespace {

class CensusReference {
 public:
  CensusReference(const CensusTask& task, CensusScratch& scratch) noexcept
      : task_(task),
        s_(scratch),
        g_(task.geometry),
        block_(2 * g_.radius + 1),
        layout_(task.geometry, task.wanted.box),
        end_column_(layout_.first_column + layout_.columns) {}

  [[nodiscard]] DisparityCounts run() noexcept {
    const Rect& box = task_.wanted.box;
    const int height = task_.left.height;
    const int first_row = std::max(box.top - g_.radius, 0);
    std::fill(column(layout_.first_column), column(end_column_), std::uint16_t{0});
    std::fill_n(s_.gradient_sums.data(), layout_.columns, 0U);
    for (int y = first_row; y < std::min(box.top + g_.radius, height); ++y) change_row(y, 1);
    for (int y = box.top; y < box.bottom(); ++y) {
      if (y + g_.radius < height) change_row(y + g_.radius, 1);
      if (y - g_.radius - 1 >= first_row) change_row(y - g_.radius - 1, -1);
      match_row(y);
    }
    return counts_;
  }

 private:
  [[nodiscard]] std::uint16_t* column(int x) const noexcept {
    return s_.column_sums.data() + std::ptrdiff_t{x - layout_.first_column} * layout_.count;
  }

  void change_row(int y, int sign) noexcept {
    std::uint32_t* left = s_.reference_left.data() - layout_.first_column;
    std::uint32_t* right = s_.reference_right.data() - layout_.partner;
    for (int x = layout_.first_column; x < end_column_; ++x) left[x] = census_code(task_.left, x, y);
    const int end_right = layout_.partner + layout_.end_partner;
    for (int x = layout_.partner + layout_.first_partner; x < end_right; ++x) {
      right[x] = census_code(task_.right, x, y);
    }
    for (int x = layout_.first_column; x < end_column_; ++x) {
      std::uint32_t& gradients = s_.gradient_sums[static_cast<std::size_t>(x - layout_.first_column)];
      gradients += static_cast<std::uint32_t>(sign) * gradient(task_.left.row(y), x, g_.left_width);
      for (int d = g_.first(x); d <= g_.last(x); ++d) {
        std::uint16_t& sum = column(x)[d - g_.range.min];
        sum = static_cast<std::uint16_t>(sum + sign * std::popcount(left[x] ^ right[x - d - g_.offset]));
      }
    }
  }

  void change_window(int x, int sign) noexcept {
    std::uint16_t* window = s_.window_sums.data();
    const std::uint16_t* sums = column(x);
    for (int i = 0; i < layout_.count; ++i) window[i] = static_cast<std::uint16_t>(window[i] + sign * sums[i]);
    gradient_ +=
        static_cast<std::uint32_t>(sign) * s_.gradient_sums[static_cast<std::size_t>(x - layout_.first_column)];
  }

  void match_row(int y) noexcept {
    const Rect& box = task_.wanted.box;
    std::uint16_t* raw = task_.raw.row(y);
    std::fill_n(raw + box.left, box.width, kNoDisparity);
    const Span span = task_.wanted.span(y);
    if (span.empty()) return;
    std::fill_n(s_.window_sums.data(), layout_.count, std::uint16_t{0});
    std::fill_n(s_.right_costs.data(), layout_.partners, kNoCost);
    gradient_ = 0;
    const int begin = std::max(span.first - g_.radius, 0);
    for (int x = begin; x < std::min(span.first + g_.radius, g_.left_width); ++x) change_window(x, 1);
    for (int x = span.first; x <= span.last; ++x) {
      if (x + g_.radius < g_.left_width) change_window(x + g_.radius, 1);
      if (x - g_.radius - 1 >= begin) change_window(x - g_.radius - 1, -1);
      match(x, y);
    }
    check_row(task_, s_, layout_, span, raw, counts_);
  }

  [[nodiscard]] std::uint16_t smallest(int begin, int end) const noexcept {
    std::uint16_t result = kNoCost;
    for (int i = begin; i < end; ++i) result = std::min(result, s_.costs[static_cast<std::size_t>(i)]);
    return result;
  }

  void match(int x, int y) noexcept {
    const int first = g_.first(x) - g_.range.min;
    const int end = g_.last(x) - g_.range.min + 1;
    const int at = x - layout_.first_column;
    std::uint16_t& value = s_.values[static_cast<std::size_t>(at)];
    value = kNoDisparity;
    std::uint16_t* costs = s_.costs.data();
    for (int i = first; i < end; ++i) {
      const int columns = g_.columns(x, i + g_.range.min);
      costs[i] = static_cast<std::uint16_t>(s_.window_sums[static_cast<std::size_t>(i)] * block_ / columns);
      // Every pixel bids for its right partners, wanted or not, gated or not.
      const auto partner = static_cast<std::size_t>(at + layout_.count - 1 - i);
      if (costs[i] >= s_.right_costs[partner]) continue;
      s_.right_costs[partner] = costs[i];
      s_.right_ids[partner] = static_cast<std::uint16_t>(i);
    }
    if (!is_wanted(task_.mask, x, y)) return;
    ++counts_.wanted;
    if (first >= end) {
      ++counts_.border;
      return;
    }
    const std::uint16_t cost = smallest(first, end);
    int best = first;
    while (costs[best] != cost) ++best;
    const int rows = std::min(y + g_.radius, task_.left.height - 1) - std::max(y - g_.radius, 0) + 1;
    if (gradient_ * 16 < static_cast<std::uint32_t>(task_.texture * rows * g_.columns(x))) {
      ++counts_.texture;
      return;
    }
    if (task_.uniqueness > 0) {
      const int rival = std::min(smallest(first, best - 1), smallest(best + 2, end));
      if (rival != kNoCost && rival * 100 <= cost * (100 + task_.uniqueness)) {
        ++counts_.uniqueness;
        return;
      }
    }
    int sixteenths = (best + g_.range.min) * kDisparityScale;
    if (best > first && best + 1 < end) {
      const int before = costs[best - 1] - cost;
      const int after = costs[best + 1] - cost;
      const int slope = std::max(before, after);
      // Half a pixel is the most that the lines can say: |before - after| <= slope.
      if (slope > 0) {
        const int twice = (before - after) * kDisparityScale;
        sixteenths += (twice + (twice >= 0 ? slope : -slope)) / (2 * slope);
      }
    }
    value = static_cast<std::uint16_t>(sixteenths);
    s_.ids[static_cast<std::size_t>(at)] = static_cast<std::uint16_t>(best);
  }

  const CensusTask& task_;
  CensusScratch& s_;
  const BlockGeometry& g_;
  int block_;
  LaneLayout layout_;
  int end_column_;
  std::uint32_t gradient_ = 0;  ///< of the window
  DisparityCounts counts_;
};

}  // namespace

DisparityCounts census_reference(const CensusTask& task, CensusScratch& scratch) noexcept {
  return CensusReference(task, scratch).run();
}

}  // namespace stereotrack
#endif
