#include "pipeline/motion/candidate_kernel.hpp"

#include <gtest/gtest.h>

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

Plane copy_of(ImageView<const std::uint8_t> picture) {
  Plane copy(picture.height, picture.width);
  for (int y = 0; y < picture.height; ++y) std::copy_n(picture.row(y), picture.width, copy[y]);
  return copy;
}

struct Masks {
  Plane candidates;
  Plane mask;
};

template <class Mark, class Keep>
Masks masks_of(Plane distance, const CandidateLimits& limits, Mark&& mark, Keep&& keep) {
  Arena arena;
  const CandidateWorkspace work = CandidateWorkspace::create(distance.cols, distance.rows, arena);
  EXPECT_FALSE(arena.failed());
  // Two columns more than the mask, which must stay as they are.
  Plane wide(distance.rows, distance.cols + 2, std::uint8_t{7});
  Plane part = wide(cv::Rect(1, 0, distance.cols, distance.rows));
  Plane before(distance.size(), std::uint8_t{255});
  mark(view(before), limits, work);  // what the workspace holds from the last picture must not matter
  mark(view(distance), limits, work);
  keep(work, view(part));
  EXPECT_EQ(cv::countNonZero(wide.col(0) != 7), 0);
  EXPECT_EQ(cv::countNonZero(wide.col(distance.cols + 1) != 7), 0);
  return {copy_of(work.candidates), part.clone()};
}

void expect_reference_on_each_target(const Plane& distance, const CandidateLimits& limits) {
  const Masks expected = masks_of(distance, limits, mark_candidates_reference, keep_majority_reference);
  on_each_target([&] {
    const Masks got = masks_of(distance, limits, mark_candidates, keep_majority);
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

// Pixels that just are, and just are not, candidates: the definition worked by hand.
TEST(CandidateKernel, LimitsAreInclusive) {
  on_each_target([] {
    const auto centre = [](const Plane& distance, const CandidateLimits& limits) {
      return masks_of(distance, limits, mark_candidates, keep_majority).candidates(5, 50);
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
