#include "pipeline/motion/ghost_test.hpp"

#include <gtest/gtest.h>

#include "pictures.hpp"

namespace stereotrack {
namespace {

using test::exposed;
using test::Plane;
using test::surface;
using test::view;

const cv::Size kSize(96, 64);
const cv::Rect kRegion(30, 20, 24, 20);

/// A floor, the same with something on it, and the region in which they differ.
struct Scene {
  Plane floor = exposed(surface(kSize, 90), 1, 2, 1);
  Plane occupied = exposed(with_object(), 1, 2, 2);
  cv::Mat_<std::uint16_t> labels = cv::Mat_<std::uint16_t>(kSize, std::uint16_t{0});

  Scene() { labels(kRegion).setTo(1); }

  static cv::Mat_<float> with_object() {
    cv::Mat_<float> scene = surface(kSize, 90);
    scene(kRegion) = 160;
    return scene;
  }

  GhostTest::Contour measure(Plane& now, Plane& background) {
    const GhostTest::Input in{.y = view(now),
                              .cb = {},
                              .cr = {},
                              .y_background = view(background),
                              .cb_background = {},
                              .cr_background = {},
                              .labels = view(labels)};
    return GhostTest::measure(in, {kRegion.x, kRegion.y, kRegion.width, kRegion.height}, 1);
  }
};

TEST(GhostTest, WhatLeftHasItsContourInTheBackground) {
  Scene scene;
  EXPECT_TRUE(scene.measure(scene.floor, scene.occupied).is_ghost());
}

TEST(GhostTest, WhatCameHasItsContourInThePicture) {
  Scene scene;
  EXPECT_FALSE(scene.measure(scene.occupied, scene.floor).is_ghost());
}

TEST(GhostTest, WhatReplacedSomethingIsNoGhost) {
  Scene scene;
  cv::Mat_<float> dark = surface(kSize, 90);
  dark(kRegion) = 30;
  Plane replaced = exposed(dark, 1, 2, 3);
  EXPECT_FALSE(scene.measure(replaced, scene.occupied).is_ghost());
}

TEST(GhostTest, ADarkerFloorIsNoGhost) {
  Scene scene;
  cv::Mat_<float> shaded = surface(kSize, 90);
  shaded(kRegion) *= 0.6F;
  Plane now = exposed(shaded, 1, 2, 4);
  EXPECT_FALSE(scene.measure(now, scene.floor).is_ghost());
}

// By hand: a region of 24 x 20 px has 24 + 24 + 20 + 20 places; the background steps by 70 on each, less the floor's
// texture; flat planes make it exact.
TEST(GhostTest, ContrastIsSummedOverEachPlace) {
  Scene scene;
  Plane flat(kSize, std::uint8_t{90});
  Plane stepped = flat.clone();
  stepped(kRegion).setTo(160);
  const GhostTest::Contour contour = scene.measure(flat, stepped);
  EXPECT_EQ(contour.places, 88);
  EXPECT_EQ(contour.now, 0);
  EXPECT_EQ(contour.background, 88 * 70);
}

TEST(GhostTest, ColourAloneTells) {
  Scene scene;
  Plane grey(kSize, std::uint8_t{128});
  Plane red = grey.clone();
  red(kRegion).setTo(150);
  const GhostTest::Input in{.y = view(scene.floor),
                            .cb = view(grey),
                            .cr = view(grey),
                            .y_background = view(scene.floor),
                            .cb_background = view(grey),
                            .cr_background = view(red),
                            .labels = view(scene.labels)};
  const GhostTest::Contour contour = GhostTest::measure(in, {kRegion.x, kRegion.y, kRegion.width, kRegion.height}, 1);
  EXPECT_EQ(contour.background - contour.now, 88 * 22);
}

TEST(GhostTest, PlacesNextToAnotherRegionOrBeyondThePictureSayNothing) {
  Scene scene;
  Plane flat(kSize, std::uint8_t{90});
  scene.labels.setTo(2, scene.labels == 0);
  EXPECT_EQ(scene.measure(flat, flat).places, 0);

  cv::Mat_<std::uint16_t> all(kSize, std::uint16_t{1});
  const GhostTest::Input in{.y = view(flat),
                            .cb = {},
                            .cr = {},
                            .y_background = view(flat),
                            .cb_background = {},
                            .cr_background = {},
                            .labels = view(all)};
  EXPECT_EQ(GhostTest::measure(in, {0, 0, kSize.width, kSize.height}, 1).places, 0);
}

TEST(GhostTest, FewPlacesSayNothing) {
  const GhostTest::Contour few{.now = 0, .background = 11 * 100, .places = 11};
  const GhostTest::Contour enough{.now = 0, .background = 12 * 100, .places = 12};
  EXPECT_FALSE(few.is_ghost());
  EXPECT_TRUE(enough.is_ghost());
}

TEST(GhostTest, FaintContoursSayNothing) {
  const GhostTest::Contour faint{.now = 20, .background = 20 + 6 * 20, .places = 20};
  const GhostTest::Contour clear{.now = 20, .background = 20 + 6 * 20 + 1, .places = 20};
  EXPECT_FALSE(faint.is_ghost());
  EXPECT_TRUE(clear.is_ghost());
}

}  // namespace
}  // namespace stereotrack
