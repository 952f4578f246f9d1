#include "pipeline/motion/candidate_kernel.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <random>

#include "pipeline/core/arena.hpp"
#include "pipeline/core/rect.hpp"
#include "tests/support/each_target.hpp"
#include "tests/support/grid.hpp"

namespace stereotrack {
namespace {

using test::on_each_target;
using Plane = test::Grid<std::uint8_t>;

/// Noise with a block of strong pixels and one of faint ones, so that each branch is taken somewhere.
Plane scene(int width, int height, unsigned seed) {
  Plane distance = test::random_grid(width, height, 0, 9, seed);
  const auto add = [&](const Rect& box, int by) {
    for (int y = box.top; y < std::min(box.top + box.height, height); ++y) {
      for (int x = box.left; x < std::min(box.left + box.width, width); ++x) {
        distance.at(x, y) = static_cast<std::uint8_t>(distance.at(x, y) + by);
      }
    }
  };
  add({width / 4, height / 4, width / 3 + 1, height / 3 + 1}, 60);
  add({width / 2, height / 3, width / 3 + 1, height / 2 + 1}, 5);
  const Plane spikes = test::random_grid(width, height, 0, 255, seed + 1);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      if (spikes.at(x, y) > 250) distance.at(x, y) = 200;
    }
  }
  return distance;
}

/// 0 or 1. Also that bits after a row's end are 0.
Plane copy_of(const BitMask& mask) {
  Plane copy(mask.width, mask.height);
  for (int y = 0; y < mask.height; ++y) {
    for (int x = 0; x < mask.width; ++x) copy.at(x, y) = mask.at(x, y) ? 1 : 0;
    EXPECT_EQ(mask.row(y)[mask.words_a_row() - 1] & ~BitMask::last_word(mask.width), 0U);
  }
  return copy;
}

struct Masks {
  Plane candidates;
  Plane mask;
};

/// Step 3, pixel by pixel.
Plane majority_of(const Plane& candidates) {
  const Rect all{0, 0, candidates.width(), candidates.height()};
  Plane mask(all.width, all.height);
  for (int y = 0; y < all.height; ++y) {
    for (int x = 0; x < all.width; ++x) {
      const Rect near = intersect({x - 1, y - 1, 3, 3}, all);
      int votes = 0;
      for (int v = near.top; v < near.bottom(); ++v) {
        for (int u = near.left; u < near.right(); ++u) votes += candidates.at(u, v);
      }
      mask.at(x, y) = 2 * votes > near.area() ? 1 : 0;
    }
  }
  return mask;
}

template <class Mark>
Masks masks_of(const Plane& distance, const CandidateLimits& limits, Mark&& mark) {
  Arena arena;
  const CandidateWorkspace work = CandidateWorkspace::create(distance.width(), distance.height(), arena);
  const BitMask mask = BitMask::create(distance.width(), distance.height(), arena);
  EXPECT_FALSE(arena.failed());
  const Plane before(distance.width(), distance.height(), 255);
  mark(before.view(), limits, work);  // what the workspace holds from the last picture must not matter
  keep_majority(work, mask);
  mark(distance.view(), limits, work);
  keep_majority(work, mask);
  return {copy_of(work.candidates), copy_of(mask)};
}

void expect_reference_on_each_target(const Plane& distance, const CandidateLimits& limits) {
  const Masks expected = masks_of(distance, limits, mark_candidates_reference);
  EXPECT_TRUE(expected.mask == majority_of(expected.candidates)) << distance.width() << " x " << distance.height();
  on_each_target([&] {
    const Masks got = masks_of(distance, limits, mark_candidates);
    EXPECT_TRUE(got.candidates == expected.candidates) << distance.width() << " x " << distance.height();
    EXPECT_TRUE(got.mask == expected.mask) << distance.width() << " x " << distance.height();
  });
}

TEST(CandidateKernel, EveryWidthIsTheReference) {
  for (int width = 1; width <= 140; ++width) {
    expect_reference_on_each_target(scene(width, 9, static_cast<unsigned>(width)), {16, 5, 25});
  }
}

TEST(CandidateKernel, EveryHeightIsTheReference) {
  for (int height = 1; height <= 12; ++height) {
    expect_reference_on_each_target(scene(70, height, static_cast<unsigned>(height)), {16, 5, 25});
  }
}

TEST(CandidateKernel, ExtremeLimitsAreTheReference) {
  const Plane distance = test::random_grid(97, 33, 0, 255, 3);
  for (const int low : {0, 1, 120, 240}) {
    for (const int faint : {2, 128, 240}) {
      for (const int halo : {0, 25, 90}) expect_reference_on_each_target(distance, {low, faint, halo});
    }
  }
  expect_reference_on_each_target(Plane(97, 33, 255), {240, 240, 90});
  expect_reference_on_each_target(Plane(97, 33, 0), {0, 0, 0});
}

// Quiet pictures, in which most vectors are passed over, with a few pixels that must not be.
TEST(CandidateKernel, SparsePicturesAreTheReference) {
  for (unsigned seed = 1; seed <= 40; ++seed) {
    Plane distance = test::random_grid(200, 20, 0, 3, seed);
    std::mt19937 random(seed);
    const auto draw = [&](unsigned from, unsigned to) { return static_cast<int>(from + random() % (to - from)); };
    for (int i = 0; i < 6; ++i) {
      const int left = draw(0, 198);
      const int top = draw(0, 18);
      const int width = draw(1, 12);
      const int height = draw(1, 12);
      const int by = draw(1, 20);
      const Rect spot = intersect({left, top, width, height}, {0, 0, 200, 20});
      for (int y = spot.top; y < spot.bottom(); ++y) {
        for (int x = spot.left; x < spot.right(); ++x) {
          distance.at(x, y) = static_cast<std::uint8_t>(distance.at(x, y) + by);
        }
      }
    }
    expect_reference_on_each_target(distance, {16, 5, 25});
    expect_reference_on_each_target(distance, {16, 12, 25});  // 25 times faint is more than a byte
  }
}

// All ways in which nine pixels may vote.
TEST(CandidateKernel, EveryNeighbourhoodIsAMajorityOrNot) {
  Arena arena;
  const CandidateWorkspace work = CandidateWorkspace::create(512 * 4, 5, arena);
  const BitMask mask = BitMask::create(512 * 4, 5, arena);
  for (int votes = 0; votes < 512; ++votes) {
    for (int i = 0; i < 9; ++i) work.candidates.set(4 * votes + i % 3 + 1, 1 + i / 3, (votes >> i & 1) != 0);
  }
  keep_majority(work, mask);
  for (unsigned votes = 0; votes < 512; ++votes) {
    EXPECT_EQ(mask.at(4 * static_cast<int>(votes) + 2, 2), std::popcount(votes) >= 5) << votes;
  }
}

// Pixels that just are, and just are not, candidates: the definition worked by hand.
TEST(CandidateKernel, LimitsAreInclusive) {
  on_each_target([] {
    const auto centre = [](const Plane& distance, const CandidateLimits& limits) {
      return masks_of(distance, limits, mark_candidates).candidates.at(50, 5);
    };
    Plane distance(101, 11);
    distance.at(50, 5) = 16;
    EXPECT_EQ(centre(distance, {16, 20, 0}), 1);
    EXPECT_EQ(centre(distance, {17, 20, 0}), 0);
    distance.at(52, 7) = 64;  // 16 is 25 % of 64, not of 65
    EXPECT_EQ(centre(distance, {16, 250, 25}), 1);
    distance.at(52, 7) = 65;
    EXPECT_EQ(centre(distance, {16, 250, 25}), 0);
    distance = Plane(101, 11, 5);  // a mean of 5, half of at most 10
    distance.at(52, 5) = 10;
    distance.at(51, 5) = 0;
    EXPECT_EQ(centre(distance, {16, 5, 25}), 1);
    EXPECT_EQ(centre(distance, {16, 6, 25}), 0);
    distance.at(52, 5) = 11;
    EXPECT_EQ(centre(distance, {16, 5, 25}), 0);
  });
}

}  // namespace
}  // namespace stereotrack
