#include "pipeline/track/features_kernel.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <vector>

#include "tests/support/each_target.hpp"

namespace stereotrack {
namespace {

/// A picture of noise without a byte of padding: what reads beyond it is found by the address sanitizer.
struct Noise {
  Noise(int width, int height, unsigned seed, int levels = 256)
      : pixels(static_cast<std::size_t>(width) * static_cast<std::size_t>(height)),
        view{pixels.data(), width, height, width} {
    std::mt19937 engine(seed);
    for (std::uint8_t& pixel : pixels) {
      pixel =
          static_cast<std::uint8_t>(engine() % static_cast<unsigned>(levels) * 255 / static_cast<unsigned>(levels - 1));
    }
  }
  std::vector<std::uint8_t> pixels;
  ImageView<const std::uint8_t> view;
};

std::vector<int> values_of(const PatchPlace& place) { return {place.cost, place.x, place.y}; }

TEST(FeaturesKernel, TheBestPlaceIsTheReferencesForEveryWindow) {
  for (const int levels : {2, 256}) {  // black and white: the largest differences, and ties
    const Noise noise(kMostPlaces + kPatchSide - 1, 30 + kPatchSide - 1, 5, levels);
    const Noise cut(kPatchSide, kPatchSide, 6, levels);
    Patch patch;
    std::copy(cut.pixels.begin(), cut.pixels.end(), patch.begin());
    for (int width = 1; width <= kMostPlaces; ++width) {
      for (const int height : {1, 2, 3, 4, 5, 6, 7, 11, 30}) {
        if (width > 20 && height > 3) continue;
        for (const int left : {0, (kMostPlaces - width) / 2, kMostPlaces - width}) {
          const Rect window{kPatchReach + left, kPatchReach + 30 - height, width, height};
          const std::vector<int> expected = values_of(best_place_reference(patch, noise.view, window));
          test::on_each_target(
              [&] { EXPECT_EQ(values_of(best_place(patch, noise.view, window)), expected) << width << ' ' << height; });
        }
      }
    }
  }
}

// What fits in the middle is known beforehand, and the rest is left as soon as it is worse; of ties the first counts
// all the same, before the middle and after it.
TEST(FeaturesKernel, APatchOfThePictureIsFoundWhereverItStands) {
  constexpr int kSide = 40;
  for (const int period : {kSide, 6}) {  // the picture once, or over and over
    Noise picture(kSide, kSide, 8);
    for (int y = 0; y < kSide; ++y) {
      for (int x = 0; x < kSide; ++x) {
        picture.pixels[static_cast<std::size_t>(y * kSide + x)] = picture.view.at(x % period, y % period);
      }
    }
    for (const int side : {1, 2, 5, 8, 9, 16, 17}) {
      const Rect window{kPatchReach + 3, kPatchReach + 5, side, side};
      for (int y = window.top; y < window.bottom(); ++y) {
        for (int x = window.left; x < window.right(); ++x) {
          Patch patch;
          for (int v = 0; v < kPatchSide; ++v) {
            std::copy_n(picture.view.row(y + v - kPatchReach) + x - kPatchReach, kPatchSide,
                        patch.begin() + v * kPatchSide);
          }
          const std::vector<int> expected = values_of(best_place_reference(patch, picture.view, window));
          EXPECT_EQ(expected[0], 0);
          test::on_each_target(
              [&] { EXPECT_EQ(values_of(best_place(patch, picture.view, window)), expected) << x << ' ' << y; });
        }
      }
    }
  }
}

TEST(FeaturesKernel, TheLargestWindowIsTheReferences) {
  const Noise noise(kMostPlaces + kPatchSide - 1, kMostPlaces + kPatchSide - 1, 5);
  const Noise cut(kPatchSide, kPatchSide, 6);
  Patch patch;
  std::copy(cut.pixels.begin(), cut.pixels.end(), patch.begin());
  const Rect window{kPatchReach, kPatchReach, kMostPlaces, kMostPlaces};
  const std::vector<int> expected = values_of(best_place_reference(patch, noise.view, window));
  test::on_each_target([&] { EXPECT_EQ(values_of(best_place(patch, noise.view, window)), expected); });
}

// Half black, half white against its negative: by hand.
TEST(FeaturesKernel, AMeanDifferenceCostsNothing) {
  Noise noise(kPatchSide, kPatchSide, 3, 100);
  Patch patch;
  for (std::size_t i = 0; i < patch.size(); ++i) {
    noise.pixels[i] = static_cast<std::uint8_t>(noise.pixels[i] / 2);
    patch[i] = static_cast<std::uint8_t>(noise.pixels[i] + 100);
  }
  test::on_each_target([&] {
    const std::int32_t cost = best_place(patch, noise.view, {kPatchReach, kPatchReach, 1, 1}).cost;
    EXPECT_EQ(cost, 0);
  });
  // One pixel more by 81: the others are 1 under the mean difference, it 80 over; 160 grey levels in all.
  patch[40] = static_cast<std::uint8_t>(patch[40] + (patch[40] < 150 ? 81 : -81));
  test::on_each_target([&] {
    const std::int32_t cost = best_place(patch, noise.view, {kPatchReach, kPatchReach, 1, 1}).cost;
    EXPECT_EQ(cost, 160);
  });
}

TEST(FeaturesKernel, TensorsAreTheReferenceForEveryCountAndPlace) {
  for (const int levels : {2, 256}) {
    const Noise noise(kMostTensors + 12, 8, 9, levels);
    for (int count = 1; count <= kMostTensors; ++count) {
      for (const int x : {kTensorReach + 1, noise.view.width - kTensorReach - 1 - count}) {
        std::vector<Tensor> expected(static_cast<std::size_t>(count));
        tensors_reference(noise.view, x, 4, count, expected.data());
        test::on_each_target([&] {
          std::vector<Tensor> got(expected.size());
          tensors(noise.view, x, 4, count, got.data());
          for (std::size_t i = 0; i < got.size(); ++i) {
            EXPECT_EQ(got[i].a, expected[i].a) << count << ' ' << i;
            EXPECT_EQ(got[i].b, expected[i].b) << count << ' ' << i;
            EXPECT_EQ(got[i].c, expected[i].c) << count << ' ' << i;
          }
        });
      }
    }
  }
}

// A step of 10 across the columns: gx = 10 in the two columns beside it.
TEST(FeaturesKernel, AStepHasGradientsAcrossIt) {
  Noise picture(12, 12, 1);
  for (std::size_t i = 0; i < picture.pixels.size(); ++i) picture.pixels[i] = i % 12 < 6 ? 50 : 60;
  test::on_each_target([&] {
    Tensor tensor;
    tensors(picture.view, 6, 6, 1, &tensor);
    EXPECT_EQ(tensor.a, 2 * 5 * 100);
    EXPECT_EQ(tensor.b, 0);
    EXPECT_EQ(tensor.c, 0);
  });
}

}  // namespace
}  // namespace stereotrack
