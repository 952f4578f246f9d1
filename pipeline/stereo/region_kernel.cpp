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

constexpr int kStep = 16;  ///< lanes that are summed together

/// Sums of lanes [first, first + kStep).
struct StepSums {
  alignas(64) std::int32_t differences[kStep] = {};
  alignas(64) std::int32_t squares[kStep] = {};
  alignas(64) std::int32_t moving[kStep] = {};
  alignas(64) std::int32_t pixels[kStep] = {};
};

/// A sample that may meet no pixel in some of the lanes.
[[maybe_unused]] void add_clipped(const RegionTask& task, const RegionSample& sample, int first,
                                  StepSums& sums) noexcept {
  const int y = sample.y + task.row_offset;
  if (y < 0 || y >= task.right.height) return;
  const int column = sample.x + task.shift + first;
  const int end = std::min(kStep, task.right.width - column);
  for (int i = std::max(-column, 0); i < end; ++i) {
    const int difference = sample.grey - task.right.at(column + i, y);
    sums.differences[i] += difference;
    sums.squares[i] += difference * difference;
    sums.pixels[i] += 1;
    if (!task.moving.empty() && task.moving.at(column + i, y) != 0) ++sums.moving[i];
  }
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

constexpr hn::CappedTag<std::int16_t, kStep> kWords{};
constexpr hn::Rebind<std::uint8_t, hn::CappedTag<std::int16_t, kStep> > kBytes{};
constexpr hn::RepartitionToWide<hn::CappedTag<std::uint16_t, kStep> > kSums{};
constexpr int kLanes = static_cast<int>(hn::MaxLanes(kWords));
constexpr int kVectors = kStep / kLanes;
// So many samples' differences, each at most 255, are summed up in 16 bits; and counts in 8.
constexpr int kMostInWords = 128;

/// What has come together of at most kMostInWords samples is added to the sums and forgotten.
template <class V16, class V8>
void flush(V16* differences, V8* moving, StepSums& sums) {
  alignas(64) std::int16_t words[kStep];
  alignas(64) std::uint8_t bytes[kStep];
  for (int k = 0; k < kVectors; ++k) {
    hn::Store(differences[k], kWords, words + k * kLanes);
    hn::Store(moving[k], kBytes, bytes + k * kLanes);
    differences[k] = hn::Zero(kWords);
    moving[k] = hn::Zero(kBytes);
  }
  for (int i = 0; i < kStep; ++i) {
    sums.differences[i] += words[i];
    sums.moving[i] += bytes[i];
  }
}

template <bool kMoving>
void sum_step(const RegionTask& task, int first, StepSums& sums) {
  hn::Vec<decltype(kWords)> differences[kVectors];
  hn::Vec<decltype(kBytes)> moving[kVectors];
  hn::Vec<decltype(kSums)> even[kVectors];
  hn::Vec<decltype(kSums)> odd[kVectors];
  for (int k = 0; k < kVectors; ++k) {
    differences[k] = hn::Zero(kWords);
    moving[k] = hn::Zero(kBytes);
    even[k] = odd[k] = hn::Zero(kSums);
  }
  const int last_column = task.right.width - kStep;
  int whole = 0;
  int gathered = 0;
  for (const RegionSample& sample : task.samples) {
    const int y = sample.y + task.row_offset;
    const int column = sample.x + task.shift + first;
    if (y < 0 || y >= task.right.height || column < 0 || column > last_column) {
      add_clipped(task, sample, first, sums);
      continue;
    }
    const auto grey = hn::Set(kWords, sample.grey);
    const std::uint8_t* partners = task.right.row(y) + column;
    for (int k = 0; k < kVectors; ++k) {
      const auto difference = hn::Sub(grey, hn::PromoteTo(kWords, hn::LoadU(kBytes, partners + k * kLanes)));
      differences[k] = hn::Add(differences[k], difference);
      // At most 255^2 < 2^16.
      const auto squares = hn::BitCast(kSums, hn::Mul(difference, difference));
      even[k] = hn::Add(even[k], hn::And(squares, hn::Set(kSums, 0xFFFFU)));
      odd[k] = hn::Add(odd[k], hn::ShiftRight<16>(squares));
    }
    if (kMoving) {
      const std::uint8_t* moves = task.moving.row(y) + column;
      for (int k = 0; k < kVectors; ++k) {
        // A mask of ones is -1.
        const auto set = hn::Ne(hn::LoadU(kBytes, moves + k * kLanes), hn::Zero(kBytes));
        moving[k] = hn::Sub(moving[k], hn::VecFromMask(kBytes, set));
      }
    }
    ++whole;
    if (++gathered == kMostInWords) {
      flush(differences, moving, sums);
      gathered = 0;
    }
  }
  flush(differences, moving, sums);
  for (int k = 0; k < kVectors; ++k) {
    alignas(64) std::uint32_t even_sums[kLanes / 2];
    alignas(64) std::uint32_t odd_sums[kLanes / 2];
    hn::Store(even[k], kSums, even_sums);
    hn::Store(odd[k], kSums, odd_sums);
    for (int i = 0; i < kLanes / 2; ++i) {
      sums.squares[k * kLanes + 2 * i] += static_cast<std::int32_t>(even_sums[i]);
      sums.squares[k * kLanes + 2 * i + 1] += static_cast<std::int32_t>(odd_sums[i]);
    }
  }
  for (int& pixels : sums.pixels) pixels += whole;
}

void sums_of(const RegionTask& task, const RegionSums& sums) {
  if (task.lanes < kStep) return region_sums_reference(task, sums);
  for (int next = 0; next < task.lanes; next += kStep) {
    const int first = std::min(next, task.lanes - kStep);  // the last step overlaps the one before it
    StepSums step;
    if (task.moving.empty()) {
      sum_step<false>(task, first, step);
    } else {
      sum_step<true>(task, first, step);
    }
    std::copy_n(step.differences, kStep, sums.differences.data() + first);
    std::copy_n(step.squares, kStep, sums.squares.data() + first);
    std::copy_n(step.moving, kStep, sums.moving.data() + first);
    std::copy_n(step.pixels, kStep, sums.pixels.data() + first);
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
  for (const std::span<std::int32_t>& all : {sums.differences, sums.squares, sums.moving, sums.pixels}) {
    std::fill_n(all.data(), task.lanes, 0);
  }
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
