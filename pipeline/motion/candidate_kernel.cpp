#include "pipeline/motion/candidate_kernel.hpp"

#include <algorithm>
#include <cstring>

#include "pipeline/core/simd.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "pipeline/motion/candidate_kernel.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "pipeline/core/byte_lanes-inl.h"

#ifndef STEREOTRACK_CANDIDATE_KERNEL_LIMITS
#define STEREOTRACK_CANDIDATE_KERNEL_LIMITS
namespace stereotrack {
namespace {

constexpr int kReach = CandidateWorkspace::kReach;
constexpr int kRing = 2 * kReach + 1;
constexpr int kFrame = Arena::kAlignment;  // columns of zeros before and, at least, after each row
constexpr int kFaintPart = 2;              // the mean must be at least 1/kFaintPart of the largest

}  // namespace
}  // namespace stereotrack
#endif

HWY_BEFORE_NAMESPACE();
namespace stereotrack {
namespace HWY_NAMESPACE {
namespace {

#if HWY_TARGET == HWY_SCALAR

void mark(ImageView<const std::uint8_t> distance, const CandidateLimits& limits, const CandidateWorkspace& work) {
  mark_candidates_reference(distance, limits, work);
}
void vote(const CandidateWorkspace& work, ImageView<std::uint8_t> mask) { keep_majority_reference(work, mask); }

#else

namespace hn = hwy::HWY_NAMESPACE;

// A row's end is rounded up to a whole vector: in the workspace there is room for one, and what is beyond the picture
// counts 0 columns.
using Bytes = hn::CappedTag<std::uint8_t, kFrame>;
constexpr Bytes kBytes{};
constexpr hn::RepartitionToWide<Bytes> kWords{};
constexpr hn::RebindToSigned<hn::RepartitionToWide<Bytes> > kSigned{};

// Horizontal halves of maximum and sum of the 5x5 neighbourhood.
void enter_row(const std::uint8_t* from, int width, const CandidateWorkspace& work, int y) {
  std::uint8_t* distance = work.distance.row(y % kRing);
  std::memcpy(distance, from, static_cast<std::size_t>(width));
  std::uint8_t* most = work.most.row(y % kRing);
  std::uint16_t* sum = work.sum.row(y % kRing);
  const int lanes = static_cast<int>(hn::Lanes(kBytes));
  for (int x = 0; x < width; x += lanes) {
    const auto left = hn::LoadU(kBytes, distance + x - 2);
    const auto here = hn::LoadU(kBytes, distance + x);
    const auto right = hn::LoadU(kBytes, distance + x + 2);
    const auto next = hn::Max(hn::LoadU(kBytes, distance + x - 1), hn::LoadU(kBytes, distance + x + 1));
    hn::StoreU(hn::Max(hn::Max(left, right), hn::Max(here, next)), kBytes, most + x);
    // Even pixel x: left holds x-2 and x-1, here x and x+1, right x+2. Odd pixel x+1: left holds x-1, right x+2 and
    // x+3.
    const auto common =
        hn::Add(hn::Add(even_bytes(here), odd_bytes(here)), hn::Add(odd_bytes(left), even_bytes(right)));
    hn::StoreU(hn::Add(common, even_bytes(left)), kWords, sum + x);
    hn::StoreU(hn::Add(common, odd_bytes(right)), kWords, sum + x + lanes / 2);
  }
}

// Half of the lanes: 1 where there is a candidate. Nothing here reaches 2^15.
template <class V>
V candidates_of(V here16, V most16, V sum16, V columns16, int rows, const CandidateLimits& limits) {
  const auto set = [](int value) HWY_ATTR { return hn::Set(kSigned, static_cast<std::int16_t>(value)); };
  const auto here = hn::BitCast(kSigned, here16);
  const auto most = hn::BitCast(kSigned, most16);
  const auto sum = hn::BitCast(kSigned, sum16);
  const auto count = hn::Mul(hn::BitCast(kSigned, columns16), set(rows));
  const auto inside = hn::Lt(hn::Zero(kSigned), count);
  const auto is_low = hn::Lt(here, set(limits.low));
  const auto is_rim = hn::Lt(hn::Mul(here, set(100)), hn::Mul(most, set(limits.halo_percent)));
  const auto is_plain = hn::Or(hn::Or(hn::Lt(most, set(limits.faint)), hn::Lt(sum, hn::Mul(count, set(limits.faint)))),
                               hn::Lt(hn::Mul(sum, set(kFaintPart)), hn::Mul(most, count)));
  const auto none = hn::Or(hn::And(is_low, is_plain), hn::AndNot(is_low, is_rim));
  return hn::BitCast(kWords, hn::IfThenElseZero(hn::AndNot(none, inside), set(1)));
}

void mark(ImageView<const std::uint8_t> distance, const CandidateLimits& limits, const CandidateWorkspace& work) {
  const int width = distance.width;
  const int height = distance.height;
  const int lanes = static_cast<int>(hn::Lanes(kBytes));
  const std::uint8_t* columns = work.columns[1].data();
  for (int y = 0; y < std::min(kReach, height); ++y) enter_row(distance.row(y), width, work, y);
  for (int y = 0; y < height; ++y) {
    if (y + kReach < height) enter_row(distance.row(y + kReach), width, work, y + kReach);
    const std::uint8_t* most_rows[kRing];
    const std::uint16_t* sum_rows[kRing];
    int rows = 0;
    for (int i = 0; i < kRing; ++i) {
      const int v = y + i - kReach;
      const bool inside = v >= 0 && v < height;
      most_rows[i] = work.most.row(inside ? v % kRing : kRing);
      sum_rows[i] = work.sum.row(inside ? v % kRing : kRing);
      rows += inside ? 1 : 0;
    }
    const std::uint8_t* here_row = work.distance.row(y % kRing);
    std::uint8_t* out = work.candidates.row(y);
    for (int x = 0; x < width; x += lanes) {
      auto most = hn::LoadU(kBytes, most_rows[0] + x);
      auto even = hn::LoadU(kWords, sum_rows[0] + x);
      auto odd = hn::LoadU(kWords, sum_rows[0] + x + lanes / 2);
      for (int i = 1; i < kRing; ++i) {
        most = hn::Max(most, hn::LoadU(kBytes, most_rows[i] + x));
        even = hn::Add(even, hn::LoadU(kWords, sum_rows[i] + x));
        odd = hn::Add(odd, hn::LoadU(kWords, sum_rows[i] + x + lanes / 2));
      }
      const auto here = hn::LoadU(kBytes, here_row + x);
      const auto wide = hn::LoadU(kBytes, columns + x);
      hn::StoreU(zip_bytes(candidates_of(even_bytes(here), even_bytes(most), even, even_bytes(wide), rows, limits),
                           candidates_of(odd_bytes(here), odd_bytes(most), odd, odd_bytes(wide), rows, limits)),
                 kBytes, out + x);
    }
  }
}

void vote(const CandidateWorkspace& work, ImageView<std::uint8_t> mask) {
  const hn::RebindToSigned<Bytes> signed_bytes;
  const int lanes = static_cast<int>(hn::Lanes(kBytes));
  const std::uint8_t* columns = work.columns[0].data();
  for (int y = 0; y < mask.height; ++y) {
    const int rows = std::min(y + 1, mask.height - 1) - std::max(y - 1, 0) + 1;
    std::uint8_t* out = mask.row(y);
    for (int x = 0; x < mask.width; x += lanes) {
      const auto wide = hn::LoadU(kBytes, columns + x);
      auto voters = wide;
      for (int i = 1; i < rows; ++i) voters = hn::Add(voters, wide);
      auto votes = hn::Zero(kBytes);
      for (int v = y - 1; v <= y + 1; ++v) {
        const std::uint8_t* row = work.candidates.row(v) + x;  // row -1 and row `height` are zeros
        votes = hn::Add(
            votes, hn::Add(hn::LoadU(kBytes, row), hn::Add(hn::LoadU(kBytes, row - 1), hn::LoadU(kBytes, row + 1))));
      }
      const auto majority = hn::Lt(hn::BitCast(signed_bytes, voters), hn::BitCast(signed_bytes, hn::Add(votes, votes)));
      const auto value = hn::BitCast(kBytes, hn::VecFromMask(signed_bytes, majority));
      if (x + lanes <= mask.width) {
        hn::StoreU(value, kBytes, out + x);
      } else {
        alignas(kFrame) std::uint8_t end[kFrame];
        hn::Store(value, kBytes, end);
        std::memcpy(out + x, end, static_cast<std::size_t>(mask.width - x));
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

namespace {

HWY_EXPORT(mark);
HWY_EXPORT(vote);

}  // namespace

CandidateWorkspace CandidateWorkspace::create(int width, int height, Arena& arena) noexcept {
  const auto framed = [&](int rows) {
    ImageView<std::uint8_t> all = arena.image<std::uint8_t>(width + 2 * kFrame, rows + 2);
    return all.empty() ? all : all.window(kFrame, 1, width, rows);
  };
  CandidateWorkspace work;
  work.distance = framed(kRing);
  work.candidates = framed(height);
  work.most = arena.image<std::uint8_t>(width, kRing + 1);
  work.sum = arena.image<std::uint16_t>(width + kFrame, kRing + 1);
  for (int reach = 1; reach <= kReach; ++reach) {
    const std::span<std::uint8_t> columns = arena.array<std::uint8_t>(static_cast<std::size_t>(width) + kFrame);
    work.columns[static_cast<std::size_t>(reach) - 1] = columns;
    if (columns.empty()) continue;
    for (int x = 0; x < width; ++x) {
      columns[x] = static_cast<std::uint8_t>(std::min(x + reach, width - 1) - std::max(x - reach, 0) + 1);
    }
  }
  return work;
}

void mark_candidates_reference(ImageView<const std::uint8_t> distance, const CandidateLimits& limits,
                               const CandidateWorkspace& work) noexcept {
  for (int y = 0; y < distance.height; ++y) {
    for (int x = 0; x < distance.width; ++x) {
      int most = 0;
      int sum = 0;
      int count = 0;
      for (int v = std::max(y - kReach, 0); v <= std::min(y + kReach, distance.height - 1); ++v) {
        for (int u = std::max(x - kReach, 0); u <= std::min(x + kReach, distance.width - 1); ++u) {
          most = std::max<int>(most, distance.at(u, v));
          sum += distance.at(u, v);
          ++count;
        }
      }
      const int here = distance.at(x, y);
      const bool strong = here >= limits.low && here * 100 >= most * limits.halo_percent;
      const bool faint =
          here < limits.low && most >= limits.faint && sum >= limits.faint * count && sum * kFaintPart >= most * count;
      work.candidates.at(x, y) = strong || faint ? 1 : 0;
    }
  }
}

void keep_majority_reference(const CandidateWorkspace& work, ImageView<std::uint8_t> mask) noexcept {
  for (int y = 0; y < mask.height; ++y) {
    for (int x = 0; x < mask.width; ++x) {
      int votes = 0;
      int voters = 0;
      for (int v = std::max(y - 1, 0); v <= std::min(y + 1, mask.height - 1); ++v) {
        for (int u = std::max(x - 1, 0); u <= std::min(x + 1, mask.width - 1); ++u) {
          votes += work.candidates.at(u, v);
          ++voters;
        }
      }
      mask.at(x, y) = 2 * votes > voters ? 255 : 0;
    }
  }
}

void mark_candidates(ImageView<const std::uint8_t> distance, const CandidateLimits& limits,
                     const CandidateWorkspace& work) noexcept {
  if (simd_in_use() == SimdTarget::kScalar) return mark_candidates_reference(distance, limits, work);
  HWY_DYNAMIC_DISPATCH(mark)(distance, limits, work);
}

void keep_majority(const CandidateWorkspace& work, ImageView<std::uint8_t> mask) noexcept {
  if (simd_in_use() == SimdTarget::kScalar) return keep_majority_reference(work, mask);
  HWY_DYNAMIC_DISPATCH(vote)(work, mask);
}

}  // namespace stereotrack

#endif
