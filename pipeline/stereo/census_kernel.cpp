#include "pipeline/stereo/census_kernel.hpp"

#include <algorithm>
#include <bit>
#include <cstdlib>
#include <cstring>
#include <iterator>
#include <type_traits>
#include <utility>

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

/// A key: a cost and, in its low bits, which of kLaneStep disparities it belongs to. The smallest key is the smallest
/// cost and, of equals, the smallest disparity.
[[maybe_unused]] constexpr int kIdBits = 5;
static_assert(kLaneStep == 1 << kIdBits);
[[maybe_unused]] constexpr std::uint16_t kNoKey = 0xFFFF;
[[maybe_unused]] constexpr std::uint16_t kNoKeyCost = kNoKey >> kIdBits;
static_assert(kLargestCensusLaneBlock * kLargestCensusLaneBlock * 24 < kNoKeyCost);
static_assert(kLargestCensusLaneBlock * 24 <= 0xFF, "column sums are bytes");

[[maybe_unused]] constexpr std::ptrdiff_t code_cells(int length) noexcept {
  return std::ptrdiff_t{length + 3 * kLaneStep - 1} / kLaneStep * kLaneStep;
}

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

/// Multiplied by it and shifted, the cost of a window of so many columns becomes that of a whole one: divided exactly.
constexpr int kFactorBits = 17;
constexpr std::uint32_t factor_of(int block, int columns) noexcept {
  return static_cast<std::uint32_t>(block * (((1 << kFactorBits) + columns - 1) / columns));
}
constexpr bool factors_divide(int block) noexcept {
  for (int columns = 1; columns <= block; ++columns) {
    for (int cost = 0; cost <= 24 * block * columns; ++cost) {
      const std::uint32_t scaled = static_cast<std::uint32_t>(cost) * factor_of(block, columns) >> kFactorBits;
      if (scaled != static_cast<std::uint32_t>(cost * block / columns)) return false;
    }
  }
  return true;
}
static_assert(factors_divide(3) && factors_divide(5) && factors_divide(7) && factors_divide(9));
static_assert(kLargestCensusLaneBlock == 9);

/// Bit i is set where neighbour i is not darker than the centre. (Distances do not mind which way round.)
std::uint32_t census_code(const ImageView<const std::uint8_t>& picture, int x, int y) noexcept {
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

using PixelBytes = hn::CappedTag<std::uint8_t, static_cast<std::size_t>(2 * kLaneStep)>;

/// Codes lie in planes of bytes. Where bits of bytes can be counted, a byte holds 8 of them; else 4, whose distance
/// from four others is looked up.
#if HWY_TARGET == HWY_AVX3_DL || HWY_ARCH_ARM
constexpr int kPlanes = 3;
#else
constexpr int kPlanes = 6;
#endif
static_assert(kPlanes <= CensusScratch::kMostPlanes);
constexpr int kPlaneBits = static_cast<int>(kNeighbours.size()) / kPlanes;

/// [left][right]: of four bits each.
struct HammingTable {
  alignas(16) std::uint8_t rows[16][16];
};
constexpr HammingTable kHamming = [] {
  HammingTable table{};
  for (unsigned left = 0; left < 16; ++left) {
    for (unsigned right = 0; right < 16; ++right) {
      table.rows[left][right] = static_cast<std::uint8_t>(std::popcount(left ^ right));
    }
  }
  return table;
}();

/// Hamming distances of one left code from the right ones.
template <class D>
HWY_INLINE hn::Vec<D> hamming(D d, const std::uint8_t* left, std::ptrdiff_t left_plane, const std::uint8_t* right,
                              std::ptrdiff_t right_plane) {
  const auto of_plane = [&](int plane) HWY_ATTR {
    const auto codes = hn::LoadU(d, right + plane * right_plane);
    const std::uint8_t code = left[plane * left_plane];
    if constexpr (kPlaneBits == 8) {
      return hn::PopulationCount(hn::Xor(hn::Set(d, code), codes));
    } else {
      return hn::TableLookupBytes(hn::LoadDup128(d, kHamming.rows[code]), codes);
    }
  };
  auto distance = of_plane(0);
  for (int plane = 1; plane < kPlanes; ++plane) distance = hn::Add(distance, of_plane(plane));
  return distance;
}

/// Eight pixels' smallest lanes in one vector.
using FoldedPixels = hn::Full128<std::uint16_t>;
constexpr int kFoldedPixels = 8;

HWY_INLINE hn::Vec<FoldedPixels> fold_blocks(FoldedPixels /*tag*/, hn::Vec<FoldedPixels> v) { return v; }

template <class D>
HWY_INLINE hn::Vec<FoldedPixels> fold_blocks(D /*tag*/, hn::Vec<D> v) {
  const hn::Half<D> half;
  return fold_blocks(half, hn::Min(hn::LowerHalf(half, v), hn::UpperHalf(half, v)));
}

/// Lanes of two vectors are put side by side, in cells of T, and the smaller kept.
template <class T>
HWY_INLINE Vec smaller_of_both(Vec a, Vec b) {
  const Lanes lanes;
  const hn::Repartition<T, Lanes> cells;
  const auto a_cells = hn::BitCast(cells, a);
  const auto b_cells = hn::BitCast(cells, b);
  return hn::Min(hn::BitCast(lanes, hn::InterleaveLower(cells, a_cells, b_cells)),
                 hn::BitCast(lanes, hn::InterleaveUpper(cells, a_cells, b_cells)));
}

/// Codes of the pixels from `centre` on, a vector of them; `step` is the rows' distance.
template <std::size_t... kBit>
HWY_INLINE void census_codes(const std::uint8_t* centre, std::ptrdiff_t step, std::uint8_t* planes,
                             std::ptrdiff_t plane_step, std::index_sequence<kBit...> /*bits*/) {
  const PixelBytes d;
  const auto grey = hn::LoadU(d, centre);
  hn::Vec<PixelBytes> codes[kPlanes];
  for (auto& code : codes) code = hn::Zero(d);
  const auto add = [&](auto index) HWY_ATTR {
    constexpr Neighbour kAt = kNeighbours[index()];
    const auto neighbour = hn::LoadU(d, centre + kAt.y * step + kAt.x);
    const auto not_darker = hn::VecFromMask(d, hn::Eq(hn::Max(neighbour, grey), neighbour));
    auto& code = codes[index() / kPlaneBits];
    code = hn::Or(code, hn::And(not_darker, hn::Set(d, static_cast<std::uint8_t>(1 << (index() % kPlaneBits)))));
  };
  (add(std::integral_constant<std::size_t, kBit>()), ...);
  for (int plane = 0; plane < kPlanes; ++plane) hn::StoreU(codes[plane], d, planes + plane * plane_step);
}

/// Codes of columns [begin, end) of row y into planes that start with column begin; 2 kLaneStep more cells may be
/// written.
HWY_INLINE void census_row(const ImageView<const std::uint8_t>& picture, int y, int begin, int end,
                           std::uint8_t* planes, std::ptrdiff_t plane_step) {
  constexpr int kReach = 3;
  constexpr int kPixels = static_cast<int>(hn::MaxLanes(PixelBytes()));
  constexpr std::make_index_sequence<kNeighbours.size()> kBits;
  // Where a vector would see beyond the picture, it sees a copy that repeats the border.
  const int inner_begin = y < kReach || y >= picture.height - kReach ? end : std::clamp(kReach, begin, end);
  const int inner_end = std::max(picture.width - kReach - kPixels + 1, inner_begin);
  for (int x = begin; x < end;) {
    if (x >= inner_begin && x < inner_end) {
      census_codes(picture.row(y) + x, picture.stride, planes + (x - begin), plane_step, kBits);
      x += kPixels;
      continue;
    }
    constexpr int kWidth = kPixels + 2 * kReach;
    HWY_ALIGN std::uint8_t patch[2 * kReach + 1][kWidth];
    const int skipped = std::max(kReach - x, 0);
    const int from = std::max(x - kReach, 0);
    const int to = std::min(x - kReach + kWidth, picture.width);
    for (int j = 0; j <= 2 * kReach; ++j) {
      const std::uint8_t* row = picture.row(std::clamp(y + j - kReach, 0, picture.height - 1));
      std::uint8_t* at = std::fill_n(patch[j], skipped, row[0]);
      at = std::copy(row + from, row + to, at);
      std::fill(at, std::end(patch[j]), row[picture.width - 1]);
    }
    census_codes(&patch[kReach][kReach], kWidth, planes + (x - begin), plane_step, kBits);
    x += kPixels;
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
        groups_(lanes_ / kLaneStep),
        left_plane_(code_cells(layout_.columns)),
        right_plane_(code_cells(layout_.partners)) {}

  [[nodiscard]] DisparityCounts run() noexcept {
    const Rect& box = task_.wanted.box;
    first_row_ = std::max(box.top - radius_, 0);
    std::fill_n(s_.keys.data(), kVector + std::ptrdiff_t{groups_ + 2} * kGroupStride, kNoKey);
    std::fill_n(s_.gradient_sums.data(), layout_.columns + 2 * kLaneStep, std::uint16_t{0});
    std::fill_n(s_.partner_exists.data(), layout_.partners, std::uint8_t{0});
    std::fill_n(s_.partner_exists.data() + layout_.first_partner, layout_.end_partner - layout_.first_partner,
                std::uint8_t{0xFF});
    std::fill_n(s_.no_partner.data(), layout_.partners, std::uint8_t{0});
    std::fill_n(s_.partner_missing.data(), layout_.partners, kNoKey);
    std::fill_n(s_.partner_missing.data() + layout_.first_partner, layout_.end_partner - layout_.first_partner,
                std::uint16_t{0});
    for (int columns = 1; columns <= block_; ++columns) factors_[columns] = factor_of(block_, columns);
    for (int p = 0; p < 2 * kEdge; ++p) by_partner_[p] = factors_[std::min(p + radius_ + 1, block_)];
    for (int i = 0; i < layout_.columns; ++i) {
      s_.limits[static_cast<std::size_t>(i)] = WindowLimits(task_.geometry, layout_.first_column + i);
    }
    start(std::min(box.top + radius_, task_.left.height));
    for (int y = box.top; y < box.bottom(); ++y) {
      read_row(y + radius_);
      match_row(y);
    }
    return counts_;
  }

 private:
  /// Of the keys: a pixel's 32 disparities of a group, and room beside them that no bid comes from.
  static constexpr int kKeyStride = kLaneStep + kVector;
  static constexpr int kGroupStride = kBatch * kKeyStride;
  static constexpr int kEdge = kLargestCensusLaneBlock / 2;
  static_assert(kKeyStride <= CensusScratch::kMostKeyStride);

  /// Vectors of bytes that hold as many lanes as kVectors of 16 bits.
  template <int kVectors>
  static constexpr int kByteVectors = kVectors* kVector / static_cast<int>(hn::MaxLanes(Bytes<kVectors>()));

  [[nodiscard]] int slot_of(int y) const { return (y - first_row_) % block_; }
  [[nodiscard]] std::uint8_t* distances_of(int y) const {
    return s_.distances.data() + std::ptrdiff_t{slot_of(y)} * layout_.columns * lanes_;
  }
  [[nodiscard]] std::uint8_t* left_codes_of(int y) const {
    return s_.left_codes.data() + std::ptrdiff_t{slot_of(y)} * kPlanes * left_plane_;
  }
  [[nodiscard]] std::uint8_t* right_codes_of(int y) const {
    return s_.right_codes.data() + std::ptrdiff_t{slot_of(y)} * kPlanes * right_plane_;
  }

  void read_codes(int y) const {
    const int begin = layout_.first_column;
    census_row(task_.left, y, begin, begin + layout_.columns, left_codes_of(y), left_plane_);
    census_row(task_.right, y, layout_.partner + layout_.first_partner, layout_.partner + layout_.end_partner,
               right_codes_of(y) + layout_.first_partner, right_plane_);
  }

  /// A row enters the windows, or leaves them.
  template <bool kEnters>
  HWY_INLINE void add_gradients(int y) const {
    const int width = task_.left.width;
    const std::uint8_t* HWY_RESTRICT row = task_.left.row(y);
    const int begin = layout_.first_column;
    const int end = begin + layout_.columns;
    std::uint16_t* HWY_RESTRICT sums = s_.gradient_sums.data() + kLaneStep - begin;
    const auto change = [](std::uint16_t& sum, std::uint32_t by)
                            HWY_ATTR { sum = static_cast<std::uint16_t>(kEnters ? sum + by : sum - by); };
    const int inner_begin = std::max(begin, 1);
    const int inner_end = std::min(end, width - 1);
    if (begin < inner_begin) change(sums[begin], gradient(row, begin, width));
    for (int x = inner_begin; x < inner_end; ++x) {
      change(sums[x], static_cast<std::uint32_t>(std::abs(row[x + 1] - row[x - 1])));
    }
    if (std::max(inner_end, inner_begin) < end) change(sums[end - 1], gradient(row, end - 1, width));
  }

  struct Column {
    const std::uint8_t* left;  ///< planes are `left_plane` apart
    std::ptrdiff_t left_plane;
    const std::uint8_t* right;
    std::ptrdiff_t right_plane;
    const std::uint8_t* exists;
    std::uint8_t* distances;
    std::uint8_t* sums;
    std::ptrdiff_t stride;

    HWY_INLINE void advance() {
      ++left, ++right, ++exists;
      distances += stride, sums += stride;
    }

    template <int kVectors, bool kBorder>
    HWY_INLINE void measure(hn::Vec<Bytes<kVectors> >* result) const {
      const Bytes<kVectors> bytes;
      for (int k = 0; k < kByteVectors<kVectors>; ++k) {
        const int at = k * static_cast<int>(hn::MaxLanes(Bytes<kVectors>()));
        result[k] = hamming(bytes, left, left_plane, right + at, right_plane);
        if constexpr (kBorder) result[k] = hn::And(result[k], hn::LoadU(bytes, exists + at));
      }
    }
  };

  [[nodiscard]] HWY_INLINE std::uint8_t* sums_of(int i, int lane) const {
    return s_.column_sums.data() + std::ptrdiff_t{i + 1} * lanes_ + lane;
  }

  /// As row y meets it.
  [[nodiscard]] HWY_INLINE Column column(int y, int i, int lane) const {
    const std::ptrdiff_t at = std::ptrdiff_t{i} + lane;
    const bool exists = y < task_.left.height;
    return {left_codes_of(y) + i,
            left_plane_,
            right_codes_of(y) + at,
            right_plane_,
            (exists ? s_.partner_exists.data() : s_.no_partner.data()) + at,
            distances_of(y) + std::ptrdiff_t{i} * lanes_ + lane,
            sums_of(i, lane),
            lanes_};
  }

  /// The rows over the first one's own, up to `end`: column by column, so that a sum is written once.
  void start(int end) noexcept {
    for (int y = first_row_; y < end; ++y) {
      read_codes(y);
      add_gradients<true>(y);
    }
    std::fill_n(s_.column_sums.data(), lanes_, std::uint8_t{0});
    // Rows that were not there leave nothing.
    const std::ptrdiff_t row = std::ptrdiff_t{layout_.columns} * lanes_;
    std::fill_n(s_.distances.data() + (end - first_row_) * row, (block_ - (end - first_row_)) * row, std::uint8_t{0});
    for_each_chunk(lanes_, [&](auto vectors, int lane, bool) HWY_ATTR { start_columns<vectors()>(end, lane); });
  }

  template <int kVectors>
  HWY_INLINE void start_columns(int end, int lane) const {
    const Bytes<kVectors> bytes;
    constexpr int kLanes = static_cast<int>(hn::MaxLanes(Bytes<kVectors>()));
    const std::ptrdiff_t row = std::ptrdiff_t{layout_.columns} * lanes_;
    const Span range = with_partners(0, layout_.columns, lane, kVectors * kVector);
    const auto nothing = [&](int first, int last) HWY_ATTR {
      for (int i = first; i < last; ++i) {
        for (int k = 0; k < kByteVectors<kVectors>; ++k)
          hn::StoreU(hn::Zero(bytes), bytes, sums_of(i, lane) + k * kLanes);
      }
    };
    nothing(0, std::min(range.first, layout_.columns));
    nothing(std::max(range.last + 1, 0), layout_.columns);
    for (int i = range.first; i <= range.last; ++i) {
      Column at = column(first_row_, i, lane);
      hn::Vec<Bytes<kVectors> > sums[kByteVectors<kVectors>];
      for (auto& sum : sums) sum = hn::Zero(bytes);
      for (int y = first_row_; y < end; ++y) {
        hn::Vec<Bytes<kVectors> > distances[kByteVectors<kVectors>];
        at.template measure<kVectors, true>(distances);
        for (int k = 0; k < kByteVectors<kVectors>; ++k) {
          hn::StoreU(distances[k], bytes, at.distances + k * kLanes);
          sums[k] = hn::Add(sums[k], distances[k]);
        }
        at.left += kPlanes * left_plane_, at.right += kPlanes * right_plane_;
        at.distances += row;
      }
      for (int k = 0; k < kByteVectors<kVectors>; ++k) hn::StoreU(sums[k], bytes, at.sums + k * kLanes);
    }
  }

  /// The row that enters the window takes the place of the one that leaves it.
  void read_row(int y) noexcept {
    entering_ = y;
    enters_ = y < task_.left.height;
    if (y - block_ >= first_row_) add_gradients<false>(y - block_);
    if (!enters_) return;
    add_gradients<true>(y);
    read_codes(y);
  }

  /// Brings a column's sums to the new row.
  template <int kVectors, bool kBorder>
  static HWY_INLINE void enter(const Column& at, Vec* sums) {
    const Lanes lanes;
    const Bytes<kVectors> bytes;
    constexpr int kLanes = static_cast<int>(hn::MaxLanes(Bytes<kVectors>()));
    hn::Vec<Bytes<kVectors> > distances[kByteVectors<kVectors>];
    at.template measure<kVectors, kBorder>(distances);
    for (int k = 0; k < kByteVectors<kVectors>; ++k) {
      std::uint8_t* kept = at.distances + k * kLanes;
      std::uint8_t* summed = at.sums + k * kLanes;
      const auto change = hn::Sub(distances[k], hn::LoadU(bytes, kept));
      const auto sum = hn::Add(hn::LoadU(bytes, summed), change);
      hn::StoreU(distances[k], bytes, kept);
      hn::StoreU(sum, bytes, summed);
      if constexpr (kLanes == kVector) {
        sums[k] = hn::PromoteTo(lanes, sum);
      } else {
        const hn::Half<Bytes<kVectors> > half;
        sums[2 * k] = hn::PromoteTo(lanes, hn::LowerHalf(half, sum));
        sums[2 * k + 1] = hn::PromoteTo(lanes, hn::UpperHalf(half, sum));
      }
    }
  }

  template <int kVectors>
  HWY_INLINE void change_columns(int lane, int begin, int end) const {
    Vec unused[kVectors];
    const Span range = with_partners(begin, end, lane, kVectors * kVector);
    Column at = column(entering_, range.first, lane);
    for (int i = range.first; i <= range.last; ++i, at.advance()) enter<kVectors, true>(at, unused);
  }

  static HWY_INLINE Vec load_sums(const std::uint8_t* sums) {
    return hn::PromoteTo(Lanes(), hn::LoadU(hn::Rebind<std::uint8_t, Lanes>(), sums));
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
    Vec sums[kVectors];
    for (int k = 0; k < kVectors; ++k) sums[k] = load_sums(sums_of(begin - 1, lane) + k * kVector);
    const Span range = with_partners(begin, middle, lane, kVectors * kVector);
    Column at = column(entering_, range.first, lane);
    for (int i = range.first; i <= range.last; ++i, at.advance()) {
      Vec more[kVectors];
      enter<kVectors, true>(at, more);
      for (int k = 0; k < kVectors; ++k) sums[k] = hn::Add(sums[k], more[k]);
    }
    for (int k = 0; k < kVectors; ++k) {
      const int id = kLaneStep - 1 - k * kVector % kLaneStep;
      const Vec ids = hn::Sub(hn::Set(lanes, static_cast<std::uint16_t>(id)), hn::Iota(lanes, std::uint16_t{0}));
      hn::Store(hn::Or(hn::ShiftLeft<kIdBits>(sums[k]), ids), lanes, s_.window.data() + lane + k * kVector);
    }
    change_columns<kVectors>(lane, end, layout_.columns);
  }

  /// A group's keys of the j-th pixel of a batch. Groups -1 and groups_ are there, too, and hold nothing.
  [[nodiscard]] HWY_INLINE std::uint16_t* keys(int group, int j) const {
    return s_.keys.data() + kVector + std::ptrdiff_t{group + 1} * kGroupStride + std::ptrdiff_t{j} * kKeyStride;
  }

  /// Which lanes of a pixel stand for no candidate.
  enum class Gaps : std::uint8_t { kNone, kPadding, kBorder };

  /// Moves the window over `size` pixels from x on and leaves each lane's key.
  template <int kVectors, Gaps kGaps>
  HWY_INLINE void slide(int lane, int x, int size) const {
    const Lanes lanes;
    constexpr bool kBorder = kGaps == Gaps::kBorder;
    const int i = x - layout_.first_column;
    // Columns without partners are not there.
    const Span there = with_partners(0, layout_.columns, lane, kVectors * kVector);
    const int first_entering = there.first - radius_ - i;
    const int last_entering = there.last - radius_ - i;
    Vec window[kVectors];
    Vec ids[kVectors];
    Vec padding[kVectors];
    disparities_of<kVectors>(layout_.count, lane, ids);
    for (int k = 0; k < kVectors; ++k) {
      window[k] = hn::Load(lanes, s_.window.data() + lane + k * kVector);
      padding[k] = outside(ids[k], 0, layout_.count);
    }
    Column entering = column(entering_, i + radius_, lane);
    // Before the region's first column stand zeros.
    int before_first = kBorder ? std::max(radius_ - i, 0) : 0;
    const std::uint8_t* leaving = sums_of(kBorder ? std::max(i - radius_ - 1, -1) : i - radius_ - 1, lane);
    std::uint16_t* kept = keys(lane / kLaneStep, 0);
    const std::ptrdiff_t stride = lanes_;
    const std::uint16_t* missing = s_.partner_missing.data() + i + lane;
    for (int j = 0; j < size; ++j, entering.advance(), kept += kKeyStride, ++missing) {
      Vec more[kVectors];
      if (!kBorder || (j >= first_entering && j <= last_entering)) {
        enter<kVectors, kBorder>(entering, more);
      } else {
        for (Vec& sum : more) sum = hn::Zero(lanes);
      }
      for (int k = 0; k < kVectors; ++k) {
        const Vec change = hn::Sub(more[k], load_sums(leaving + k * kVector));
        window[k] = hn::Add(window[k], hn::ShiftLeft<kIdBits>(change));
        Vec key = window[k];
        if constexpr (kGaps == Gaps::kPadding) key = hn::Or(key, padding[k]);
        if constexpr (kBorder) key = hn::Or(key, hn::Or(padding[k], hn::LoadU(lanes, missing + k * kVector)));
        hn::Store(key, lanes, kept + k * kVector / kLaneStep * kGroupStride + k * kVector % kLaneStep);
      }
      if (!kBorder || before_first-- <= 0) leaving += stride;
    }
    for (int k = 0; k < kVectors; ++k) hn::Store(window[k], lanes, s_.window.data() + lane + k * kVector);
  }

  /// Columns [begin, end) of those whose partners of `width` lanes from `lane` on exist in part.
  [[nodiscard]] Span with_partners(int begin, int end, int lane, int width) const {
    return {std::max(begin, layout_.first_partner - lane - width + 1), std::min(end, layout_.end_partner - lane) - 1};
  }

  /// Of a batch: groups [begin, end) hold all of its candidates.
  struct Groups {
    int begin;
    int end;
  };
  [[nodiscard]] Groups groups_of(int x, int size) const {
    const int i = x - layout_.first_column;
    const int first = std::max(layout_.first_partner - (i + size - 1), 0);
    const int end = std::min(layout_.end_partner - i, lanes_);
    if (end <= first) return {0, 0};
    return {first >> kIdBits, ((end - 1) >> kIdBits) + 1};
  }

  /// Clipped windows count as if they had all columns.
  void scale_clipped(int x, int j) const {
    const BlockGeometry& g = task_.geometry;
    const WindowLimits limits = s_.limits[static_cast<std::size_t>(x - layout_.first_column)];
    const int columns = g.columns(x);
    std::uint16_t* const row = keys(0, j);
    const auto at = [row, last_lane = layout_.count - 1](int id) HWY_ATTR {
      const int lane = last_lane - id;
      return row + (lane >> kIdBits) * kGroupStride + (lane & (kLaneStep - 1));
    };
    if (columns == block_ && limits.first == limits.first_whole) {
      if (limits.end == limits.end_whole) return;
      // Clipped by the right picture's first column alone: at most half a block of neighbouring lanes.
      std::uint16_t* const first = at(limits.end - 1);
      if (((layout_.count - limits.end) & (kLaneStep - 1)) <= kLaneStep - kEdge) {
        scale_edge(first, by_partner_ + (x - g.offset - (g.range.min + limits.end - 1)));
        return;
      }
    }
    const auto scale = [&](int id, std::uint32_t by) HWY_ATTR {
      std::uint16_t& scaled = *at(id);
      const std::uint32_t cost = ((scaled >> kIdBits) * by) >> kFactorBits;
      scaled = static_cast<std::uint16_t>((cost << kIdBits) | (scaled & (kLaneStep - 1)));
    };
    for (int id = limits.first; id < limits.first_whole; ++id) scale(id, factors_[g.columns(x, g.range.min + id)]);
    for (int id = limits.end_whole; id < limits.end; ++id) scale(id, factors_[g.columns(x, g.range.min + id)]);
    if (columns == block_) return;
    for (int id = limits.first_whole; id < limits.end_whole; ++id) scale(id, factors_[columns]);
  }

  static HWY_INLINE void scale_edge(std::uint16_t* keys, const std::uint32_t* factors) {
    const hn::FixedTag<std::uint32_t, kEdge> wide;
    const hn::RebindToSigned<decltype(wide)> wide_signed;
    const hn::FixedTag<std::uint16_t, kEdge> narrow;
    const auto key = hn::PromoteTo(wide, hn::LoadU(narrow, keys));
    const auto cost = hn::ShiftRight<kFactorBits>(hn::Mul(hn::ShiftRight<kIdBits>(key), hn::LoadU(wide, factors)));
    const auto id = hn::And(key, hn::Set(wide, std::uint32_t{kLaneStep - 1}));
    const auto scaled = hn::Or(hn::ShiftLeft<kIdBits>(cost), id);
    hn::StoreU(hn::DemoteTo(narrow, hn::BitCast(wide_signed, scaled)), narrow, keys);
  }

  static HWY_INLINE Vec smallest_of_group(const std::uint16_t* keys) {
    Vec smallest = hn::Load(Lanes(), keys);
    for (int k = kVector; k < kLaneStep; k += kVector) smallest = hn::Min(smallest, hn::Load(Lanes(), keys + k));
    return smallest;
  }

  /// The smallest key of each pixel in kGroups groups, or, 0, in `count`; those of `size` rounded up to eights are
  /// written.
  template <int kGroups>
  HWY_INLINE void find_smallest(int first, int count, int size, std::uint16_t* smallest) const {
    const int groups = kGroups > 0 ? kGroups : count;
    for (int j = 0; j < size; j += kFoldedPixels) {
      const std::uint16_t* from = keys(first, j);
      const auto of_pixel = [&](int p) HWY_ATTR {
        Vec least = smallest_of_group(from + p * kKeyStride);
        for (int group = 1; group < groups; ++group) {
          least = hn::Min(least, smallest_of_group(from + group * kGroupStride + p * kKeyStride));
        }
        return least;
      };
      const auto of_pair = [&](int p) HWY_ATTR { return smaller_of_both<std::uint16_t>(of_pixel(p), of_pixel(p + 1)); };
      const auto of_four = [&](int p) HWY_ATTR { return smaller_of_both<std::uint32_t>(of_pair(p), of_pair(p + 2)); };
      const Vec eight = smaller_of_both<std::uint64_t>(of_four(0), of_four(4));
      hn::Store(fold_blocks(Lanes(), eight), FoldedPixels(), smallest + j);
    }
  }

  /// d - range.min = this + the id of a key.
  [[nodiscard]] int first_id(int group) const { return layout_.count - kLaneStep * (group + 1); }

  /// A batch, in columns of a table so that loops over it become vectors.
  struct Pixels {
    HWY_ALIGN std::uint16_t keys[kBatch];       ///< smallest of a group, and of the rivals
    HWY_ALIGN std::uint16_t costs[kBatch];      ///< smallest of all
    HWY_ALIGN std::uint16_t ids[kBatch];        ///< and of which d - range.min
    HWY_ALIGN std::uint16_t gradients[kBatch];  ///< sum over the window
    HWY_ALIGN std::uint64_t around[kBatch];     ///< key of the next larger disparity, and of the next smaller << 32
    HWY_ALIGN std::int32_t places[kBatch];      ///< of the smallest, in a row of keys
    HWY_ALIGN std::int32_t shift[kBatch];       ///< sub-pixel [1/16 px]
    HWY_ALIGN std::int32_t area[kBatch];        ///< of the window [px]
    HWY_ALIGN std::int32_t wanted[kBatch];      ///< 0 or 1
  };

  /// Takes keys of a group where they are smaller; of equals, what is there.
  template <class D>
  HWY_INLINE void keep_smaller_keys(D d, hn::Vec<D> keys, int first_id, std::uint16_t* costs,
                                    std::uint16_t* ids) const {
    const auto cost = hn::ShiftRight<kIdBits>(keys);
    const auto id = hn::Add(hn::And(keys, hn::Set(d, std::uint16_t{kLaneStep - 1})),
                            hn::Set(d, static_cast<std::uint16_t>(first_id)));
    const auto old = hn::LoadU(d, costs);
    const auto smaller = hn::Min(old, cost);
    hn::StoreU(hn::IfThenElse(hn::Eq(smaller, old), hn::LoadU(d, ids), id), d, ids);
    hn::StoreU(smaller, d, costs);
  }

  HWY_INLINE void find_best(Groups groups, int size, Pixels& pixels) const {
    const Lanes lanes;
    std::fill_n(pixels.costs, kBatch, kNoKeyCost);
    for (int group = groups.end - 1; group >= groups.begin; --group) {
      find_smallest<1>(group, 1, size, pixels.keys);
      for (int j = 0; j < kBatch; j += kVector) {
        keep_smaller_keys(lanes, hn::Load(lanes, pixels.keys + j), first_id(group), pixels.costs + j, pixels.ids + j);
      }
    }
    // Without a candidate any id will do that exists.
    for (int j = 0; j < kBatch; ++j) pixels.ids[j] = pixels.costs[j] != kNoKeyCost ? pixels.ids[j] : std::uint16_t{0};
  }

  /// Every pixel bids for its right partners, wanted or not, gated or not: of equals the smaller disparity, which is
  /// the left-most pixel.
  HWY_INLINE void bid(Groups groups, int x, int size) const {
    // Loads are unaligned: of longer vectors nearly all would touch two cache lines.
    const hn::CappedTag<std::uint16_t, 16> d;
    constexpr int kPartners = static_cast<int>(hn::MaxLanes(hn::CappedTag<std::uint16_t, 16>()));
    constexpr std::ptrdiff_t kStep = kKeyStride - 1;
    for (int group = groups.end - 1; group >= groups.begin; --group) {
      const std::ptrdiff_t partner = x - layout_.first_column + group * kLaneStep;
      for (int at = 0; at < kLaneStep + size - 1; at += kPartners) {
        const int first = std::max(at - kLaneStep + 1, 0);
        const int end = std::min(at + kPartners, size);
        const std::uint16_t* from = keys(group, first) + (at - first);
        auto best = hn::Set(d, kNoKey);
        const auto smaller = [&](const std::uint16_t* of)
                                 HWY_ATTR { return hn::Min(hn::LoadU(d, of), hn::LoadU(d, of + kStep)); };
        int j = first;
        for (; j + 8 <= end; j += 8, from += 8 * kStep) {
          const auto four = hn::Min(smaller(from), smaller(from + 2 * kStep));
          best = hn::Min(best, hn::Min(four, hn::Min(smaller(from + 4 * kStep), smaller(from + 6 * kStep))));
        }
        for (; j < end; ++j, from += kStep) best = hn::Min(best, hn::LoadU(d, from));
        keep_smaller_keys(d, best, first_id(group), s_.right_costs.data() + partner + at,
                          s_.right_ids.data() + partner + at);
      }
    }
  }

  /// The keys around the best are taken out, so that the smallest of the rest is the rival.
  HWY_INLINE void find_rivals(Groups groups, int size, Pixels& pixels) const {
    const int last_lane = layout_.count - 1;
    const auto place = [](int lane) HWY_ATTR { return (lane >> kIdBits) * kGroupStride + (lane & (kLaneStep - 1)); };
    for (int j = 0; j < kBatch; ++j) pixels.places[j] = place(last_lane - pixels.ids[j]);
    std::uint16_t* row = keys(0, 0);
    for (int j = 0; j < size; ++j, row += kKeyStride) {
      const int at = pixels.places[j];
      std::uint64_t four;
      if (((at + 1) & (kLaneStep - 1)) > 1) {
        // All three in one access, and one more cell that stays.
        std::memcpy(&four, row + at - 1, sizeof four);
        const std::uint64_t rest = four | 0xFFFF'FFFF'FFFF;
        std::memcpy(row + at - 1, &rest, sizeof rest);
      } else {
        std::uint16_t& before = row[place(last_lane - pixels.ids[j] + 1)];
        std::uint16_t& after = row[place(last_lane - pixels.ids[j] - 1)];
        four = after | std::uint64_t{before} << 32;
        before = after = row[at] = kNoKey;
      }
      pixels.around[j] = four;
    }
    if (task_.uniqueness <= 0) return;
    if (groups.end - groups.begin == 2) {
      find_smallest<2>(groups.begin, 2, size, pixels.keys);
    } else if (groups.end > groups.begin) {
      find_smallest<0>(groups.begin, groups.end - groups.begin, size, pixels.keys);
    }
  }

  /// (before - after) 16 / (2 slope), rounded to the nearest, halves away from zero, by counting the half steps
  /// that it reaches: at most 8.
  HWY_INLINE void find_shifts(int size, Pixels& pixels) const {
    const hn::CappedTag<std::int32_t, static_cast<std::size_t>(kBatch)> d;
    const hn::Rebind<std::uint16_t, decltype(d)> narrow;
    for (int j = 0; j < size; j += static_cast<int>(hn::MaxLanes(d))) {
      const auto cost = hn::PromoteTo(d, hn::Load(narrow, pixels.costs + j));
      hn::VFromD<decltype(d)> after;
      hn::VFromD<decltype(d)> before;
      hn::LoadInterleaved2(d, reinterpret_cast<const std::int32_t*>(pixels.around + j), after, before);
      const auto low = hn::Set(d, 0xFFFF);
      after = hn::ShiftRight<kIdBits>(hn::And(after, low));
      before = hn::ShiftRight<kIdBits>(hn::And(before, low));
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
      const auto none = hn::Set(d, std::int32_t{kNoKeyCost});
      const auto ends = hn::Or(hn::Or(hn::Eq(before, none), hn::Eq(after, none)), hn::Eq(difference, hn::Zero(d)));
      hn::Store(hn::IfThenZeroElse(ends, shift), d, pixels.shift + j);
    }
  }

  /// What the gates want to know of the windows.
  HWY_INLINE void describe(int x, int y, int size, Pixels& pixels) const {
    const Lanes lanes;
    const std::uint16_t* sums = s_.gradient_sums.data() + kLaneStep + (x - layout_.first_column - radius_);
    for (int j = 0; j < size; j += kVector) {
      Vec sum = hn::LoadU(lanes, sums + j);
      for (int k = 1; k < block_; ++k) sum = hn::Add(sum, hn::LoadU(lanes, sums + j + k));
      hn::Store(sum, lanes, pixels.gradients + j);
    }
    const int rows = std::min(y + radius_, task_.left.height - 1) - std::max(y - radius_, 0) + 1;
    const bool inner = layout_.is_inner(x);
    for (int j = 0; j < size; ++j) pixels.area[j] = rows * (inner ? block_ : task_.geometry.columns(x + j));
    const bool all = task_.mask.empty();
    const std::uint8_t* mask = all ? nullptr : task_.mask.row(y) + x;
    for (int j = 0; j < kBatch; ++j) pixels.wanted[j] = all && j < size ? 1 : 0;
    if (all) return;
    for (int j = 0; j < size; ++j) pixels.wanted[j] = mask[j] != 0 ? 1 : 0;
  }

  /// Gates, and the disparity of what passes them. All of the table, so that its length is known; the rest of it is
  /// not wanted.
  HWY_INLINE void judge(int x, const Pixels& pixels) {
    const int texture = task_.texture;
    const int uniqueness = 100 + task_.uniqueness;
    const int asks_rivals = task_.uniqueness > 0 ? 1 : 0;
    const int d_min = task_.geometry.range.min;
    std::uint16_t* HWY_RESTRICT values = s_.values.data() + (x - layout_.first_column);
    std::uint16_t* HWY_RESTRICT ids = s_.ids.data() + (x - layout_.first_column);
    int wanted = 0;
    int border = 0;
    int flat = 0;
    int ambiguous = 0;
    for (int j = 0; j < kBatch; ++j) {
      const int cost = pixels.costs[j];
      const int rival = pixels.keys[j] >> kIdBits;
      const int asked = pixels.wanted[j];
      const int exists = asked & static_cast<int>(cost != kNoKeyCost);
      const int textured = exists & static_cast<int>(pixels.gradients[j] * 16 >= texture * pixels.area[j]);
      const int rivalled =
          asks_rivals & static_cast<int>(rival != kNoKeyCost) & static_cast<int>(rival * 100 <= cost * uniqueness);
      const int value = (pixels.ids[j] + d_min) * kDisparityScale + pixels.shift[j];
      const int passes = textured & (1 - rivalled);
      values[j] = static_cast<std::uint16_t>(passes != 0 ? value : kNoDisparity);
      ids[j] = pixels.ids[j];
      wanted += asked;
      border += asked - exists;
      flat += exists - textured;
      ambiguous += textured - passes;
    }
    counts_.wanted += wanted;
    counts_.border += border;
    counts_.texture += flat;
    counts_.uniqueness += ambiguous;
  }

  HWY_INLINE void slide_inner(int x, int size) const {
    for_each_chunk(lanes_, [&](auto vectors, int lane, bool) HWY_ATTR {
      if (lane + vectors() * kVector <= layout_.count) {
        slide<vectors(), Gaps::kNone>(lane, x, size);
      } else {
        slide<vectors(), Gaps::kPadding>(lane, x, size);
      }
    });
  }

  HWY_INLINE void slide_border(Groups groups, int x, int size) const {
    const int i = x - layout_.first_column;
    for_each_chunk(lanes_, [&](auto vectors, int lane, bool) HWY_ATTR {
      // Where neither candidates nor columns have partners, sums are and stay nothing.
      const Span range = with_partners(i - radius_ - 1, i + size + radius_, lane, vectors() * kVector);
      if (!range.empty()) slide<vectors(), Gaps::kBorder>(lane, x, size);
    });
    for (int j = 0; j < size; ++j) {
      // The neighbours of the first and the last lane that may be asked for.
      keys(groups.begin - 1, j)[kLaneStep - 1] = keys(groups.end, j)[0] = kNoKey;
      scale_clipped(x + j, j);
    }
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
    const bool checks = task_.left_right_px >= 0;
    if (checks) std::fill_n(s_.right_costs.data(), layout_.partners, kNoKey);
    for (int x = span.first; x <= span.last;) {
      const int size = layout_.batch(x, span.last);
      Groups groups{0, groups_};
      // Where no row enters, distances are masked away as they are beside the borders.
      if (enters_ && layout_.is_inner(x)) {
        slide_inner(x, size);
      } else {
        groups = groups_of(x, size);
        slide_border(groups, x, size);
      }
      find_best(groups, size, pixels_);
      if (checks) bid(groups, x, size);
      find_rivals(groups, size, pixels_);
      find_shifts(size, pixels_);
      describe(x, y, size, pixels_);
      judge(x, pixels_);
      x += size;
    }
    if (checks) check_row(span);
    std::copy_n(s_.values.data() + (span.first - layout_.first_column), span.last - span.first + 1, raw + span.first);
  }

  /// The left-right check, once all pixels of the row have bid for their partners.
  void check_row(Span span) noexcept {
    const Lanes lanes;
    const int begin = span.first - layout_.first_column;
    const int size = span.last - span.first + 1;
    std::uint16_t* HWY_RESTRICT values = s_.values.data() + begin;
    const std::uint16_t* HWY_RESTRICT ids = s_.ids.data() + begin;
    const std::uint16_t* HWY_RESTRICT right_ids = s_.right_ids.data() + begin + (layout_.count - 1);
    std::uint16_t* HWY_RESTRICT met = s_.met_ids.data() + begin;
    // What needs an address of its own first, so that the rest are vectors.
    for (int i = 0; i < size; ++i) met[i] = right_ids[i - ids[i]];
    const Vec limit = hn::Set(lanes, static_cast<std::uint16_t>(task_.left_right_px));
    const Vec none = hn::Set(lanes, kNoDisparity);
    std::size_t rejected = 0;
    for (int i = 0; i < size; i += kVector) {
      const Vec id = hn::LoadU(lanes, ids + i);
      const Vec back = hn::LoadU(lanes, met + i);
      const Vec value = hn::LoadU(lanes, values + i);
      const Vec too_far = hn::SaturatedSub(hn::Sub(hn::Max(id, back), hn::Min(id, back)), limit);
      const auto near = hn::Eq(too_far, hn::Zero(lanes));
      const auto lost = hn::AndNot(near, hn::Not(hn::Eq(value, none)));
      const int here = std::min(size - i, kVector);
      rejected += hn::CountTrue(lanes, hn::And(lost, hn::FirstN(lanes, static_cast<std::size_t>(here))));
      hn::StoreU(hn::IfThenElse(near, value, none), lanes, values + i);
    }
    counts_.left_right += static_cast<std::int64_t>(rejected);
  }

  const CensusTask& task_;
  CensusScratch& s_;
  int radius_;
  int block_;
  LaneLayout layout_;
  int lanes_;
  int groups_;                 ///< of kLaneStep lanes
  std::ptrdiff_t left_plane_;  ///< from plane to plane of codes
  std::ptrdiff_t right_plane_;
  int first_row_ = 0;
  int entering_ = 0;  ///< row
  bool enters_ = false;
  std::uint32_t factors_[kLargestCensusLaneBlock + 1] = {};  ///< [columns], see factor_of()
  std::uint32_t by_partner_[2 * kEdge] = {};                 ///< [right column], likewise
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
  const auto rows = static_cast<std::size_t>(block);
  const auto codes = [&](std::size_t length) {
    return arena.array<std::uint8_t>(rows * kMostPlanes *
                                     static_cast<std::size_t>(code_cells(static_cast<int>(length))));
  };
  CensusScratch s;
  s.distances = arena.array<std::uint8_t>(rows * columns * lanes);
  s.column_sums = arena.array<std::uint8_t>((columns + 1) * lanes);
  s.window = arena.array<std::uint16_t>(lanes);
  s.keys = arena.array<std::uint16_t>(kMostKeyStride * (kPixelStep * (lanes / kLaneStep + 2) + 1));
  s.gradient_sums = arena.array<std::uint16_t>(columns + 3 * kLaneStep);
  s.limits = arena.array<WindowLimits>(columns);
  s.left_codes = codes(columns);
  s.right_codes = codes(partners);
  s.partner_exists = arena.array<std::uint8_t>(partners);
  s.no_partner = arena.array<std::uint8_t>(partners);
  s.partner_missing = arena.array<std::uint16_t>(partners);
  s.right_costs = arena.array<std::uint16_t>(partners);
  s.right_ids = arena.array<std::uint16_t>(partners);
  s.values = arena.array<std::uint16_t>(columns + kPixelStep);
  s.ids = arena.array<std::uint16_t>(columns + kPixelStep);
  s.met_ids = arena.array<std::uint16_t>(columns + kPixelStep);
  s.reference_left = arena.array<std::uint32_t>(columns);
  s.reference_right = arena.array<std::uint32_t>(partners);
  s.reference_sums = arena.array<std::uint16_t>(columns * lanes);
  s.reference_gradients = arena.array<std::uint32_t>(columns);
  s.reference_costs = arena.array<std::uint16_t>(lanes);
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
    std::fill_n(s_.reference_gradients.data(), layout_.columns, 0U);
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
    return s_.reference_sums.data() + std::ptrdiff_t{x - layout_.first_column} * layout_.count;
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
      std::uint32_t& gradients = s_.reference_gradients[static_cast<std::size_t>(x - layout_.first_column)];
      gradients += static_cast<std::uint32_t>(sign) * gradient(task_.left.row(y), x, g_.left_width);
      for (int d = g_.first(x); d <= g_.last(x); ++d) {
        std::uint16_t& sum = column(x)[d - g_.range.min];
        sum = static_cast<std::uint16_t>(sum + sign * std::popcount(left[x] ^ right[x - d - g_.offset]));
      }
    }
  }

  void change_window(int x, int sign) noexcept {
    std::uint16_t* window = s_.window.data();
    const std::uint16_t* sums = column(x);
    for (int i = 0; i < layout_.count; ++i) window[i] = static_cast<std::uint16_t>(window[i] + sign * sums[i]);
    gradient_ +=
        static_cast<std::uint32_t>(sign) * s_.reference_gradients[static_cast<std::size_t>(x - layout_.first_column)];
  }

  void match_row(int y) noexcept {
    const Rect& box = task_.wanted.box;
    std::uint16_t* raw = task_.raw.row(y);
    std::fill_n(raw + box.left, box.width, kNoDisparity);
    const Span span = task_.wanted.span(y);
    if (span.empty()) return;
    std::fill_n(s_.window.data(), layout_.count, std::uint16_t{0});
    std::fill_n(s_.right_costs.data(), layout_.partners, kNoCost);
    gradient_ = 0;
    const int begin = std::max(span.first - g_.radius, 0);
    for (int x = begin; x < std::min(span.first + g_.radius, g_.left_width); ++x) change_window(x, 1);
    for (int x = span.first; x <= span.last; ++x) {
      if (x + g_.radius < g_.left_width) change_window(x + g_.radius, 1);
      if (x - g_.radius - 1 >= begin) change_window(x - g_.radius - 1, -1);
      match(x, y);
    }
    check_row(span, raw);
  }

  /// The left-right check, once all pixels of the row have bid for their partners.
  void check_row(Span span, std::uint16_t* raw) noexcept {
    const std::uint16_t* values = s_.values.data() - layout_.first_column;
    const std::uint16_t* ids = s_.ids.data() - layout_.first_column;
    const std::uint16_t* back = s_.right_ids.data() + (layout_.count - 1 - layout_.first_column);
    const int limit = task_.left_right_px;
    for (int x = span.first; x <= span.last; ++x) {
      raw[x] = values[x];
      if (limit < 0 || values[x] == kNoDisparity || std::abs(back[x - ids[x]] - ids[x]) <= limit) continue;
      raw[x] = kNoDisparity;
      ++counts_.left_right;
    }
  }

  [[nodiscard]] std::uint16_t smallest(int begin, int end) const noexcept {
    std::uint16_t result = kNoCost;
    for (int i = begin; i < end; ++i) result = std::min(result, s_.reference_costs[static_cast<std::size_t>(i)]);
    return result;
  }

  void match(int x, int y) noexcept {
    const int first = g_.first(x) - g_.range.min;
    const int end = g_.last(x) - g_.range.min + 1;
    const int at = x - layout_.first_column;
    std::uint16_t& value = s_.values[static_cast<std::size_t>(at)];
    value = kNoDisparity;
    std::uint16_t* costs = s_.reference_costs.data();
    for (int i = first; i < end; ++i) {
      const int columns = g_.columns(x, i + g_.range.min);
      costs[i] = static_cast<std::uint16_t>(s_.window[static_cast<std::size_t>(i)] * block_ / columns);
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
