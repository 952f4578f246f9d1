#include "pipeline/motion/umbra_test.hpp"

#include <gtest/gtest.h>

#include <array>
#include <optional>

#include "pictures.hpp"

namespace stereotrack {
namespace {

using test::Plane;
using test::view;

constexpr int kGround = 100;
constexpr int kFoot = 11;  // its row

/// Ground, on which a thing 16 columns wide stands from row 4 to kFoot.
struct Scene {
  static constexpr int kLeft = 4;
  static constexpr int kWidth = 16;

  Scene() { mask(cv::Rect(kLeft, 4, kWidth, 8)).setTo(255); }

  /// Luma of the thing's rows, from the foot up; those above take the last.
  template <std::size_t kRows>
  void paint(const std::array<int, kRows>& from_foot, int left = kLeft, int width = kWidth) {
    for (int i = 0; i < 8; ++i) {
      now(cv::Rect(left, kFoot - i, width, 1)).setTo(from_foot[std::min<std::size_t>(i, kRows - 1)]);
    }
  }
  std::uint32_t run() { return stage->run(view(now), view(background), view(mask)); }
  [[nodiscard]] int left_in_row(int v) { return cv::countNonZero(mask.row(v)); }

  Plane background = Plane(16, 24, std::uint8_t{kGround});
  Plane now = background.clone();
  Plane mask = Plane(16, 24, std::uint8_t{0});
  Arena arena;
  std::optional<UmbraTest> stage = make();

 private:
  std::optional<UmbraTest> make() {
    auto made = UmbraTest::create({.darkest_percent = 40}, 24, 16, arena);
    return made.has_value() ? std::optional<UmbraTest>(*made) : std::nullopt;
  }
};

TEST(UmbraTest, GroundUpToTheDarkestPlaceIsShadow) {
  Scene scene;
  scene.paint(std::array{70, 25, 12, 12, 14, 120});
  EXPECT_EQ(scene.run(), 4U * Scene::kWidth);
  for (int v = kFoot - 3; v <= kFoot; ++v) EXPECT_EQ(scene.left_in_row(v), 0) << v;
  for (int v = 4; v <= kFoot - 4; ++v) EXPECT_EQ(scene.left_in_row(v), Scene::kWidth) << v;
}

TEST(UmbraTest, LightThatChromaAndTextureCanTellIsLeftToThem) {
  Scene scene;
  scene.paint(std::array{70, 45, 40, 40, 120});
  EXPECT_EQ(scene.run(), 0U);
  scene.paint(std::array{70, 45, 39, 40, 120});
  EXPECT_EQ(scene.run(), 3U * Scene::kWidth);
}

TEST(UmbraTest, DarkPartsOverABrightFootStay) {
  Scene scene;
  scene.paint(std::array{150, 160, 10, 10, 10, 160});
  EXPECT_EQ(scene.run(), 0U);
}

TEST(UmbraTest, WhatStandsUprightStays) {
  // Three columns: the run over the foot, 3 >= 2 x 1 wide, is all that could be flat.
  Scene scene;
  scene.mask.setTo(0);
  scene.mask(cv::Rect(10, 4, 3, 8)).setTo(255);
  scene.paint(std::array{20}, 10, 3);
  EXPECT_EQ(scene.run(), 3U);
  EXPECT_EQ(scene.left_in_row(kFoot), 0);
  EXPECT_EQ(scene.left_in_row(kFoot - 1), 3);
}

TEST(UmbraTest, NothingOverWhatStaysIsCleared) {
  // Two legs, too narrow for more than their feet, under a body that is darker still.
  Scene scene;
  scene.mask(cv::Rect(Scene::kLeft, kFoot - 2, Scene::kWidth, 3)).setTo(0);
  for (const int left : {5, 15}) scene.mask(cv::Rect(left, kFoot - 2, 3, 3)).setTo(255);
  scene.paint(std::array{20, 20, 20, 10, 120});
  scene.mask(cv::Rect(Scene::kLeft, kFoot - 3, Scene::kWidth, 1)).setTo(255);
  (void)scene.run();
  for (const int x : {5, 6, 7, 15, 16, 17}) {
    for (int v = 4; v < kFoot; ++v) EXPECT_EQ(scene.mask(v, x), 255) << x << ' ' << v;
  }
}

TEST(UmbraTest, WhatReachesTheLastRowHasNoFoot) {
  Scene scene;
  scene.mask(cv::Rect(Scene::kLeft, kFoot, Scene::kWidth, 16 - kFoot)).setTo(255);
  scene.now(cv::Rect(Scene::kLeft, 4, Scene::kWidth, 12)).setTo(10);
  EXPECT_EQ(scene.run(), 0U);
}

TEST(UmbraTest, RunsDoNotRememberEachOther) {
  Scene scene;
  scene.paint(std::array{70, 25, 120});
  const Plane mask = scene.mask.clone();
  EXPECT_EQ(scene.run(), 2U * Scene::kWidth);
  mask.copyTo(scene.mask);
  scene.paint(std::array{120});
  EXPECT_EQ(scene.run(), 0U);
}

TEST(UmbraTest, OnePixelIsAPicture) {
  Arena arena;
  auto made = UmbraTest::create({}, 1, 1, arena);
  ASSERT_TRUE(made.has_value());
  Plane dark(1, 1, std::uint8_t{0});
  Plane ground(1, 1, std::uint8_t{kGround});
  Plane mask(1, 1, std::uint8_t{255});
  EXPECT_EQ(made->run(view(dark), view(ground), view(mask)), 0U);
  EXPECT_EQ(mask(0, 0), 255);
}

TEST(UmbraTest, TallColumnsOfDarkArePartOfNothingFlat) {
  // 600 rows are more than a height can say.
  Arena arena;
  auto made = UmbraTest::create({}, 8, 602, arena);
  ASSERT_TRUE(made.has_value());
  Plane dark(602, 8, std::uint8_t{5});
  Plane ground(602, 8, std::uint8_t{kGround});
  Plane mask(602, 8, std::uint8_t{0});
  mask(cv::Rect(0, 0, 8, 601)).setTo(255);
  EXPECT_EQ(made->run(view(dark), view(ground), view(mask)), 4U * 8U);
}

TEST(UmbraTest, Faults) {
  Arena arena;
  EXPECT_EQ(UmbraTest::create({.darkest_percent = 0}, 8, 8, arena).error(), Fault::kBadConfig);
  EXPECT_EQ(UmbraTest::create({.darkest_percent = 100}, 8, 8, arena).error(), Fault::kBadConfig);
  EXPECT_EQ(UmbraTest::create({}, 0, 8, arena).error(), Fault::kBadSize);
  arena.seal();
  EXPECT_EQ(UmbraTest::create({}, 8, 8, arena).error(), Fault::kOutOfMemory);
}

}  // namespace
}  // namespace stereotrack
