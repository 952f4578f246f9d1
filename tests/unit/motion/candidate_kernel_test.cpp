#include "pipeline/motion/candidate_kernel.hpp"

#include <gtest/gtest.h>

#include <bit>

#include "pictures.hpp"
#include "tests/support/each_target.hpp"

namespace stereotrack {
namespace {

using test::on_each_target;
using test::Plane;
using test::random_plane;
using test::view;

/// Noise with a block of strong pixels and one of faint ones, so that each branch is taken somewhere.
Plane scene(cv::Size size, std::uint64_t seed) {
  Plane distance = random_plane(size, 0, 9, seed);
  const cv::Rect all(0, 0, size.width, size.height);
  distance(cv::Rect(size.width / 4, size.height / 4, size.width / 3 + 1, size.height / 3 + 1) & all) += 60;
  distance(cv::Rect(size.width / 2, size.height / 3, size.width / 3 + 1, size.height / 2 + 1) & all) += 5;
  const Plane spikes = random_plane(size, 0, 255, seed + 1);
  distance.setTo(200, spikes > 250);
  return distance;
}

/// 0 or 1. Also that bits after a row's end are 0.
Plane copy_of(const BitMask& mask) {
  Plane copy(mask.height, mask.width);
  for (int y = 0; y < mask.height; ++y) {
    for (int x = 0; x < mask.width; ++x) copy(y, x) = mask.at(x, y) ? 1 : 0;
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
  const cv::Rect all(0, 0, candidates.cols, candidates.rows);
  Plane mask(candidates.size());
  for (int y = 0; y < mask.rows; ++y) {
    for (int x = 0; x < mask.cols; ++x) {
      const cv::Rect near = cv::Rect(x - 1, y - 1, 3, 3) & all;
      mask(y, x) = 2 * cv::countNonZero(candidates(near)) > near.area() ? 1 : 0;
    }
  }
  return mask;
}

template <class Mark>
Masks masks_of(const Plane& distance, const CandidateLimits& limits, Mark&& mark) {
  Arena arena;
  const CandidateWorkspace work = CandidateWorkspace::create(distance.cols, distance.rows, arena);
  const BitMask mask = BitMask::create(distance.cols, distance.rows, arena);
  EXPECT_FALSE(arena.failed());
  Plane before(distance.size(), std::uint8_t{255});
  mark(view(before), limits, work);  // what the workspace holds from the last picture must not matter
  keep_majority(work, mask);
  Plane copy = distance.clone();
  mark(view(copy), limits, work);
  keep_majority(work, mask);
  return {copy_of(work.candidates), copy_of(mask)};
}

void expect_reference_on_each_target(const Plane& distance, const CandidateLimits& limits) {
  const Masks expected = masks_of(distance, limits, mark_candidates_reference);
  EXPECT_EQ(cv::countNonZero(expected.mask != majority_of(expected.candidates)), 0) << distance.size();
  on_each_target([&] {
    const Masks got = masks_of(distance, limits, mark_candidates);
    EXPECT_EQ(cv::countNonZero(got.candidates != expected.candidates), 0) << distance.size();
    EXPECT_EQ(cv::countNonZero(got.mask != expected.mask), 0) << distance.size();
  });
}

TEST(CandidateKernel, EveryWidthIsTheReference) {
  for (int width = 1; width <= 140; ++width) {
    expect_reference_on_each_target(scene({width, 9}, static_cast<std::uint64_t>(width)), {16, 5, 25});
  }
}

TEST(CandidateKernel, EveryHeightIsTheReference) {
  for (int height = 1; height <= 12; ++height) {
    expect_reference_on_each_target(scene({70, height}, static_cast<std::uint64_t>(height)), {16, 5, 25});
  }
}

TEST(CandidateKernel, ExtremeLimitsAreTheReference) {
  const Plane distance = random_plane({97, 33}, 0, 255, 3);
  for (const int low : {0, 1, 120, 240}) {
    for (const int faint : {2, 128, 240}) {
      for (const int halo : {0, 25, 90}) expect_reference_on_each_target(distance, {low, faint, halo});
    }
  }
  expect_reference_on_each_target(Plane(33, 97, std::uint8_t{255}), {240, 240, 90});
  expect_reference_on_each_target(Plane(33, 97, std::uint8_t{0}), {0, 0, 0});
}

// Quiet pictures, in which most vectors are passed over, with a few pixels that must not be.
TEST(CandidateKernel, SparsePicturesAreTheReference) {
  for (std::uint64_t seed = 1; seed <= 40; ++seed) {
    Plane distance = random_plane({200, 20}, 0, 3, seed);
    cv::RNG random(seed);
    for (int i = 0; i < 6; ++i) {
      const cv::Rect spot(random.uniform(0, 198), random.uniform(0, 18), random.uniform(1, 12), random.uniform(1, 12));
      distance(spot & cv::Rect(0, 0, 200, 20)) += random.uniform(1, 20);
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
      return masks_of(distance, limits, mark_candidates).candidates(5, 50);
    };
    Plane distance(11, 101, std::uint8_t{0});
    distance(5, 50) = 16;
    EXPECT_EQ(centre(distance, {16, 20, 0}), 1);
    EXPECT_EQ(centre(distance, {17, 20, 0}), 0);
    distance(7, 52) = 64;  // 16 is 25 % of 64, not of 65
    EXPECT_EQ(centre(distance, {16, 250, 25}), 1);
    distance(7, 52) = 65;
    EXPECT_EQ(centre(distance, {16, 250, 25}), 0);
    distance.setTo(5);  // a mean of 5, half of at most 10
    distance(5, 52) = 10;
    distance(5, 51) = 0;
    EXPECT_EQ(centre(distance, {16, 5, 25}), 1);
    EXPECT_EQ(centre(distance, {16, 6, 25}), 0);
    distance(5, 52) = 11;
    EXPECT_EQ(centre(distance, {16, 5, 25}), 0);
  });
}

}  // namespace
}  // namespace stereotrack
