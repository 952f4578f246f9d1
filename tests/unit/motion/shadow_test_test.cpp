#include "pipeline/motion/shadow_test.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <span>
#include <vector>

#include "pictures.hpp"
#include "pipeline/shape/region.hpp"
#include "pipeline/stereo/disparity.hpp"

namespace stereotrack {
namespace {

using test::Plane;
using test::random_plane;
using test::view;
using Disparities = cv::Mat_<std::uint16_t>;

const cv::Size kSize(48, 40);
const cv::Rect kRegion(12, 10, 20, 16);
constexpr int kMostLabels = 2;

ShadowTest::Config config() {
  ShadowTest::Config c;
  c.darkest_percent = 40;
  c.chroma_tolerance = 6;
  c.texture_tolerance = 5;
  c.weak_percent = 0;
  c.disparity_px = 1;
  return c;
}

Plane scaled(const Plane& plane, double ratio) {
  Plane out;
  plane.convertTo(out, CV_8U, ratio);
  return out;
}

Disparities disparities(double px) { return {kSize, static_cast<std::uint16_t>(px * kDisparityScale)}; }

/// A textured background, the present picture, and a segmented region.
struct Scene {
  Plane y_background = random_plane(kSize, 90, 190, 1);
  Plane y = y_background.clone();
  Plane cb, cr, cb_background, cr_background;
  Disparities disparity, disparity_background;
  Plane mask = Plane(kSize, std::uint8_t{0});
  Plane distance = Plane(kSize, std::uint8_t{100});
  cv::Mat_<std::uint16_t> labels = cv::Mat_<std::uint16_t>(kSize, std::uint16_t{0});

  Scene() {
    mask(kRegion).setTo(255);
    labels(kRegion).setTo(1);
  }

  ShadowTest::Input input() {
    ShadowTest::Input in;
    in.y = view(y);
    in.cb = view(cb);
    in.cr = view(cr);
    in.y_background = view(y_background);
    in.cb_background = view(cb_background);
    in.cr_background = view(cr_background);
    in.distance = view(distance);
    in.labels = view(labels);
    in.disparity = view(disparity);
    in.disparity_background = view(disparity_background);
    return in;
  }

  /// As BlobExtractor would have found them.
  std::vector<Blob> regions() {
    std::vector<Blob> found;
    for (std::uint16_t label = 1; label <= kMostLabels; ++label) {
      found.push_back(measure_region(view(labels), {0, 0, labels.cols, labels.rows}, label));
      if (found.back().area == 0) found.pop_back();
    }
    return found;
  }

  /// Part of the region that is left.
  double left(const ShadowTest::Config& c = config()) {
    Arena arena;
    auto stage = ShadowTest::create(c, kSize.width, kSize.height, kMostLabels, arena);
    EXPECT_TRUE(stage.has_value());
    Plane result = mask.clone();
    const std::uint32_t cleared = stage->run(input(), regions(), view(result));
    EXPECT_EQ(static_cast<int>(cleared), cv::countNonZero(mask) - cv::countNonZero(result));
    EXPECT_EQ(cv::countNonZero(result & ~mask), 0) << "a pixel was added";
    after = result;
    return cv::countNonZero(result) / static_cast<double>(cv::countNonZero(mask));
  }
  Plane after;
};

TEST(ShadowTest, SameTextureDarkerIsRemovedWhereStereoIsUnknown) {
  for (double ratio : {0.45, 0.6, 0.9}) {
    Scene scene;
    scene.y = scaled(scene.y_background, ratio);
    EXPECT_EQ(scene.left(), 0) << ratio << ", mono";
    scene.disparity = Disparities(kSize, kNoDisparity);
    scene.disparity_background = disparities(10);
    EXPECT_EQ(scene.left(), 0) << ratio << ", now unknown";
    scene.disparity = disparities(14);
    scene.disparity_background = Disparities(kSize, kNoDisparity);
    EXPECT_EQ(scene.left(), 0) << ratio << ", background unknown";
  }
}

TEST(ShadowTest, BlackAndBrightRegionsAreKept) {
  for (double ratio : {0.0, 0.2, 0.37, 0.985, 1.0, 1.2}) {
    Scene scene;
    scene.y = scaled(scene.y_background, ratio);
    EXPECT_EQ(scene.left(), 1) << ratio;
  }
}

TEST(ShadowTest, DarkestRatioIsTheConfigured) {
  Scene scene;
  scene.y = scaled(scene.y_background, 0.3);
  EXPECT_EQ(scene.left(), 1);
  ShadowTest::Config c = config();
  c.darkest_percent = 20;
  EXPECT_EQ(scene.left(c), 0);
}

TEST(ShadowTest, OtherTextureOfTheSameLightIsKept) {
  Scene scene;
  scene.y = scaled(random_plane(kSize, 90, 190, 2), 0.6);
  EXPECT_EQ(scene.left(), 1);
  ShadowTest::Config c = config();
  c.texture_tolerance = 255;
  EXPECT_EQ(scene.left(c), 0) << "only the texture kept it";
}

TEST(ShadowTest, ChromaMustFadeWithTheLight) {
  Scene scene;
  scene.y = scaled(scene.y_background, 0.5);
  scene.cb_background = Plane(kSize, std::uint8_t{168});
  scene.cr_background = Plane(kSize, std::uint8_t{98});
  scene.cb = Plane(kSize, std::uint8_t{148});  // 128 + 40 / 2
  scene.cr = Plane(kSize, std::uint8_t{113});  // 128 - 30 / 2
  EXPECT_EQ(scene.left(), 0);
  scene.cb.setTo(168);
  EXPECT_EQ(scene.left(), 1) << "Cb 20 off";
  scene.cb.setTo(148);
  scene.cr.setTo(98);
  EXPECT_EQ(scene.left(), 1) << "Cr 15 off";
  ShadowTest::Config c = config();
  c.chroma_tolerance = 16;
  EXPECT_EQ(scene.left(c), 0);
}

// Three tenths of the region are an object of strength 100, which makes that its 75th percentile; what hangs under it
// is its weak image on a glossy floor.
TEST(ShadowTest, WeakReflectionIsRemovedThoughItIsBrightAndOfAnotherColour) {
  const cv::Rect object(kRegion.x, kRegion.y, 6, kRegion.height);
  const cv::Rect image(kRegion.x + 6, kRegion.y, 14, kRegion.height);
  Scene scene;
  const auto show = [&](int strength, const Plane& look) {
    scene.y = look.clone();
    random_plane(kSize, 90, 190, 2)(object).copyTo(scene.y(object));
    scene.distance.setTo(strength);
    scene.distance(object).setTo(100);
  };
  scene.cb_background = scene.cr_background = scene.cr = Plane(kSize, std::uint8_t{128});
  scene.cb = Plane(kSize, std::uint8_t{150});
  const Plane bright = scaled(scene.y_background, 1.15);
  ShadowTest::Config c = config();
  c.weak_percent = 25;
  show(24, bright);
  EXPECT_EQ(scene.left(), 1) << "switched off";
  (void)scene.left(c);
  EXPECT_EQ(test::part(scene.after, {image.x + 2, image.y, image.width - 2, image.height}), 0);
  EXPECT_EQ(test::part(scene.after, {object.x, object.y, object.width - 2, object.height}), 1);
  show(25, bright);
  EXPECT_EQ(scene.left(c), 1) << "25 of 100 is not under 25 %";
  show(24, random_plane(kSize, 90, 190, 2));
  EXPECT_EQ(scene.left(c), 1) << "another texture";
}

TEST(ShadowTest, NearerThanTheBackgroundIsKeptWhateverItLooksLike) {
  Scene scene;
  scene.y = scaled(scene.y_background, 0.6);
  scene.disparity_background = disparities(10);
  scene.disparity = disparities(11.0625);
  EXPECT_EQ(scene.left(), 1);
  scene.disparity = disparities(11);
  EXPECT_EQ(scene.left(), 0) << "one pixel apart is the same surface";
}

TEST(ShadowTest, BehindTheBackgroundIsRemovedFromAGhostWhateverItLooksLike) {
  Scene scene;
  scene.y = scaled(random_plane(kSize, 90, 190, 2), 1.2);
  scene.disparity_background = disparities(10);
  scene.disparity = disparities(8.9375);
  EXPECT_EQ(scene.left(), 0);
  scene.disparity = disparities(9);
  EXPECT_EQ(scene.left(), 1) << "one pixel apart is the same surface";
}

// Half of the region is nearer than the background, half behind it: no ghost, as that takes more behind than near.
TEST(ShadowTest, BehindTheBackgroundInAnotherRegionTheLookDecidesAsWithoutStereo) {
  const cv::Rect behind(kRegion.x + kRegion.width / 2, kRegion.y, kRegion.width / 2, kRegion.height);
  const cv::Rect inner(behind.x + 2, behind.y, behind.width - 2, behind.height);  // the vote rounds the border
  Scene scene;
  scene.disparity_background = disparities(10);
  scene.disparity = disparities(12);
  scene.disparity(behind).setTo(8 * kDisparityScale);
  scene.y = scaled(random_plane(kSize, 90, 190, 2), 1.2);
  EXPECT_EQ(scene.left(), 1) << "an object before a background of a wrong disparity";
  scene.y = scaled(scene.y_background, 0.6);
  (void)scene.left();
  EXPECT_EQ(test::part(scene.after, inner), 0) << "a shadow";
  scene.y = scaled(scene.y_background, 1.2);
  EXPECT_EQ(scene.left(), 1) << "brighter, which only stereo could call the background";
  scene.disparity(cv::Rect(kRegion.x, kRegion.y, 1, 1)).setTo(8 * kDisparityScale);
  (void)scene.left();
  EXPECT_EQ(test::part(scene.after, inner), 0) << "one pixel more behind: a ghost, whatever it looks like";
}

TEST(ShadowTest, GhostRegionBesideAnObjectIsToldByItsLabel) {
  Scene scene;
  const cv::Rect right(kRegion.x + kRegion.width / 2, kRegion.y, kRegion.width / 2, kRegion.height);
  scene.labels(right).setTo(2);
  scene.y = scaled(random_plane(kSize, 90, 190, 2), 1.2);
  scene.disparity_background = disparities(10);
  scene.disparity = disparities(8);
  scene.disparity(cv::Rect(kRegion.x, kRegion.y, kRegion.width / 2, kRegion.height)).setTo(12 * kDisparityScale);
  (void)scene.left();
  // The vote over 5x5 rounds the corners where the two touch.
  EXPECT_EQ(test::part(scene.after, {kRegion.x, kRegion.y, right.width - 2, kRegion.height}), 1);
  EXPECT_EQ(test::part(scene.after, {right.x + 2, right.y, right.width - 2, right.height}), 0);
}

TEST(ShadowTest, OnTheBackgroundsOwnSurfaceTheLookDecidesWithWiderTolerances) {
  Scene scene;
  scene.disparity_background = disparities(10);
  scene.disparity = disparities(10.25);
  scene.y = scaled(scene.y_background, 0.6);
  EXPECT_EQ(scene.left(), 0);
  scene.y = scaled(random_plane(kSize, 90, 190, 2), 0.6);
  EXPECT_EQ(scene.left(), 1) << "another texture";
  // Noise of 10 levels in the mean: over the tolerance of 5, under three times it.
  cv::Mat rough;
  cv::add(scaled(scene.y_background, 0.6), random_plane(kSize, 0, 40, 3), rough, cv::noArray(), CV_16S);
  cv::subtract(rough, cv::Scalar(20), scene.y, cv::noArray(), CV_8U);
  EXPECT_LT(scene.left(), 0.05);
  scene.disparity = Disparities(kSize, kNoDisparity);
  EXPECT_GT(scene.left(), 0.95) << "the narrow tolerance, where stereo says nothing";
}

TEST(ShadowTest, ResemblesTheBackgroundUnderDarkerAndBrighterLight) {
  Arena arena;
  auto stage = ShadowTest::create(config(), kSize.width, kSize.height, kMostLabels, arena);
  ASSERT_TRUE(stage.has_value());
  Scene scene;
  for (double ratio : {0.5, 1.0, 1.3}) {
    scene.y = scaled(scene.y_background, ratio);
    EXPECT_EQ(stage->count_resembling(scene.input(), {0, 0, kSize.width, kSize.height}, 1), kRegion.area()) << ratio;
    EXPECT_EQ(stage->count_resembling(scene.input(), {-5, kRegion.y + 1, 500, 2}, 1), 2 * kRegion.width);
    EXPECT_EQ(stage->count_resembling(scene.input(), {0, 0, kSize.width, kSize.height}, 2), 0);
  }
  scene.y = random_plane(kSize, 90, 190, 2);
  EXPECT_EQ(stage->count_resembling(scene.input(), {0, 0, kSize.width, kSize.height}, 1), 0);
}

TEST(ShadowTest, VoteClearsAFewObjectPixelsInAShadowAndKeepsAFewShadowPixelsInAnObject) {
  Scene scene;
  scene.y = scaled(scene.y_background, 0.6);
  scene.disparity_background = disparities(10);
  scene.disparity = disparities(10);
  scene.disparity(cv::Rect(20, 16, 3, 3)).setTo(20 * kDisparityScale);
  EXPECT_EQ(scene.left(), 0);
  scene.disparity = disparities(20);
  scene.disparity(cv::Rect(20, 16, 3, 3)).setTo(10 * kDisparityScale);
  EXPECT_EQ(scene.left(), 1);
}

TEST(ShadowTest, ObjectWithItsShadowIsPartedAtTheirBorder) {
  Scene scene;
  scene.y = scaled(scene.y_background, 0.6);
  scene.disparity_background = disparities(10);
  scene.disparity = disparities(10);
  const cv::Rect object(kRegion.x, kRegion.y, 10, kRegion.height);
  scene.disparity(object).setTo(20 * kDisparityScale);
  EXPECT_NEAR(scene.left(), 0.5, 0.06);
  EXPECT_EQ(test::part(scene.after, test::inner(object, 1)), 1);
}

TEST(ShadowTest, EvidenceCountsEachKindOfPixel) {
  Arena arena;
  auto stage = ShadowTest::create(config(), kSize.width, kSize.height, kMostLabels, arena);
  ASSERT_TRUE(stage.has_value());
  Scene scene;
  scene.disparity_background = disparities(10);
  scene.disparity = disparities(10);
  scene.disparity(0, 0) = 12 * kDisparityScale;
  scene.disparity(0, 1) = 8 * kDisparityScale;
  scene.disparity(0, 2) = kNoDisparity;
  scene.disparity_background(0, 3) = kNoDisparity;
  scene.labels.setTo(0);
  scene.labels(cv::Rect(0, 0, 6, 1)).setTo(3);
  const ShadowTest::Evidence sum = stage->evidence(scene.input(), {0, 0, kSize.width, kSize.height}, 3);
  EXPECT_EQ(sum.near, 1);
  EXPECT_EQ(sum.behind, 1);
  EXPECT_EQ(sum.unknown, 2);
  EXPECT_EQ(sum.own, 2);
  scene.disparity = Disparities();
  EXPECT_EQ(stage->evidence(scene.input(), {0, 0, kSize.width, kSize.height}, 3).unknown, 6) << "one view";
}

// Labels that run() never heard of, as those of an object's segments: each region's strength is its own.
TEST(ShadowTest, ResemblanceOfARegionGoesByItsOwnStrength) {
  const cv::Rect strong(kRegion.x, kRegion.y, 6, kRegion.height);
  ShadowTest::Config c = config();
  c.weak_percent = 25;
  Arena arena;
  auto stage = ShadowTest::create(c, kSize.width, kSize.height, kMostLabels, arena);
  ASSERT_TRUE(stage.has_value());
  Scene scene;
  scene.y = scaled(scene.y_background, 1.15);
  scene.cb_background = scene.cr_background = scene.cr = Plane(kSize, std::uint8_t{128});
  scene.cb = Plane(kSize, std::uint8_t{170});  // beyond three times the tolerance
  scene.distance.setTo(20);
  scene.distance(strong).setTo(100);
  scene.labels.setTo(60000, scene.labels != 0);
  const Rect all{0, 0, kSize.width, kSize.height};
  EXPECT_EQ(stage->count_resembling(scene.input(), all, 60000), kRegion.area() - strong.area());
  scene.labels(strong).setTo(0);
  EXPECT_EQ(stage->count_resembling(scene.input(), all, 60000), 0) << "nothing is weak where all is equally weak";
}

TEST(ShadowTest, EmptyMaskIsNoWorkAndOnePixelIsAPicture) {
  Scene scene;
  scene.mask.setTo(0);
  Arena arena;
  auto stage = ShadowTest::create(config(), kSize.width, kSize.height, kMostLabels, arena);
  ASSERT_TRUE(stage.has_value());
  EXPECT_EQ(stage->run(scene.input(), scene.regions(), view(scene.mask)), 0U);
  auto small = ShadowTest::create(config(), 1, 1, 1, arena);
  ASSERT_TRUE(small.has_value());
  Plane y(1, 1, std::uint8_t{60});
  Plane background(1, 1, std::uint8_t{100});
  Plane mask(1, 1, std::uint8_t{255});
  ShadowTest::Input in;
  in.y = view(y);
  in.y_background = view(background);
  in.distance = view(mask);
  Disparities label(1, 1, std::uint16_t{1});
  in.labels = view(label);
  const Blob region = measure_region(view(label), {0, 0, 1, 1}, 1);
  EXPECT_EQ(small->run(in, std::span(&region, 1), view(mask)), 1U);
  EXPECT_EQ(mask(0, 0), 0);
}

TEST(ShadowTest, BlackBackgroundHasNoShadow) {
  Scene scene;
  scene.y_background.setTo(0);
  scene.y.setTo(0);
  EXPECT_EQ(scene.left(), 1);
}

TEST(ShadowTest, Faults) {
  Arena arena;
  const auto fault_of = [&](auto&& change, int width = 8, int height = 8, int max_label = 1) {
    ShadowTest::Config c = config();
    change(c);
    const auto created = ShadowTest::create(c, width, height, max_label, arena);
    return created ? Fault{} : created.error();
  };
  const auto nothing = [](ShadowTest::Config&) {};
  EXPECT_EQ(fault_of(nothing), Fault{});
  EXPECT_EQ(fault_of([](auto& c) { c.darkest_percent = 0; }), Fault::kBadConfig);
  EXPECT_EQ(fault_of([](auto& c) { c.darkest_percent = 100; }), Fault::kBadConfig);
  EXPECT_EQ(fault_of([](auto& c) { c.chroma_tolerance = -1; }), Fault::kBadConfig);
  EXPECT_EQ(fault_of([](auto& c) { c.texture_tolerance = -1; }), Fault::kBadConfig);
  EXPECT_EQ(fault_of([](auto& c) { c.disparity_px = -0.5; }), Fault::kBadConfig);
  EXPECT_EQ(fault_of([](auto& c) { c.disparity_px = std::numeric_limits<double>::quiet_NaN(); }), Fault::kBadConfig);
  EXPECT_EQ(fault_of(nothing, 8, 8, 0), Fault::kBadConfig);
  EXPECT_EQ(fault_of(nothing, 8, 8, 65536), Fault::kBadConfig);
  EXPECT_EQ(fault_of(nothing, 8, 0), Fault::kBadSize);
  arena.seal();
  EXPECT_EQ(fault_of(nothing), Fault::kOutOfMemory);
}

}  // namespace
}  // namespace stereotrack
