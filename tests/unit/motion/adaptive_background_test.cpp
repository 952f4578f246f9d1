#include "pipeline/motion/adaptive_background.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <optional>

#include "pictures.hpp"

namespace stereotrack {
namespace {

using test::exposed;
using test::inner;
using test::part;
using test::Plane;
using test::surface;
using test::view;

const cv::Size kSize(96, 64);
const cv::Rect kAll(0, 0, 96, 64);
constexpr double kNoise = 2;
constexpr double kForegroundSd = 6;
constexpr int kStep = AdaptiveBackground::kStepsPerSd;

AdaptiveBackground::Config config() {
  AdaptiveBackground::Config c;
  c.window = 30;
  c.absorb_frames = 40;
  c.noise_floor = 256;
  c.edge_percent = 75;
  c.relearn_percent = 60;
  return c;
}

/// The background with a plain threshold behind it, as the rest of the preset would feed it.
class Watch {
 public:
  explicit Watch(const AdaptiveBackground::Config& c = config(), bool colour = false, cv::Size size = kSize)
      : distance(size, std::uint8_t{0}), mask(size, std::uint8_t{0}) {
    auto created = AdaptiveBackground::create(c, size.width, size.height, colour, arena_);
    EXPECT_TRUE(created.has_value());
    if (created) background.emplace(*created);
  }

  void look(const Plane& y, const Plane& cb = {}, const Plane& cr = {}) {
    Plane planes[] = {y, cb, cr};
    background->distance({view(planes[0]), view(planes[1]), view(planes[2])}, view(distance));
    mask = distance >= kStep * kForegroundSd;
  }
  void step(const Plane& y, const Plane& cb = {}, const Plane& cr = {}) {
    look(y, cb, cr);
    Plane planes[] = {y, cb, cr};
    background->learn({view(planes[0]), view(planes[1]), view(planes[2])}, view(mask));
  }
  /// One more exposure of a scene.
  void step(const cv::Mat_<float>& scene, double light = 1) { step(exposed(scene, light, kNoise, ++seed_)); }
  void look(const cv::Mat_<float>& scene, double light = 1) { look(exposed(scene, light, kNoise, ++seed_)); }

  [[nodiscard]] double foreground(const cv::Rect& where) const { return part(mask, where); }

 private:
  Arena arena_;
  std::uint64_t seed_ = 100;

 public:
  std::optional<AdaptiveBackground> background;
  Plane distance;
  Plane mask;
};

cv::Mat_<float> with_object(const cv::Mat_<float>& scene, const cv::Rect& where, float brightness = 200) {
  cv::Mat_<float> out = scene.clone();
  out(where & cv::Rect(0, 0, scene.cols, scene.rows)).setTo(brightness);
  return out;
}

double outside(const Plane& mask, const cv::Rect& object) {
  Plane rest = mask.clone();
  rest(inner(object, -3) & kAll).setTo(0);
  return part(rest, kAll);
}

TEST(AdaptiveBackground, DistanceIsZeroBeforeTheFirstPictureIsLearnt) {
  Watch watch;
  watch.distance.setTo(99);
  watch.look(surface(kSize, 110));
  EXPECT_EQ(cv::countNonZero(watch.distance), 0);
  EXPECT_FALSE(watch.background->started());
}

TEST(AdaptiveBackground, DetectsFromTheSecondFrame) {
  const cv::Rect object(40, 20, 16, 14);
  const cv::Mat_<float> empty = surface(kSize, 110);
  Watch watch;
  watch.step(empty);
  watch.look(with_object(empty, object));
  EXPECT_GT(watch.foreground(inner(object, 1)), 0.99);
  EXPECT_LT(outside(watch.mask, object), 0.005);
}

TEST(AdaptiveBackground, DistanceIsInStandardDeviations) {
  // All pixels are 100 + {-4, 0, 0, +4} in turn, so a = 2 and, m being 100 everywhere, R = 0. A pixel of 120 is
  // 20 / (1.25 2 + 1) = 5.71 standard deviations away; one of 80 as well.
  AdaptiveBackground::Config c = config();
  c.window = 64;
  Watch watch(c);
  Plane picture(kSize);
  for (int t = 0; t < 400; ++t) {
    for (int y = 0; y < kSize.height; ++y) {
      for (int x = 0; x < kSize.width; ++x) {
        constexpr int kTurn[] = {96, 100, 104, 100};
        picture(y, x) = static_cast<std::uint8_t>(kTurn[(x + y + t) % 4]);
      }
    }
    watch.step(picture);
  }
  EXPECT_EQ(cv::countNonZero(watch.mask), 0);
  picture(20, 30) = 120;
  picture(40, 60) = 80;
  picture(50, 10) = 100;
  watch.look(picture);
  EXPECT_NEAR(watch.distance(20, 30), 5.71 * kStep, 0.5 * kStep);
  EXPECT_NEAR(watch.distance(40, 60), 5.71 * kStep, 0.5 * kStep);
  EXPECT_LE(watch.distance(50, 10), kStep / 4);
  EXPECT_NEAR(watch.background->gain(), 256, 4);
  EXPECT_NEAR(watch.background->luma().at(3, 3), 100, 1);
}

TEST(AdaptiveBackground, SmallestSpreadIsTheNoiseFloor) {
  // Without noise a tends to 0: with a floor of 2 levels a change by 10 is 5 standard deviations.
  AdaptiveBackground::Config c = config();
  c.noise_floor = 512;
  Watch watch(c);
  Plane picture(kSize, std::uint8_t{100});
  for (int t = 0; t < 500; ++t) watch.step(picture);
  picture(30, 30) = 110;
  watch.look(picture);
  EXPECT_LE(watch.distance(30, 30), 5 * kStep);
  EXPECT_GE(watch.distance(30, 30), 4 * kStep);
}

TEST(AdaptiveBackground, WhatPassesUnderTheThresholdIsHardlyLearntAsNoise) {
  // In every tenth frame something 9 levels brighter passes, too faint to be foreground. With a pull of 2 the deviation
  // of 0.6 rises to 1.2, without bound to 1.8, so that what comes later stands out 1.3 times as much.
  const cv::Rect road(20, 20, 40, 20);
  const cv::Mat_<float> empty(kSize, 100.0F);
  const cv::Mat_<float> faint = with_object(empty, road, 109);
  const auto strength = [&](int pull) {
    AdaptiveBackground::Config c = config();
    c.pull = pull;
    Watch watch(c);
    for (int t = 0; t < 300; ++t) watch.step(t % 10 == 4 ? faint : empty);
    EXPECT_LE(watch.foreground(road), 0.01);
    watch.look(with_object(empty, road, 122));
    return cv::mean(watch.distance(inner(road, 2)))[0] / kStep;
  };
  const double bounded = strength(2);
  EXPECT_GE(bounded, kForegroundSd);
  EXPECT_GE(bounded, 1.15 * strength(0));
}

TEST(AdaptiveBackground, LookOfAThirdOfTheFramesIsNoise) {
  Watch watch;
  const cv::Rect leaf(20, 20, 40, 20);
  const cv::Mat_<float> sky(kSize, 100.0F);
  const cv::Mat_<float> leaves = with_object(sky, leaf, 112);
  for (int t = 0; t < 300; ++t) watch.step(t % 3 == 2 ? leaves : sky);
  watch.look(leaves);
  EXPECT_LE(watch.foreground(leaf), 0.02);
  watch.look(sky);
  EXPECT_LE(watch.foreground(leaf), 0.02);
}

TEST(AdaptiveBackground, DistanceSaturates) {
  Watch watch;
  Plane picture(kSize, std::uint8_t{100});
  for (int t = 0; t < 100; ++t) watch.step(picture);
  picture(30, 30) = 255;
  watch.look(picture);
  EXPECT_EQ(watch.distance(30, 30), 255);
}

TEST(AdaptiveBackground, OtherExposureIsNoMotionAndAnObjectStillIs) {
  const cv::Rect object(40, 20, 16, 14);
  const cv::Mat_<float> empty = surface(kSize, 130);
  for (double light : {0.8, 1.2}) {
    Watch watch;
    for (int t = 0; t < 30; ++t) watch.step(empty);
    watch.look(empty, light);
    EXPECT_LT(watch.foreground(kAll), 0.002) << light;
    EXPECT_NEAR(watch.background->gain() / 256.0, light, 0.012);
    EXPECT_NEAR(watch.background->luma().at(50, 30), empty(30, 50) * light, 3);
    watch.look(with_object(empty, object, 50), light);
    EXPECT_GT(watch.foreground(inner(object, 1)), 0.99) << light;
    EXPECT_LT(outside(watch.mask, object), 0.002) << light;
  }
}

TEST(AdaptiveBackground, ExposureThatAlternatesDoesNotWearTheBackgroundOut) {
  const cv::Mat_<float> empty = surface(kSize, 130);
  Watch watch;
  for (int t = 0; t < 20; ++t) watch.step(empty);
  for (int t = 0; t < 20; ++t) {
    watch.step(empty, t % 2 == 0 ? 0.9 : 1.1);
    EXPECT_LT(watch.foreground(kAll), 0.005) << t;
  }
}

TEST(AdaptiveBackground, ClippedBackgroundIsNoMotionUnderOtherExposure) {
  // Left third clipped, the rest tells the gain; 252 is what a camera clips at.
  const cv::Rect bright(0, 0, 32, 64);
  const auto picture = [&](double light, int clipped) {
    Plane y(kSize, static_cast<std::uint8_t>(180 * light));
    y(bright) = static_cast<std::uint8_t>(clipped);
    return y;
  };
  for (const double light : {0.9, 1.2}) {
    Watch watch;
    for (int k = 0; k < 20; ++k) watch.step(picture(1, 252));
    watch.look(picture(light, 252));
    EXPECT_EQ(watch.foreground(kAll), 0) << light;
    watch.look(picture(light, light < 1 ? 200 : 230));   // darker than any light explains
    EXPECT_GE(watch.foreground(bright), 0.95) << light;  // the edge moves no further than its tolerance
  }
}

TEST(AdaptiveBackground, BackgroundThatMoreLightClipsIsNoMotion) {
  Watch watch;
  const auto picture = [&](int dark, int bright) {
    Plane y(kSize, static_cast<std::uint8_t>(dark));
    y(cv::Rect(0, 0, 32, 64)) = static_cast<std::uint8_t>(bright);
    return y;
  };
  for (int k = 0; k < 20; ++k) watch.step(picture(100, 230));
  watch.look(picture(130, 254));  // 230 x 1.3 would be 299
  EXPECT_EQ(watch.foreground(kAll), 0);
}

TEST(AdaptiveBackground, EdgeMovedByAFractionOfAPixelIsNoMotion) {
  const auto edge_at = [](double column) {
    cv::Mat_<float> scene(kSize);
    for (int y = 0; y < scene.rows; ++y) {
      for (int x = 0; x < scene.cols; ++x) {
        scene(y, x) = static_cast<float>(60 + 120 * std::clamp(x + 0.5 - column, 0.0, 1.0));
      }
    }
    return scene;
  };
  AdaptiveBackground::Config strict = config();
  strict.edge_percent = 0;
  Watch tolerant;
  Watch exact(strict);
  for (int t = 0; t < 30; ++t) {
    tolerant.step(edge_at(48));
    exact.step(edge_at(48));
  }
  const cv::Rect rim(44, 0, 8, kSize.height);
  for (double shift : {-0.6, -0.3, 0.3, 0.6}) {
    tolerant.look(edge_at(48 + shift));
    EXPECT_EQ(tolerant.foreground(rim), 0) << shift;
    exact.look(edge_at(48 + shift));
    EXPECT_GT(exact.foreground(rim), 0.1) << shift << ": the test's edge is too weak to tell";
  }
  tolerant.look(edge_at(53));
  EXPECT_GT(tolerant.foreground({49, 0, 3, kSize.height}), 0.99);
}

TEST(AdaptiveBackground, ObjectPresentAtTheStartThatLeavesDissolves) {
  const cv::Rect object(40, 20, 16, 14);
  const cv::Mat_<float> empty = surface(kSize, 110);
  AdaptiveBackground::Config c = config();
  c.absorb_frames = 1000;
  Watch watch(c);
  for (int t = 0; t < 5; ++t) watch.step(with_object(empty, object));
  watch.step(empty);
  EXPECT_GT(watch.foreground(inner(object, 1)), 0.99) << "no ghost to dissolve";
  for (int t = 0; t < 14; ++t) watch.step(empty);
  watch.look(empty);
  EXPECT_EQ(watch.foreground(object), 0);
  watch.look(with_object(empty, object));
  EXPECT_GT(watch.foreground(inner(object, 1)), 0.99) << "the object is no longer known as background";
}

TEST(AdaptiveBackground, StoppedObjectIsAbsorbedAfterAbsorbFramesAndNotBefore) {
  const cv::Rect object(40, 20, 16, 14);
  const cv::Mat_<float> empty = surface(kSize, 110);
  Watch watch;
  for (int t = 0; t < 100; ++t) watch.step(empty);
  const cv::Mat_<float> occupied = with_object(empty, object);
  for (int t = 1; t <= 38; ++t) {
    watch.step(occupied);
    ASSERT_GT(watch.foreground(inner(object, 1)), 0.98) << t;
  }
  for (int t = 0; t < 6; ++t) watch.step(occupied);
  watch.look(occupied);
  EXPECT_LT(watch.foreground(object), 0.02);
}

TEST(AdaptiveBackground, WhatStandsBeforeAConfirmedOneIsAbsorbedNoSoonerHoweverYoungThatIs) {
  const cv::Rect object(40, 20, 16, 14);
  const cv::Mat_<float> empty = surface(kSize, 110);
  const cv::Mat_<float> occupied = with_object(empty, object);
  Watch left_alone;
  Watch confirmed;
  const auto both = [&](const cv::Mat_<float>& scene) {
    left_alone.step(scene);
    confirmed.step(scene);
  };
  const auto confirm = [&] {
    for (int y = object.y; y < object.br().y; ++y) {
      for (int x = object.x; x < object.br().x; ++x) confirmed.background->confirm(x, y);
    }
  };
  for (int t = 0; t < 12; ++t) both(empty);
  for (int t = 1; t <= 38; ++t) {
    confirm();
    both(occupied);
    ASSERT_GT(confirmed.foreground(inner(object, 1)), 0.98) << t;
  }
  EXPECT_LT(left_alone.foreground(object), 0.02) << "it would have stayed anyway";
  confirmed.look(empty);
  EXPECT_EQ(confirmed.foreground(object), 0) << "the background is no longer what it was";
  for (int t = 0; t < 6; ++t) {
    confirm();
    confirmed.step(occupied);
  }
  confirmed.look(occupied);
  EXPECT_LT(confirmed.foreground(object), 0.02);
}

TEST(AdaptiveBackground, MovingObjectIsNeverAbsorbed) {
  const cv::Mat_<float> empty = surface(kSize, 110);
  Watch watch;
  for (int t = 0; t < 20; ++t) watch.step(empty);
  // To and fro over 60 px, 3 px a frame, for ten times absorb_frames.
  for (int t = 0; t < 400; ++t) {
    const int phase = t % 40;
    const cv::Rect object(10 + 3 * (phase < 20 ? phase : 40 - phase), 25, 12, 12);
    watch.step(with_object(empty, object));
    ASSERT_GT(watch.foreground(inner(object, 1)), 0.95) << t;
    ASSERT_LT(outside(watch.mask, object), 0.01) << t;
  }
}

TEST(AdaptiveBackground, PictureThatChangesAsAWholeIsLearntAnew) {
  const cv::Mat_<float> before = surface(kSize, 90);
  // A change that is no gain: one half darker, one half brighter.
  cv::Mat_<float> after = surface(kSize, 160, 2);
  after(cv::Rect(0, 0, 48, 64)).setTo(20);
  AdaptiveBackground::Config never = config();
  never.relearn_percent = 100;
  Watch watch;
  Watch stubborn(never);
  for (int t = 0; t < 20; ++t) {
    watch.step(before);
    stubborn.step(before);
  }
  watch.look(after);
  EXPECT_GT(watch.foreground(kAll), 0.6) << "not a global change";
  for (int t = 0; t < 3; ++t) {
    watch.step(after);
    stubborn.step(after);
  }
  watch.look(after);
  stubborn.look(after);
  EXPECT_LT(watch.foreground(kAll), 0.01);
  EXPECT_GT(stubborn.foreground(kAll), 0.3);
}

TEST(AdaptiveBackground, ForgottenPixelStartsAnewWithItsPresentLook) {
  Watch watch;
  Plane picture(kSize, std::uint8_t{100});
  for (int t = 0; t < 50; ++t) watch.step(picture);
  picture(cv::Rect(40, 20, 16, 14)).setTo(200);
  watch.look(picture);
  EXPECT_GT(watch.foreground({40, 20, 16, 14}), 0.99);
  watch.mask.setTo(0);
  watch.mask(cv::Rect(40, 20, 8, 14)).setTo(AdaptiveBackground::kForget);
  watch.mask(cv::Rect(48, 20, 8, 14)).setTo(AdaptiveBackground::kForeground);
  watch.background->learn({view(picture), {}, {}}, view(watch.mask));
  watch.look(picture);
  EXPECT_EQ(watch.foreground({41, 21, 6, 12}), 0);
  EXPECT_GT(watch.foreground({49, 21, 6, 12}), 0.99);
  EXPECT_EQ(watch.background->luma().at(43, 25), 200);
}

// A ghost's pixels are learnt once they have looked the same kGhostFrames long; what moves through is not.
TEST(AdaptiveBackground, GhostIsLearntOnceItStandsStill) {
  const cv::Rect place(40, 20, 16, 14);
  for (const bool still : {true, false}) {
    Watch watch;
    Plane picture(kSize, std::uint8_t{100});
    for (int t = 0; t < 50; ++t) watch.step(picture);
    for (int t = 1; t <= AdaptiveBackground::kGhostFrames; ++t) {
      picture(place).setTo(still ? 200 : 150 + 20 * t);
      watch.look(picture);
      EXPECT_GT(watch.foreground(place), 0.99);
      watch.mask(place).setTo(AdaptiveBackground::kGhost);
      watch.background->learn({view(picture), {}, {}}, view(watch.mask));
    }
    watch.look(picture);
    EXPECT_EQ(watch.foreground(inner(place, 1)), still ? 0 : 1);
  }
}

TEST(AdaptiveBackground, ObjectOfTheBackgroundsLumaIsSeenByItsColour) {
  const cv::Rect object(40, 20, 16, 14);
  Plane y(kSize, std::uint8_t{110});
  Plane cb(kSize, std::uint8_t{120});
  Plane cr(kSize, std::uint8_t{135});
  Watch colour(config(), true);
  Watch grey;
  for (int t = 0; t < 30; ++t) {
    colour.step(y, cb, cr);
    grey.step(y);
  }
  EXPECT_EQ(cv::countNonZero(colour.mask), 0);
  Plane other_cb = cb.clone();
  other_cb(object).setTo(150);
  colour.look(y, other_cb, cr);
  EXPECT_EQ(colour.foreground(object), 1);
  EXPECT_EQ(outside(colour.mask, object), 0);
  EXPECT_EQ(colour.background->blue().at(5, 5), 120);
  EXPECT_EQ(colour.background->red().at(5, 5), 135);
  Plane other_cr = cr.clone();
  other_cr(object).setTo(105);
  colour.look(y, cb, other_cr);
  EXPECT_EQ(colour.foreground(object), 1);
  grey.look(y);
  EXPECT_EQ(grey.foreground(object), 0);
  EXPECT_TRUE(grey.background->blue().empty());
}

TEST(AdaptiveBackground, ChannelsCombineAsTheLargerAndHalfTheSmaller) {
  Plane y(kSize, std::uint8_t{110});
  Plane cb(kSize, std::uint8_t{120});
  const Plane cr(kSize, std::uint8_t{135});
  Watch watch(config(), true);
  for (int t = 0; t < 300; ++t) watch.step(y, cb, cr);
  const auto distance_of = [&](int luma, int blue) {
    Plane y_now = y.clone();
    Plane cb_now = cb.clone();
    y_now(30, 30) = static_cast<std::uint8_t>(luma);
    cb_now(30, 30) = static_cast<std::uint8_t>(blue);
    watch.look(y_now, cb_now, cr);
    return static_cast<int>(watch.distance(30, 30));
  };
  const int luma = distance_of(120, 120);
  const int blue = distance_of(110, 126);
  ASSERT_GT(luma, blue);
  ASSERT_GT(blue, 0);
  EXPECT_EQ(distance_of(120, 126), luma + blue / 2);
}

TEST(AdaptiveBackground, OnePixelIsAPicture) {
  Watch watch(config(), false, {1, 1});
  Plane picture(1, 1, std::uint8_t{100});
  for (int t = 0; t < 20; ++t) watch.step(picture);
  EXPECT_EQ(watch.distance(0, 0), 0);
  picture(0, 0) = 180;
  watch.look(picture);
  EXPECT_GT(watch.distance(0, 0), kStep * kForegroundSd);
}

TEST(AdaptiveBackground, Faults) {
  Arena arena;
  const auto fault_of = [&](auto&& change, int width = 8, int height = 8) {
    AdaptiveBackground::Config c = config();
    change(c);
    const auto created = AdaptiveBackground::create(c, width, height, false, arena);
    return created ? Fault{} : created.error();
  };
  const auto nothing = [](AdaptiveBackground::Config&) {};
  EXPECT_EQ(fault_of(nothing), Fault{});
  EXPECT_EQ(fault_of([](auto& c) { c.window = 1; }), Fault::kBadConfig);
  EXPECT_EQ(fault_of([](auto& c) { c.window = 1025; }), Fault::kBadConfig);
  EXPECT_EQ(fault_of([](auto& c) { c.absorb_frames = 1; }), Fault::kBadConfig);
  EXPECT_EQ(fault_of([](auto& c) { c.absorb_frames = 60001; }), Fault::kBadConfig);
  EXPECT_EQ(fault_of([](auto& c) { c.pull = -1; }), Fault::kBadConfig);
  EXPECT_EQ(fault_of([](auto& c) { c.pull = 9; }), Fault::kBadConfig);
  EXPECT_EQ(fault_of([](auto& c) { c.noise_floor = 0; }), Fault::kBadConfig);
  EXPECT_EQ(fault_of([](auto& c) { c.noise_floor = 4097; }), Fault::kBadConfig);
  EXPECT_EQ(fault_of([](auto& c) { c.edge_percent = -1; }), Fault::kBadConfig);
  EXPECT_EQ(fault_of([](auto& c) { c.edge_percent = 201; }), Fault::kBadConfig);
  EXPECT_EQ(fault_of([](auto& c) { c.relearn_percent = 0; }), Fault::kBadConfig);
  EXPECT_EQ(fault_of([](auto& c) { c.relearn_percent = 101; }), Fault::kBadConfig);
  EXPECT_EQ(fault_of(nothing, 0, 8), Fault::kBadSize);
  EXPECT_EQ(fault_of(nothing, 8, 0), Fault::kBadSize);
  arena.seal();
  EXPECT_EQ(fault_of(nothing), Fault::kOutOfMemory);
}

}  // namespace
}  // namespace stereotrack
