#include "pipeline/motion/candidate_kernel.hpp"

#include <gtest/gtest.h>

#include <algorithm>

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

Plane copy_of(ImageView<const std::uint8_t> picture) {
  Plane copy(picture.width, picture.height);
  for (int y = 0; y < picture.height; ++y) std::copy_n(picture.row(y), picture.width, copy.row(y));
  return copy;
}

struct Masks {
  Plane candidates;
  Plane mask;
};

template <class Mark, class Keep>
Masks masks_of(const Plane& distance, const CandidateLimits& limits, Mark&& mark, Keep&& keep) {
  Arena arena;
  const CandidateWorkspace work = CandidateWorkspace::create(distance.width(), distance.height(), arena);
  EXPECT_FALSE(arena.failed());
  Plane mask(distance.width(), distance.height());
  const Plane before(distance.width(), distance.height(), 255);
  mark(before.view(), limits, work);  // what the workspace holds from the last picture must not matter
  mark(distance.view(), limits, work);
  keep(work, mask.view());
  EXPECT_TRUE(mask.margins_untouched());
  return {copy_of(work.candidates), mask};
}

void expect_reference_on_each_target(const Plane& distance, const CandidateLimits& limits) {
  const Masks expected = masks_of(distance, limits, mark_candidates_reference, keep_majority_reference);
  on_each_target([&] {
    const Masks got = masks_of(distance, limits, mark_candidates, keep_majority);
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

// Pixels that just are, and just are not, candidates: the definition worked by hand.
TEST(CandidateKernel, LimitsAreInclusive) {
  on_each_target([] {
    const auto centre = [](const Plane& distance, const CandidateLimits& limits) {
      return masks_of(distance, limits, mark_candidates, keep_majority).candidates.at(50, 5);
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
