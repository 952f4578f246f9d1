#include "firmware-app/render/zones.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "firmware-app/render/painter.hpp"
#include "scene.hpp"

namespace stereotrack::render {
namespace {

Zone polygon() {
  Zone zone;
  zone.kind = Zone::Kind::kPicture;
  for (const Zone::Corner& corner : {Zone::Corner{200, 100}, {300, 100}, {300, 220}, {200, 220}}) {
    EXPECT_TRUE(zone.corners.push(corner));
  }
  return zone;
}

Zone box() {
  Zone zone;
  zone.x_m = {-0.5, 0.5};
  zone.y_m = {-1, 0.5};
  zone.z_m = {1, 1.5};
  return zone;
}

class DrawnZones : public testing::Test {
 protected:
  DrawnZones() {
    auto made = Rectifier::create(rig(), kWidth, kHeight, arena_);
    EXPECT_TRUE(made.has_value());
    if (made) rectifier_.emplace(*made);
  }
  [[nodiscard]] cv::Mat drawn(const std::vector<ShownZone>& zones) const {
    Painter painter(kWidth, kHeight, &rectifier_->geometry(), {1, "m"}, zones);
    Scene scene(true);
    scene.go_to(1);
    scene.result().tracks = {};
    return painter.draw(scene.pair(), scene.result()).clone();
  }
  /// Pixels that differ in a part of the picture, given in raw pixels; drawn three times as large.
  [[nodiscard]] static int differ(const cv::Mat& a, const cv::Mat& b, const cv::Rect& raw) {
    const cv::Rect part(3 * raw.x, 36 + 3 * raw.y, 3 * raw.width, 3 * raw.height);
    cv::Mat apart;
    cv::absdiff(a(part), b(part), apart);
    std::vector<cv::Mat> planes;
    cv::split(apart, planes);
    return cv::countNonZero(planes[0] | planes[1] | planes[2]);
  }

  Arena arena_;
  std::optional<Rectifier> rectifier_;
};

TEST_F(DrawnZones, NoneChangesNothing) { EXPECT_EQ(cv::norm(drawn({}), drawn({}), cv::NORM_INF), 0); }

TEST_F(DrawnZones, IgnoredPolygonIsDimmedAndNothingBesideIt) {
  const cv::Mat plain = drawn({});
  const cv::Mat with = drawn({{"pole", polygon(), ShownZone::Use::kIgnored, {}}});
  EXPECT_GT(differ(plain, with, {205, 120, 90, 95}), 8 * 9 * 90 * 95 / 10);
  EXPECT_EQ(differ(plain, with, {0, 0, 195, kHeight}), 0);
  const cv::Rect inside(3 * 220, 36 + 3 * 140, 3 * 60, 3 * 60);
  EXPECT_LT(cv::mean(with(inside))[1], 0.75 * cv::mean(plain(inside))[1]);
}

TEST_F(DrawnZones, OtherPolygonsAreOutlines) {
  const cv::Mat plain = drawn({});
  for (const auto use : {ShownZone::Use::kSignals, ShownZone::Use::kNoneBegin}) {
    const cv::Mat with = drawn({{"door", polygon(), use, {}}});
    EXPECT_EQ(differ(plain, with, {205, 120, 90, 95}), 0);
    EXPECT_GT(differ(plain, with, {195, 90, 110, 140}), 300);
  }
}

TEST_F(DrawnZones, BoxIsInTheTopViewWithItsName) {
  const cv::Mat plain = drawn({});
  const cv::Mat with = drawn({{"hall", box(), ShownZone::Use::kVolume, {}}});
  EXPECT_EQ(cv::norm(plain.colRange(0, 960), with.colRange(0, 960), cv::NORM_INF), 0) << "no floor was found for it";
  EXPECT_GT(cv::norm(plain.colRange(968, plain.cols), with.colRange(968, plain.cols), cv::NORM_INF), 50);
}

TEST_F(DrawnZones, FloorLiesWhereTheCameraSeesIt) {
  // f = 300 px about (160, 120): (x, 0.5, z) is at column 160 + 300 x / z, row 120 + 150 / z. In other units, too.
  for (const double unit_m : {1.0, 3.0}) {
    Zone zone = box();
    for (Zone::Range* range : {&zone.x_m, &zone.y_m, &zone.z_m}) {
      range->from *= unit_m;
      range->to *= unit_m;
    }
    const std::vector<Polyline> floor = floor_of(zone, *rectifier_, unit_m);
    ASSERT_EQ(floor.size(), 1U);
    cv::Point2d low(1e9, 1e9);
    cv::Point2d high(-1e9, -1e9);
    for (const cv::Point2d& p : floor[0]) {
      low = {std::min(low.x, p.x), std::min(low.y, p.y)};
      high = {std::max(high.x, p.x), std::max(high.y, p.y)};
    }
    EXPECT_NEAR(low.x, 10, 0.01);
    EXPECT_NEAR(high.x, 310, 0.01);
    EXPECT_NEAR(low.y, 220, 0.01);
    EXPECT_NEAR(high.y, 270, 0.01);
  }
}

TEST_F(DrawnZones, FloorThatIsAnywhereIsNotDrawnAndOneWithoutEndEnds) {
  Zone zone = box();
  zone.x_m = {-1e6, 1e6};
  zone.z_m = {-1e6, 1e6};
  for (const Polyline& piece : floor_of(zone, *rectifier_, 1)) {
    for (const cv::Point2d& p : piece) EXPECT_LT(std::hypot(p.x, p.y), 1e5);
  }
  zone.y_m = {-1e6, 1e6};
  EXPECT_TRUE(floor_of(zone, *rectifier_, 1).empty());
  EXPECT_TRUE(floor_of(box(), *rectifier_, 0).empty()) << "unit not known";
  zone = box();
  zone.z_m = {-9, -2};
  EXPECT_TRUE(floor_of(zone, *rectifier_, 1).empty()) << "behind the camera";
}

TEST_F(DrawnZones, NamesTellTheUse) {
  EXPECT_EQ(text_of({"a", {}, ShownZone::Use::kSignals, {}}), "a");
  EXPECT_EQ(text_of({"a", {}, ShownZone::Use::kNoneBegin, {}}), "a: none begins");
  EXPECT_EQ(text_of({"a", {}, ShownZone::Use::kIgnored, {}}), "a: ignored");
  EXPECT_EQ(text_of({"a", {}, ShownZone::Use::kVolume, {}}), "a: volume");
}

}  // namespace
}  // namespace stereotrack::render
