#include <gtest/gtest.h>

#include <random>

#include "pipeline/core/arena.hpp"
#include "pipeline/geometry/lazy_canvas.hpp"
#include "pipeline/geometry/rectify.hpp"
#include "tests/support/each_target.hpp"

namespace stereotrack {
namespace {

constexpr int kWidth = 100;
constexpr int kHeight = 60;

/// A rig whose left camera is turned a little, so that canvases differ from raw pictures.
class LazyCanvasTest : public testing::Test {
 protected:
  void SetUp() override {
    StereoCalibration calibration;
    calibration.left.width = calibration.right.width = kWidth;
    calibration.left.height = calibration.right.height = kHeight;
    calibration.left.fx = calibration.left.fy = calibration.right.fx = calibration.right.fy = 90;
    calibration.left.cx = calibration.right.cx = 50;
    calibration.left.cy = calibration.right.cy = 30;
    calibration.left.distortion[0] = calibration.right.distortion[0] = -0.1;
    calibration.R_right_left = Eigen::Matrix3d::Identity();
    calibration.t_right_left = Eigen::Vector3d(-1, 0.02, 0);
    const auto made = Rectifier::create(calibration, kWidth, kHeight, arena_);
    ASSERT_TRUE(made.has_value());
    rectifier_.emplace(*made);
    raw_ = noise(1);
    canvas_ = LazyCanvas::create(rectifier_->table(View::kLeft), Sampling::kBilinear, arena_);
    whole_ = arena_.image<std::uint8_t>(rectifier_->geometry().width_left, rectifier_->geometry().height);
  }

  ImageView<std::uint8_t> noise(unsigned seed) {
    std::mt19937 engine(seed);
    const ImageView<std::uint8_t> picture = arena_.image<std::uint8_t>(kWidth, kHeight);
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) picture.at(x, y) = static_cast<std::uint8_t>(1 + engine() % 255);
    }
    return picture;
  }

  void expect_drawn(ImageView<const std::uint8_t> got, const Rect& part) const {
    const Rect inside = intersect(part, {0, 0, whole_.width, whole_.height});
    for (int y = inside.top; y < inside.bottom(); ++y) {
      for (int x = inside.left; x < inside.right(); ++x) ASSERT_EQ(got.at(x, y), whole_.at(x, y)) << x << ' ' << y;
    }
  }

  Arena arena_;
  std::optional<Rectifier> rectifier_;
  ImageView<std::uint8_t> raw_;
  LazyCanvas canvas_;
  ImageView<std::uint8_t> whole_;
};

TEST_F(LazyCanvasTest, WhatWasAskedForIsTheRectifiedPicture) {
  test::on_each_target([&] {
    rectifier_->rectify(raw_, View::kLeft, whole_);
    canvas_.show(raw_);
    const Rect all{0, 0, whole_.width, whole_.height};
    // Apart, overlapping, left and right of what is there, inside of it, across the picture's sides, empty.
    for (const Rect& part :
         {Rect{40, 20, 9, 5}, Rect{70, 22, 3, 1}, Rect{10, 18, 50, 4}, Rect{41, 21, 2, 2}, Rect{-20, -20, 30, 30},
          Rect{90, 50, 50, 50}, Rect{300, 300, 5, 5}, Rect{5, 5, 0, 3}, all}) {
      expect_drawn(canvas_.with(part), part);
    }
    expect_drawn(canvas_.whole(), all);
  });
}

TEST_F(LazyCanvasTest, NothingElseIsDrawn) {
  canvas_.show(raw_);
  const ImageView<const std::uint8_t> canvas = canvas_.with({40, 20, 8, 5});
  EXPECT_NE(canvas.at(44, 22), 0);
  EXPECT_EQ(canvas.at(44, 19), 0);
  EXPECT_EQ(canvas.at(44, 25), 0);
  EXPECT_EQ(canvas.at(39, 22), 0);
  EXPECT_EQ(canvas.at(48, 22), 0);
}

TEST_F(LazyCanvasTest, ANewPictureIsDrawnAnew) {
  const Rect part{30, 20, 20, 10};
  canvas_.show(raw_);
  (void)canvas_.with(part);
  const ImageView<std::uint8_t> next = noise(2);
  canvas_.show(next);
  rectifier_->rectify(next, View::kLeft, whole_);
  expect_drawn(canvas_.with(part), part);
}

TEST_F(LazyCanvasTest, ADefaultOneIsEmpty) {
  LazyCanvas none;
  none.show(raw_);
  EXPECT_TRUE(none.with({0, 0, 5, 5}).empty());
  EXPECT_TRUE(none.whole().empty());
}

}  // namespace
}  // namespace stereotrack
