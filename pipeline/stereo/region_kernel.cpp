#include "pipeline/stereo/region_kernel.hpp"

#include <algorithm>

#include "pipeline/core/simd.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "pipeline/stereo/region_kernel.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#ifndef STEREOTRACK_REGION_KERNEL_SHARED
#define STEREOTRACK_REGION_KERNEL_SHARED
namespace stereotrack {
namespace {

/// Sums of the lanes of one step.
struct StepSums {
  alignas(64) std::int32_t differences[kRegionStep] = {};
  alignas(64) std::int32_t squares[kRegionStep] = {};
  alignas(64) std::int32_t moving[kRegionStep] = {};
  alignas(64) std::int32_t pixels[kRegionStep] = {};
};

/// A sample that may meet no pixel in some of the lanes [first, first + count).
[[maybe_unused]] void add_clipped(const RegionTask& task, const RegionSample& sample, int first, int count,
                                  StepSums& sums) noexcept {
  const int y = sample.y + task.row_offset;
  if (y < 0 || y >= task.right.height) return;
  const int column = sample.x + task.shift + first;
  const int begin = std::max(-column, 0);
  const int end = std::min(count, task.right.width - column);
  if (begin >= end) return;
  const std::uint8_t* partners = task.right.row(y) + column + begin;
  const std::uint8_t* moves = task.moving.empty() ? nullptr : task.moving.row(y) + column + begin;
  for (int i = begin; i < end; ++i) {
    const int difference = sample.grey - partners[i - begin];
    sums.differences[i] += difference;
    sums.squares[i] += difference * difference;
    sums.pixels[i] += 1;
  }
  if (moves == nullptr) return;
  for (int i = begin; i < end; ++i) sums.moving[i] += moves[i - begin] != 0 ? 1 : 0;
}

}  // namespace
}  // namespace stereotrack
#endif

HWY_BEFORE_NAMESPACE();
namespace stereotrack {
namespace HWY_NAMESPACE {
namespace {

#if HWY_TARGET == HWY_SCALAR

void sums_of(const RegionTask& task, const RegionSums& sums) { region_sums_reference(task, sums); }

#else

namespace hn = hwy::HWY_NAMESPACE;

// So many samples' differences, each at most 255, are summed up in 16 bits; and counts in 8.
constexpr int kMostInWords = 128;
constexpr int kHalfStep = kRegionStep / 2;
constexpr hn::CappedTag<std::int16_t, kHalfStep> kWords{};
constexpr hn::Rebind<std::uint8_t, hn::CappedTag<std::int16_t, kHalfStep> > kBytes{};
constexpr hn::RepartitionToWide<hn::CappedTag<std::uint16_t, kHalfStep> > kSums{};
constexpr int kLanes = static_cast<int>(hn::MaxLanes(kWords));

/// What has come together of `count` samples, at most kMostInWords, is added to the sums and forgotten. still: how many
/// do not move.
template <int kVectors, bool kMoving, class V16, class V8>
void flush(V16* differences, V8* still, int count, StepSums& sums) {
  alignas(64) std::int16_t words[kRegionStep];
  alignas(64) std::uint8_t bytes[kRegionStep];
  for (int k = 0; k < kVectors; ++k) {
    hn::Store(differences[k], kWords, words + k * kLanes);
    hn::Store(still[k], kBytes, bytes + k * kLanes);
  }
  // A loop of its own: in that above, GCC 12 turns the zeros into a memset for 64-bit ARM, and that before the copy.
  for (int k = 0; k < kVectors; ++k) {
    differences[k] = hn::Zero(kWords);
    still[k] = hn::Zero(kBytes);
  }
  for (int i = 0; i < kVectors * kLanes; ++i) sums.differences[i] += words[i];
  for (int i = 0; kMoving && i < kVectors * kLanes; ++i) sums.moving[i] += count - bytes[i];
}

template <int kVectors, bool kMoving, bool kInside>
void sum_step(const RegionTask& task, int first, StepSums& sums) {
  hn::Vec<decltype(kWords)> differences[kVectors];
  hn::Vec<decltype(kBytes)> still[kVectors];
  hn::Vec<decltype(kSums)> pairs[kVectors];  // even lanes, and 2^16 times the odd ones
  hn::Vec<decltype(kSums)> odd[kVectors];
  for (int k = 0; k < kVectors; ++k) {
    differences[k] = hn::Zero(kWords);
    still[k] = hn::Zero(kBytes);
    pairs[k] = odd[k] = hn::Zero(kSums);
  }
  const int last_column = task.right.width - kVectors * kLanes;
  int whole = 0;
  int gathered = 0;
  for (const RegionSample& sample : task.samples) {
    const int y = sample.y + task.row_offset;
    const int column = sample.x + task.shift + first;
    if (!kInside && (y < 0 || y >= task.right.height || column < 0 || column > last_column)) {
      add_clipped(task, sample, first, kVectors * kLanes, sums);
      continue;
    }
    const auto grey = hn::Set(kWords, sample.grey);
    const std::uint8_t* partners = task.right.row(y) + column;
    for (int k = 0; k < kVectors; ++k) {
      const auto difference = hn::Sub(grey, hn::PromoteTo(kWords, hn::LoadU(kBytes, partners + k * kLanes)));
      differences[k] = hn::Add(differences[k], difference);
      // At most 255^2 < 2^16.
      const auto squares = hn::BitCast(kSums, hn::Mul(difference, difference));
      pairs[k] = hn::Add(pairs[k], squares);
      odd[k] = hn::Add(odd[k], hn::ShiftRight<16>(squares));
    }
    if (kMoving) {
      const std::uint8_t* moves = task.moving.row(y) + column;
      for (int k = 0; k < kVectors; ++k) {
        // A mask of ones is -1.
        const auto none = hn::Eq(hn::LoadU(kBytes, moves + k * kLanes), hn::Zero(kBytes));
        still[k] = hn::Sub(still[k], hn::VecFromMask(kBytes, none));
      }
    }
    ++whole;
    if (++gathered == kMostInWords) {
      flush<kVectors, kMoving>(differences, still, gathered, sums);
      gathered = 0;
    }
  }
  flush<kVectors, kMoving>(differences, still, gathered, sums);
  for (int k = 0; k < kVectors; ++k) {
    alignas(64) std::uint32_t pair_sums[kLanes / 2];
    alignas(64) std::uint32_t odd_sums[kLanes / 2];
    hn::Store(pairs[k], kSums, pair_sums);
    hn::Store(odd[k], kSums, odd_sums);
    for (int i = 0; i < kLanes / 2; ++i) {
      // Modulo 2^32, as the sums of pairs are; the squares' sums are less.
      sums.squares[k * kLanes + 2 * i] += static_cast<std::int32_t>(pair_sums[i] - (odd_sums[i] << 16));
      sums.squares[k * kLanes + 2 * i + 1] += static_cast<std::int32_t>(odd_sums[i]);
    }
  }
  for (int i = 0; i < kVectors * kLanes; ++i) sums.pixels[i] += whole;
}

template <int kVectors>
void sum_lanes(const RegionTask& task, int first, StepSums& sums) {
  if (task.moving.empty()) {
    task.inside ? sum_step<kVectors, false, true>(task, first, sums)
                : sum_step<kVectors, false, false>(task, first, sums);
  } else {
    task.inside ? sum_step<kVectors, true, true>(task, first, sums)
                : sum_step<kVectors, true, false>(task, first, sums);
  }
}

void sums_of(const RegionTask& task, const RegionSums& sums) {
  for (int first = 0; first < task.lanes; first += kRegionStep) {
    const int count = std::min(kRegionStep, task.lanes - first);
    StepSums step;
    if (count > kHalfStep) {
      sum_lanes<kRegionStep / kLanes>(task, first, step);
    } else {
      sum_lanes<kHalfStep / kLanes>(task, first, step);
    }
    // What the last step has beyond the lanes that were asked for is dropped.
    for (int i = 0; i < count; ++i) {
      const auto lane = static_cast<std::size_t>(first + i);
      sums.differences[lane] += step.differences[i];
      sums.squares[lane] += step.squares[i];
      sums.moving[lane] += step.moving[i];
      sums.pixels[lane] += step.pixels[i];
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

namespace {

HWY_EXPORT(sums_of);

}  // namespace

void region_sums_reference(const RegionTask& task, const RegionSums& sums) noexcept {
  for (const RegionSample& sample : task.samples) {
    for (int i = 0; i < task.lanes; ++i) {
      const int x = sample.x + task.shift + i;
      const int y = sample.y + task.row_offset;
      if (!task.right.contains(x, y)) continue;
      const int difference = sample.grey - task.right.at(x, y);
      const auto lane = static_cast<std::size_t>(i);
      sums.differences[lane] += difference;
      sums.squares[lane] += difference * difference;
      sums.moving[lane] += !task.moving.empty() && task.moving.at(x, y) != 0 ? 1 : 0;
      ++sums.pixels[lane];
    }
  }
}

void region_sums(const RegionTask& task, const RegionSums& sums) noexcept {
  if (simd_in_use() == SimdTarget::kScalar) return region_sums_reference(task, sums);
  HWY_DYNAMIC_DISPATCH(sums_of)(task, sums);
}

}  // namespace stereotrack

#endif
