#include "pipeline/track/depth_segments.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <opencv2/core.hpp>
#include <vector>

#include "pipeline/shape/region.hpp"
#include "pipeline/stereo/disparity.hpp"

namespace stereotrack {
namespace {

constexpr int kWidth = 96;
constexpr int kHeight = 64;
constexpr double kUnknown = -1;

template <class T>
ImageView<T> view(cv::Mat_<T>& mat) {
  return {mat[0], mat.cols, mat.rows, static_cast<std::ptrdiff_t>(mat.step1())};
}

DepthSegments::Config config() {
  DepthSegments::Config c;
  c.jump = 0.05;
  c.jump_px = 1;
  c.min_px = 24;
  c.min_part = 0.04;
  c.min_known = 0.2;
  return c;
}

std::uint16_t fixed(double d) { return d < 0 ? kNoDisparity : static_cast<std::uint16_t>(d * kDisparityScale + 0.5); }

/// A picture in which rectangles are painted, and what becomes of its blob 1.
struct Scene {
  cv::Mat_<std::uint16_t> labels{cv::Size(kWidth, kHeight), std::uint16_t{0}};
  cv::Mat_<std::uint16_t> disparity{cv::Size(kWidth, kHeight), kNoDisparity};
  cv::Mat_<std::uint8_t> y{cv::Size(kWidth, kHeight), std::uint8_t{90}};
  cv::Mat_<std::uint16_t> segment;
  cv::Mat_<std::uint16_t> filled;

  void paint(const cv::Rect& where, double d, std::uint16_t label = 1) {
    labels(where).setTo(label);
    disparity(where).setTo(fixed(d));
  }

  int run(const DepthSegments::Config& c = config(), std::uint16_t label = 1) {
    Arena arena;
    auto stage = DepthSegments::create(c, kWidth, kHeight, arena);
    EXPECT_TRUE(stage.has_value());
    const Blob blob = measure_region(view(labels), {0, 0, kWidth, kHeight}, label);
    const int found = stage->run({view(labels), view(disparity), view(y)}, blob);
    segment = cv::Mat_<std::uint16_t>(labels.size(), std::uint16_t{0xFFFF});
    filled = segment.clone();
    for_each_pixel(view(labels), blob.box, label, [&](int u, int v) {
      segment(v, u) = stage->segment().at(u, v);
      filled(v, u) = stage->filled().at(u, v);
      EXPECT_LT(segment(v, u), found) << u << ' ' << v;
    });
    return found;
  }

  /// Whether all of the rectangle is in the segment of its first pixel.
  [[nodiscard]] bool one(const cv::Rect& where) const {
    return cv::countNonZero(segment(where) != segment(where.y, where.x)) == 0;
  }
};

TEST(DepthSegments, TouchingBoxesAtDifferentDepthsAreTwo) {
  Scene scene;
  scene.paint({20, 10, 20, 24}, 20);
  scene.paint({40, 14, 24, 24}, 40);
  ASSERT_EQ(scene.run(), 2);
  EXPECT_TRUE(scene.one({20, 10, 20, 24}));
  EXPECT_TRUE(scene.one({40, 14, 24, 24}));
  EXPECT_NE(scene.segment(20, 39), scene.segment(20, 40));
}

TEST(DepthSegments, BoxesOneBehindTheOtherAreParted) {
  // The near one covers the middle of the far one, whose sides do not touch each other any more.
  Scene scene;
  scene.paint({20, 10, 50, 24}, 20);
  scene.paint({40, 10, 12, 24}, 40);
  ASSERT_EQ(scene.run(), 3);
  EXPECT_TRUE(scene.one({20, 10, 20, 24}));
  EXPECT_TRUE(scene.one({40, 10, 12, 24}));
  EXPECT_TRUE(scene.one({52, 10, 18, 24}));
  EXPECT_NE(scene.segment(20, 20), scene.segment(20, 60));
}

TEST(DepthSegments, SlantedSurfaceIsOneThoughItsEndsAreFarApart) {
  Scene scene;
  for (int x = 10; x < 80; ++x) scene.paint({x, 10, 1, 30}, 20 + 0.5 * (x - 10));  // from 20 to 54.5
  EXPECT_EQ(scene.run(), 1);
  EXPECT_TRUE(scene.one({10, 10, 70, 30}));
}

TEST(DepthSegments, StepIsAnEdgeFromTheJumpOn) {
  const auto segments = [](double left, double right) {
    Scene scene;
    scene.paint({10, 10, 20, 20}, left);
    scene.paint({30, 10, 20, 20}, right);
    return scene.run();
  };
  // jump_px = 1 px rules up to 20 px, above 5 %: 4 px of 80.
  EXPECT_EQ(segments(10, 11), 1);
  EXPECT_EQ(segments(10, 11.25), 2);
  EXPECT_EQ(segments(80, 83.5), 1);
  EXPECT_EQ(segments(80, 85), 2);
  EXPECT_EQ(segments(85, 80), 2);
}

TEST(DepthSegments, UnknownPixelsFollowTheSideReachedWithoutCrossingAnEdge) {
  Scene scene;
  const cv::Rect left(20, 10, 20, 24);
  const cv::Rect right(40, 10, 20, 24);
  scene.paint(left, 20);
  scene.paint(right, 40);
  scene.paint({28, 10, 16, 24}, kUnknown);  // columns 28..43
  scene.y(right).setTo(240);
  ASSERT_EQ(scene.run(), 2);
  EXPECT_TRUE(scene.one(left));
  EXPECT_TRUE(scene.one(right));
  EXPECT_NE(scene.segment(20, 39), scene.segment(20, 40));
  EXPECT_EQ(scene.filled(20, 39), fixed(20));
  EXPECT_EQ(scene.filled(20, 40), fixed(40));
  scene.y.setTo(90);  // no edge: the nearer side, 11 px to the left, 5 px to the right
  ASSERT_EQ(scene.run(), 2);
  EXPECT_EQ(scene.filled(20, 38), fixed(40));
  EXPECT_EQ(scene.segment(20, 38), scene.segment(20, 50));
}

TEST(DepthSegments, SmallIslandIsNoiseAndGoesToWhatIsAroundIt) {
  Scene scene;
  const cv::Rect left(10, 10, 40, 30);
  const cv::Rect right(50, 10, 40, 30);
  scene.paint(left, 20);
  scene.paint(right, 40);
  scene.paint({20, 20, 8, 8}, 40);  // 64 px of 2400, 2.7 %
  scene.paint({60, 20, 8, 8}, 20);
  ASSERT_EQ(scene.run(), 2);
  EXPECT_TRUE(scene.one(left));
  EXPECT_TRUE(scene.one(right));
  scene.paint({20, 20, 12, 12}, 40);  // 6 %
  ASSERT_EQ(scene.run(), 3);
  EXPECT_TRUE(scene.one({20, 20, 12, 12}));
  EXPECT_NE(scene.segment(25, 25), scene.segment(12, 12));
}

TEST(DepthSegments, ComponentUnderMinPxIsNoiseWhateverItsPart) {
  Scene scene;
  scene.paint({10, 10, 8, 8}, 20);
  scene.paint({18, 10, 4, 4}, 40);  // 16 of 80 px
  EXPECT_EQ(scene.run(), 1);
  DepthSegments::Config c = config();
  c.min_px = 16;
  EXPECT_EQ(scene.run(c), 2);
}

TEST(DepthSegments, ComponentThatIsMostlyFilledIsNoEvidence) {
  const auto segments = [](int known_columns) {
    Scene scene;
    scene.paint({20, 10, 20, 24}, 20);
    scene.paint({40, 10, 20, 24}, kUnknown);
    scene.paint({60 - known_columns, 10, known_columns, 24}, 40);
    scene.y(cv::Rect(40, 10, 20, 24)).setTo(240);  // so that it is filled from its own rim
    return scene.run();
  };
  EXPECT_EQ(segments(2), 1) << "10 % measured";
  EXPECT_EQ(segments(6), 2) << "30 % measured";
}

TEST(DepthSegments, SmallComponentMustBeMostlyMeasured) {
  const auto segments = [](int known_rows) {
    Scene scene;
    scene.paint({10, 10, 60, 40}, 20);
    scene.paint({30, 20, 8, 10}, kUnknown);  // 3.3 % of the blob
    scene.paint({30, 20, 8, known_rows}, 40);
    scene.y(cv::Rect(30, 20, 8, 10)).setTo(240);
    DepthSegments::Config c = config();
    c.min_part = 0.02;
    return scene.run(c);
  };
  EXPECT_EQ(segments(4), 1) << "40 % measured, enough for a large one";
  EXPECT_EQ(segments(9), 2) << "90 %";
}

TEST(DepthSegments, BlobWithoutDisparityIsOneWithoutDepth) {
  Scene scene;
  scene.paint({20, 10, 20, 24}, kUnknown);
  scene.paint({40, 10, 20, 24}, 40, 2);  // another blob's disparity is not taken
  EXPECT_EQ(scene.run(), 1);
  EXPECT_EQ(cv::countNonZero(scene.segment(cv::Rect(20, 10, 20, 24))), 0);
  EXPECT_EQ(cv::countNonZero(scene.filled(cv::Rect(20, 10, 20, 24)) != kNoDisparity), 0);
}

TEST(DepthSegments, OtherBlobsDoNotCount) {
  Scene scene;
  scene.paint({20, 10, 20, 24}, 20);
  scene.paint({40, 10, 20, 24}, 40, 2);
  EXPECT_EQ(scene.run(), 1);
  EXPECT_EQ(scene.run(config(), 2), 1);
}

TEST(DepthSegments, OnePixelAndTheWholePictureAreBlobs) {
  Scene one;
  one.paint({0, 0, 1, 1}, 20);
  EXPECT_EQ(one.run(), 1);
  EXPECT_EQ(one.segment(0, 0), 0);
  Scene all;
  all.paint({0, 0, kWidth / 2, kHeight}, 20);
  all.paint({kWidth / 2, 0, kWidth / 2, kHeight}, 40);
  EXPECT_EQ(all.run(), 2);
  EXPECT_TRUE(all.one({kWidth / 2, 0, kWidth / 2, kHeight}));
}

TEST(DepthSegments, MoreThanMostAreNoise) {
  Scene scene;
  for (int i = 0; i < 40; ++i) scene.paint({2 * i, 10, 2, 32}, i % 2 == 0 ? 20 : 40);
  DepthSegments::Config c = config();
  EXPECT_EQ(scene.run(c), 1) << "each is 2.5 % of the blob, under min_part";
  c.min_part = 0.02;
  EXPECT_EQ(scene.run(c), DepthSegments::kMost);
}

TEST(DepthSegments, Faults) {
  Arena arena;
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const auto fault_of = [&](auto&& change, int width = 16, int height = 16) {
    DepthSegments::Config c = config();
    change(c);
    const auto created = DepthSegments::create(c, width, height, arena);
    return created ? Fault{} : created.error();
  };
  const auto nothing = [](DepthSegments::Config&) {};
  EXPECT_EQ(fault_of(nothing), Fault{});
  EXPECT_EQ(fault_of([](auto& c) { c.jump = 0; }), Fault::kBadConfig);
  EXPECT_EQ(fault_of([&](auto& c) { c.jump = nan; }), Fault::kBadConfig);
  EXPECT_EQ(fault_of([](auto& c) { c.jump_px = 0; }), Fault::kBadConfig);
  EXPECT_EQ(fault_of([](auto& c) { c.min_px = 0; }), Fault::kBadConfig);
  EXPECT_EQ(fault_of([](auto& c) { c.min_part = -0.01; }), Fault::kBadConfig);
  EXPECT_EQ(fault_of([](auto& c) { c.min_part = 0.51; }), Fault::kBadConfig);
  EXPECT_EQ(fault_of([&](auto& c) { c.min_part = nan; }), Fault::kBadConfig);
  EXPECT_EQ(fault_of(nothing, 0, 16), Fault::kBadSize);
  EXPECT_EQ(fault_of(nothing, 16, 0), Fault::kBadSize);
  EXPECT_EQ(fault_of(nothing, 16, 8193), Fault::kBadSize);
  arena.seal();
  EXPECT_EQ(fault_of(nothing), Fault::kOutOfMemory);
}

// Against a flood from pixel to pixel, on blobs of steps, holes, rims and noise.
TEST(DepthSegments, ComponentsAreThoseOfAFlood) {
  cv::RNG random(8);
  int with_many = 0;
  for (int round = 0; round < 60; ++round) {
    Scene scene;
    for (int i = 0; i < 6; ++i) {
      const cv::Rect where(random.uniform(0, 60), random.uniform(0, 36), random.uniform(4, 34), random.uniform(4, 26));
      scene.paint(where, random.uniform(4, 40));
      if (i % 3 == 2) scene.labels(where & cv::Rect(where.x + 3, where.y + 3, 3, 40)).setTo(0);
    }
    for (std::uint16_t& d : scene.disparity) {
      if (d == kNoDisparity) continue;
      const int noise = random.uniform(0, 20);
      d = noise == 0 ? kNoDisparity : static_cast<std::uint16_t>(d + (round % 2 == 0 ? noise : 0));
    }
    DepthSegments::Config c = config();
    c.min_px = 12;
    c.min_part = 0;
    c.min_known = 0;
    const int found = scene.run(c);
    // A component of at least min_px pixels and sure of itself has a number, in the order of their first pixels.
    cv::Mat_<int> seen(scene.labels.size(), 0);
    int number = 0;
    const int area = cv::countNonZero(scene.labels);
    for (int y0 = 0; y0 < kHeight; ++y0) {
      for (int x0 = 0; x0 < kWidth; ++x0) {
        if (scene.labels(y0, x0) != 1 || seen(y0, x0) != 0) continue;
        std::vector<cv::Point> all{{x0, y0}};
        seen(y0, x0) = 1;
        int known = 0;
        for (std::size_t i = 0; i < all.size(); ++i) {
          const cv::Point p = all[i];
          known += scene.disparity(p) != kNoDisparity ? 1 : 0;
          for (const cv::Point& q :
               {p + cv::Point(1, 0), p - cv::Point(1, 0), p + cv::Point(0, 1), p - cv::Point(0, 1)}) {
            if (q.x < 0 || q.y < 0 || q.x >= kWidth || q.y >= kHeight) continue;
            if (scene.labels(q) != 1 || seen(q) != 0) continue;
            const double a = scene.filled(p);
            const double b = scene.filled(q);
            if (std::abs(a - b) > std::max(16.0, 0.05 * std::max(a, b))) continue;
            seen(q) = 1;
            all.push_back(q);
          }
        }
        const bool small = static_cast<double>(all.size()) < 0.05 * area;
        if (all.size() < 12 || (small && known < 0.6 * static_cast<double>(all.size()))) continue;
        if (found > 1) {
          for (const cv::Point& p : all) ASSERT_EQ(scene.segment(p), number) << round << ' ' << p.x << ' ' << p.y;
        }
        ++number;
      }
    }
    EXPECT_EQ(found, std::max(number, 1)) << round;
    with_many += found > 2 ? 1 : 0;
  }
  EXPECT_GT(with_many, 20);
}

}  // namespace
}  // namespace stereotrack
