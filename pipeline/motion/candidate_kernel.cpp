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

#else

namespace hn = hwy::HWY_NAMESPACE;

// A row's end is rounded up to a whole vector: in the workspace there is room for one, and what is beyond the picture
// counts 0 columns.
using Bytes = hn::CappedTag<std::uint8_t, kFrame>;
constexpr Bytes kBytes{};
constexpr hn::RepartitionToWide<Bytes> kWords{};
constexpr hn::RebindToSigned<hn::RepartitionToWide<Bytes> > kSigned{};
using Byte = hn::Vec<Bytes>;

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

/// The five rows around one, `rows` of which lie in the picture.
struct Around {
  const std::uint8_t* distance[kRing];
  const std::uint8_t* columns;
  int rows;
};

// A vector of pixels, each of which may be a candidate: 1 where there is one.
Byte look_closely(const Around& around, int x, const CandidateLimits& limits) {
  Byte most = hn::Zero(kBytes);
  auto even = hn::Zero(kWords);
  auto odd = even;
  for (const std::uint8_t* row : around.distance) {
    const Byte left = hn::LoadU(kBytes, row + x - 2);
    const Byte here = hn::LoadU(kBytes, row + x);
    const Byte right = hn::LoadU(kBytes, row + x + 2);
    const Byte next = hn::Max(hn::LoadU(kBytes, row + x - 1), hn::LoadU(kBytes, row + x + 1));
    most = hn::Max(hn::Max(most, next), hn::Max(hn::Max(left, right), here));
    // Even pixel x: left holds x-2 and x-1, here x and x+1, right x+2. Odd pixel x+1: left holds x-1, right x+2 and
    // x+3.
    const auto common =
        hn::Add(hn::Add(even_bytes(here), odd_bytes(here)), hn::Add(odd_bytes(left), even_bytes(right)));
    even = hn::Add(even, hn::Add(common, even_bytes(left)));
    odd = hn::Add(odd, hn::Add(common, odd_bytes(right)));
  }
  const Byte here = hn::LoadU(kBytes, around.distance[kReach] + x);
  const Byte wide = hn::LoadU(kBytes, around.columns + x);
  return zip_bytes(candidates_of(even_bytes(here), even_bytes(most), even, even_bytes(wide), around.rows, limits),
                   candidates_of(odd_bytes(here), odd_bytes(most), odd, odd_bytes(wide), around.rows, limits));
}

void mark(ImageView<const std::uint8_t> distance, const CandidateLimits& limits, const CandidateWorkspace& work) {
  const int width = distance.width;
  const int height = distance.height;
  const int lanes = static_cast<int>(hn::Lanes(kBytes));
  const Byte low = hn::Set(kBytes, static_cast<std::uint8_t>(limits.low));
  std::uint8_t* sums = work.column_sums.data() + kFrame;
  std::uint8_t* least = work.least_sums.data();
  const auto enter = [&](int y) {
    std::memcpy(work.distance.row(y % kRing), distance.row(y), static_cast<std::size_t>(width));
  };
  for (int y = 0; y < std::min(kReach, height); ++y) enter(y);
  int rows_before = 0;
  for (int y = 0; y < height; ++y) {
    if (y + kReach < height) enter(y + kReach);
    Around around{.distance = {}, .columns = work.columns.data(), .rows = 0};
    for (int i = 0; i < kRing; ++i) {
      const int v = y + i - kReach;
      const bool inside = v >= 0 && v < height;
      around.distance[i] = work.distance.row(inside ? v % kRing : kRing);
      around.rows += inside ? 1 : 0;
    }
    if (around.rows != rows_before) {
      rows_before = around.rows;
      for (int x = 0; x < width + kFrame; ++x) {
        const int sum = around.columns[x] == 0 ? 255 : limits.faint * around.rows * around.columns[x];
        least[x] = static_cast<std::uint8_t>(std::min(sum, 255));
      }
    }
    for (int x = 0; x < width; x += lanes) {
      const auto row = [&](int i) HWY_ATTR { return hn::LoadU(kBytes, around.distance[i] + x); };
      const Byte outer = hn::SaturatedAdd(hn::SaturatedAdd(row(0), row(1)), hn::SaturatedAdd(row(3), row(4)));
      hn::StoreU(hn::SaturatedAdd(outer, row(2)), kBytes, sums + x);
    }
    auto* bits = reinterpret_cast<std::uint8_t*>(work.candidates.row(y));
    for (int x = 0; x < width; x += lanes) {
      // Most vectors hold no pixel that is strong enough, nor one whose neighbourhood is: sums that saturate tell, as
      // they are never too small to pass.
      const auto column = [&](int i) HWY_ATTR { return hn::LoadU(kBytes, sums + x + i); };
      const Byte outer =
          hn::SaturatedAdd(hn::SaturatedAdd(column(-2), column(-1)), hn::SaturatedAdd(column(1), column(2)));
      const Byte sum = hn::SaturatedAdd(outer, column(0));
      const Byte here = hn::LoadU(kBytes, around.distance[kReach] + x);
      const auto strong = hn::Eq(hn::Max(here, low), here);
      const auto faint = hn::Eq(hn::Max(sum, hn::LoadU(kBytes, least + x)), sum);
      if (hn::AllFalse(kBytes, hn::Or(strong, faint))) {
        std::memset(bits + x / 8, 0, static_cast<std::size_t>(lanes) / 8);
      } else {
        const auto found = hn::Ne(look_closely(around, x, limits), hn::Zero(kBytes));
        hn::StoreMaskBits(kBytes, found, bits + x / 8);
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

using Votes = CandidateWorkspace::Votes;

// How many of each pixel and its two neighbours in the row are set. False where none is.
bool count_row(const std::uint64_t* bits, int words, const Votes& votes) noexcept {
  std::uint64_t* ones = votes.ones.data();
  std::uint64_t* twos = votes.twos.data();
  std::uint64_t any = 0;
  std::uint64_t before = 0;
  std::uint64_t here = bits[0];
  for (int w = 0; w < words; ++w) {
    const std::uint64_t next = w + 1 < words ? bits[w + 1] : 0;
    const std::uint64_t left = here << 1 | before >> 63;
    const std::uint64_t right = here >> 1 | next << 63;
    ones[w] = left ^ here ^ right;
    twos[w] = (left & here) | (right & (left | here));
    any |= here;
    before = here;
    here = next;
  }
  return any != 0;
}

// Three numbers of two bits added: where the sum is at least four, and at least five.
struct Sum {
  std::uint64_t four;
  std::uint64_t five;
};
Sum sum_of(const std::array<Votes, 3>& rows, int w) noexcept {
  const std::uint64_t a1 = rows[0].ones[w];
  const std::uint64_t b1 = rows[1].ones[w];
  const std::uint64_t c1 = rows[2].ones[w];
  const std::uint64_t a2 = rows[0].twos[w];
  const std::uint64_t b2 = rows[1].twos[w];
  const std::uint64_t c2 = rows[2].twos[w];
  const std::uint64_t carry = (a1 & b1) | (c1 & (a1 | b1));
  const std::uint64_t odd_twos = a2 ^ b2 ^ c2;
  const std::uint64_t more = odd_twos & carry;
  const std::uint64_t two_twos = (a2 & b2) | (c2 & (a2 | b2));
  const std::uint64_t four = two_twos | more;
  const std::uint64_t eight = two_twos & more;
  return {four, eight | (four & ((odd_twos ^ carry) | (a1 ^ b1 ^ c1)))};
}

bool is_majority(const BitMask& candidates, int x, int y) noexcept {
  int votes = 0;
  int voters = 0;
  for (int v = std::max(y - 1, 0); v <= std::min(y + 1, candidates.height - 1); ++v) {
    for (int u = std::max(x - 1, 0); u <= std::min(x + 1, candidates.width - 1); ++u) {
      votes += candidates.at(u, v) ? 1 : 0;
      ++voters;
    }
  }
  return 2 * votes > voters;
}

}  // namespace

CandidateWorkspace CandidateWorkspace::create(int width, int height, Arena& arena) noexcept {
  const auto row = [&](int frames) {
    return arena.array<std::uint8_t>(static_cast<std::size_t>(width) + static_cast<std::size_t>(frames) * kFrame);
  };
  CandidateWorkspace work;
  work.candidates = BitMask::create(width, height, arena);
  const ImageView<std::uint8_t> ring = arena.image<std::uint8_t>(width + 2 * kFrame, kRing + 1);
  if (!ring.empty()) work.distance = ring.window(kFrame, 0, width, kRing + 1);
  work.column_sums = row(3);
  work.columns = row(1);
  work.least_sums = row(1);
  for (Votes& votes : work.votes) {
    votes.ones = arena.array<std::uint64_t>(static_cast<std::size_t>(BitMask::words_of(width)));
    votes.twos = arena.array<std::uint64_t>(static_cast<std::size_t>(BitMask::words_of(width)));
  }
  if (arena.failed()) return {};
  for (int x = 0; x < width; ++x) {
    work.columns[x] = static_cast<std::uint8_t>(std::min(x + kReach, width - 1) - std::max(x - kReach, 0) + 1);
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
      work.candidates.set(x, y, strong || faint);
    }
  }
}

void mark_candidates(ImageView<const std::uint8_t> distance, const CandidateLimits& limits,
                     const CandidateWorkspace& work) noexcept {
  if (simd_in_use() == SimdTarget::kScalar) return mark_candidates_reference(distance, limits, work);
  HWY_DYNAMIC_DISPATCH(mark)(distance, limits, work);
}

void keep_majority(const CandidateWorkspace& work, const BitMask& mask) noexcept {
  const BitMask& candidates = work.candidates;
  const int words = mask.words_a_row();
  const int last = mask.height - 1;
  std::array<bool, 3> any{};
  const auto enter = [&](int y) {
    const std::size_t slot = static_cast<std::size_t>(y) % 3;
    if (y <= last) {
      any[slot] = count_row(candidates.row(y), words, work.votes[slot]);
      return;
    }
    any[slot] = false;
    std::fill_n(work.votes[slot].ones.begin(), words, std::uint64_t{0});
    std::fill_n(work.votes[slot].twos.begin(), words, std::uint64_t{0});
  };
  // Above the first row nothing lies, as under the last one.
  std::fill_n(work.votes[2].ones.begin(), words, std::uint64_t{0});
  std::fill_n(work.votes[2].twos.begin(), words, std::uint64_t{0});
  enter(0);
  for (int y = 0; y <= last; ++y) {
    enter(y + 1);
    std::uint64_t* out = mask.row(y);
    if (!any[0] && !any[1] && !any[2]) {
      std::fill_n(out, words, std::uint64_t{0});
      continue;
    }
    // Of nine voters five are most, of six at the picture's sides four.
    const bool side = y == 0 || y == last;
    for (int w = 0; w < words; ++w) {
      const Sum sum = sum_of(work.votes, w);
      std::uint64_t few = side ? ~std::uint64_t{0} : 0;
      if (w == 0) few |= 1;
      if (w == words - 1) few |= std::uint64_t{1} << (mask.width - 1) % 64;
      out[w] = sum.five | (sum.four & few);
    }
    out[words - 1] &= BitMask::last_word(mask.width);
  }
  // Its corners have four, and a picture of one row or column has fewer everywhere.
  const bool narrow = mask.width == 1 || mask.height == 1;
  for (int y = 0; y <= last; y += narrow ? 1 : std::max(last, 1)) {
    for (int x = 0; x < mask.width; x += narrow ? 1 : std::max(mask.width - 1, 1)) {
      mask.set(x, y, is_majority(candidates, x, y));
    }
  }
}

}  // namespace stereotrack

#endif
