#include "pipeline/stereo/median_kernel.hpp"

#include <algorithm>

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

[[maybe_unused]] std::uint16_t median_of_valid(const ImageView<const std::uint16_t>& in, int x, int y) noexcept {
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
constexpr std::uint8_t kExchanges[25][2] = {{0, 3}, {1, 7}, {2, 5}, {4, 8}, {0, 7}, {2, 4}, {3, 8}, {5, 6}, {0, 2},
                                            {1, 3}, {4, 5}, {7, 8}, {1, 4}, {3, 6}, {5, 7}, {0, 1}, {2, 4}, {3, 5},
                                            {6, 8}, {2, 3}, {4, 5}, {6, 7}, {1, 2}, {3, 4}, {5, 6}};

/// Of the pixels x.. of three rows.
HWY_INLINE Vec median(const std::uint16_t* const (&rows)[3], int x) {
  const Lanes lanes;
  const Vec none = hn::Set(lanes, kNoDisparity);
  Vec v[9];
  Vec missing = hn::Zero(lanes);
  for (int i = 0; i < 9; ++i) {
    v[i] = hn::LoadU(lanes, rows[i / 3] + x + i % 3 - 1);
    missing = hn::Sub(missing, hn::VecFromMask(lanes, hn::Eq(v[i], none)));
  }
  const auto centre_missing = hn::Eq(v[4], none);
  for (const auto& [low, high] : kExchanges) {
    const Vec smaller = hn::Min(v[low], v[high]);
    v[high] = hn::Max(v[low], v[high]);
    v[low] = smaller;
  }
  // With n of nine missing the upper middle is the (9 - n) / 2-th.
  Vec result = v[4];
  for (int i = 3; i >= 0; --i) {
    const Vec few = hn::Set(lanes, static_cast<std::uint16_t>(8 - 2 * i));
    result = hn::IfThenElse(hn::Eq(hn::Max(missing, few), missing), v[i], result);
  }
  return hn::IfThenElse(centre_missing, none, result);
}

void median_in_lanes(ImageView<const std::uint16_t> in, std::span<const std::uint16_t> none_row,
                     ImageView<std::uint16_t> out) {
  const int last = in.width - 1 - kVector;
  for (int y = 0; y < in.height; ++y) {
    const std::uint16_t* const rows[3] = {y > 0 ? in.row(y - 1) : none_row.data(), in.row(y),
                                          y + 1 < in.height ? in.row(y + 1) : none_row.data()};
    std::uint16_t* result = out.row(y);
    if (last < 1) {
      for (int x = 0; x < in.width; ++x) result[x] = median_of_valid(in, x, y);
      continue;
    }
    result[0] = median_of_valid(in, 0, y);
    // Vectors must see both neighbours; the last one is moved back to do so.
    for (int x = 1; x < in.width - 1; x += kVector) {
      const int at = std::min(x, last);
      hn::StoreU(median(rows, at), Lanes(), result + at);
    }
    result[in.width - 1] = median_of_valid(in, in.width - 1, y);
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
