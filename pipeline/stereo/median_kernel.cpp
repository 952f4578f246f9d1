#include "pipeline/stereo/median_kernel.hpp"

#include <algorithm>
#include <iterator>
#include <type_traits>
#include <utility>

#include "pipeline/stereo/disparity.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "pipeline/stereo/median_kernel.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "pipeline/stereo/lanes-inl.hpp"

#ifndef STEREOTRACK_MEDIAN_KERNEL_COMMON
#define STEREOTRACK_MEDIAN_KERNEL_COMMON
namespace stereotrack {

namespace {

std::uint16_t median_of_valid(const ImageView<const std::uint16_t>& in, int x, int y) noexcept {
  if (in.at(x, y) == kNoDisparity) return kNoDisparity;
  std::uint16_t sorted[9];
  int count = 0;
  for (int j = std::max(y - 1, 0); j <= std::min(y + 1, in.height - 1); ++j) {
    for (int i = std::max(x - 1, 0); i <= std::min(x + 1, in.width - 1); ++i) {
      const std::uint16_t value = in.at(i, j);
      if (value == kNoDisparity) continue;
      int at = count++;
      for (; at > 0 && sorted[at - 1] > value; --at) sorted[at] = sorted[at - 1];
      sorted[at] = value;
    }
  }
  return sorted[count / 2];
}

}  // namespace

}  // namespace stereotrack
#endif

HWY_BEFORE_NAMESPACE();
namespace stereotrack {
namespace HWY_NAMESPACE {
namespace {

#if HWY_TARGET == HWY_SCALAR

void median_in_lanes(ImageView<const std::uint16_t> in, std::span<const std::uint16_t> /*none_row*/,
                     ImageView<std::uint16_t> out) {
  median_reference(in, out);
}

#else

/// Exchanges that sort nine values in seven layers.
struct Exchange {
  std::uint8_t low;
  std::uint8_t high;
};
constexpr Exchange kExchanges[] = {{0, 3}, {1, 7}, {2, 5}, {4, 8}, {0, 7}, {2, 4}, {3, 8}, {5, 6}, {0, 2},
                                   {1, 3}, {4, 5}, {7, 8}, {1, 4}, {3, 6}, {5, 7}, {0, 1}, {2, 4}, {3, 5},
                                   {6, 8}, {2, 3}, {4, 5}, {6, 7}, {1, 2}, {3, 4}, {5, 6}};

/// Indices are constants, so that all nine stay in registers and what nobody asks for is left out.
template <std::size_t... kIndex>
HWY_INLINE void sort(Vec (&v)[9], std::index_sequence<kIndex...> /*exchanges*/) {
  const auto exchange = [&](auto index) HWY_ATTR {
    constexpr Exchange kAt = kExchanges[index()];
    const Vec smaller = hn::Min(v[kAt.low], v[kAt.high]);
    v[kAt.high] = hn::Max(v[kAt.low], v[kAt.high]);
    v[kAt.low] = smaller;
  };
  (exchange(std::integral_constant<std::size_t, kIndex>()), ...);
}

/// Of the pixels x.. of three rows.
HWY_INLINE Vec median(const std::uint16_t* const (&rows)[3], int x) {
  const Lanes lanes;
  const Vec none = hn::Set(lanes, kNoDisparity);
  Vec v[9];
  for (int j = 0; j < 3; ++j) {
    v[3 * j] = hn::LoadU(lanes, rows[j] + x - 1);
    v[3 * j + 1] = hn::LoadU(lanes, rows[j] + x);
    v[3 * j + 2] = hn::LoadU(lanes, rows[j] + x + 1);
  }
  Vec missing = hn::Zero(lanes);
  for (const Vec& value : v) missing = hn::Sub(missing, hn::VecFromMask(lanes, hn::Eq(value, none)));
  const auto centre_missing = hn::Eq(v[4], none);
  sort(v, std::make_index_sequence<std::size(kExchanges)>());
  // With n of nine missing the upper middle is the (9 - n) / 2-th.
  const auto many = [&](int n) HWY_ATTR {
    return hn::Eq(hn::Max(missing, hn::Set(lanes, static_cast<std::uint16_t>(n))), missing);
  };
  Vec result = hn::IfThenElse(many(2), v[3], v[4]);
  result = hn::IfThenElse(many(4), v[2], result);
  result = hn::IfThenElse(many(6), v[1], result);
  result = hn::IfThenElse(many(8), v[0], result);
  return hn::IfThenElse(centre_missing, none, result);
}

/// Pixels [x, x + count) where a vector would see beyond the row: it sees a copy with none around it.
HWY_INLINE void median_of_copy(const std::uint16_t* const (&rows)[3], int width, int x, int count,
                               std::uint16_t* result) {
  constexpr int kCopied = kVector + 2;
  std::uint16_t copies[3][kCopied];
  const int from = std::max(x - 1, 0);
  const int size = std::min(x + count + 1, width) - from;
  const int skipped = from - (x - 1);
  for (int j = 0; j < 3; ++j) {
    std::fill_n(copies[j], kCopied, kNoDisparity);
    std::copy_n(rows[j] + from, size, copies[j] + skipped);
  }
  HWY_ALIGN std::uint16_t found[kVector];
  hn::Store(median({copies[0], copies[1], copies[2]}, 1), Lanes(), found);
  std::copy_n(found, count, result + x);
}

void median_in_lanes(ImageView<const std::uint16_t> in, std::span<const std::uint16_t> none_row,
                     ImageView<std::uint16_t> out) {
  const int last = in.width - 1 - kVector;
  for (int y = 0; y < in.height; ++y) {
    const std::uint16_t* const rows[3] = {y > 0 ? in.row(y - 1) : none_row.data(), in.row(y),
                                          y + 1 < in.height ? in.row(y + 1) : none_row.data()};
    std::uint16_t* result = out.row(y);
    for (int x = 0; x < in.width; x += kVector) {
      if (x == 0 || x > last) {
        median_of_copy(rows, in.width, x, std::min(kVector, in.width - x), result);
      } else {
        hn::StoreU(median(rows, x), Lanes(), result + x);
      }
    }
  }
}

#endif

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace stereotrack
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace stereotrack {

HWY_EXPORT(median_in_lanes);

void median_lanes(ImageView<const std::uint16_t> in, std::span<const std::uint16_t> none_row,
                  ImageView<std::uint16_t> out) noexcept {
  HWY_DYNAMIC_DISPATCH(median_in_lanes)(in, none_row, out);
}

void median_reference(ImageView<const std::uint16_t> in, ImageView<std::uint16_t> out) noexcept {
  for (int y = 0; y < in.height; ++y) {
    for (int x = 0; x < in.width; ++x) out.at(x, y) = median_of_valid(in, x, y);
  }
}

}  // namespace stereotrack
#endif
