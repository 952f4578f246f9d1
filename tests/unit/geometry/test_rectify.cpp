#include "pipeline/geometry/rectify.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>
#include <random>
#include <vector>

#include "pipeline/geometry/triangulate.hpp"

namespace stereotrack {
namespace {

constexpr int kWidth = 160;
constexpr int kHeight = 121;

/// A rig as a careful builder makes it: toe-in, tilt and roll of some degrees, barrel lenses.
StereoCalibration rig(LensModel lens = LensModel::kRadtan) {
  StereoCalibration c;
  c.left = {kWidth, kHeight, 170.5, 171.25, 79.0, 62.5, lens, {-0.3, 0.1, 1e-3, -5e-4}};
  c.right = {kWidth, kHeight, 172.0, 170.75, 83.0, 57.5, lens, {-0.28, 0.09, -4e-4, 7e-4}};
  if (lens == LensModel::kEquidistant) {
    c.left.distortion = {0.01, -0.01, 0.006, -0.0017};
    c.right.distortion = {0.013, -0.015, 0.009, -0.0023};
    c.left.fx = c.left.fy = c.right.fx = c.right.fy = 60;
  }
  c.R_right_left =
      (Eigen::AngleAxisd(0.04, Eigen::Vector3d::UnitX()) * Eigen::AngleAxisd(-0.1, Eigen::Vector3d::UnitY()) *
       Eigen::AngleAxisd(0.03, Eigen::Vector3d::UnitZ()))
          .toRotationMatrix();
  c.t_right_left = {-0.3, 0.01, 0.02};
  return c;
}

StereoCalibration rectified_rig() {
  StereoCalibration c;
  c.left = {kWidth, kHeight, 721.5377, 721.5377, 79.5593, 52.854, LensModel::kRadtan, {}};
  c.right = c.left;
  c.t_right_left = {-0.537, 0, 0};
  return c;
}

cv::Mat noise(int width, int height) {
  cv::Mat picture(height, width, CV_8U);
  std::mt19937 random(7);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) picture.at<std::uint8_t>(y, x) = static_cast<std::uint8_t>(random() & 255U);
  }
  return picture;
}

template <class T>
ImageView<const std::uint8_t> view_of(const T& mat) {
  return {mat.data, mat.cols, mat.rows, static_cast<std::ptrdiff_t>(mat.step)};
}

cv::Matx33d matrix_of(const Eigen::Matrix3d& m) {
  return {m(0, 0), m(0, 1), m(0, 2), m(1, 0), m(1, 1), m(1, 2), m(2, 0), m(2, 1), m(2, 2)};
}

TEST(Rectify, HalfRotationTwiceIsTheRotation) {
  for (double angle : {0.0, 1e-12, 1e-6, 0.1, 1.5, 2.5, 3.1}) {
    for (const Eigen::Vector3d& axis :
         {Eigen::Vector3d(1, 0, 0), Eigen::Vector3d(0, -1, 0), Eigen::Vector3d(0, 0, 1), Eigen::Vector3d(1, 2, -3)}) {
      const Eigen::Matrix3d whole = Eigen::AngleAxisd(angle, axis.normalized()).toRotationMatrix();
      const Eigen::Matrix3d half = half_rotation(whole);
      EXPECT_NEAR((half * half - whole).norm(), 0, 1e-12) << angle;
      EXPECT_NEAR((half - Eigen::AngleAxisd(angle / 2, axis.normalized()).toRotationMatrix()).norm(), 0, 1e-12);
    }
  }
  EXPECT_EQ(half_rotation(Eigen::Matrix3d::Identity()), Eigen::Matrix3d(Eigen::Matrix3d::Identity()));
}

TEST(Rectify, RotationRoundedInAFileIsMadeARotationAgain) {
  const Eigen::Matrix3d exact = rig().R_right_left;
  Eigen::Matrix3d rounded = exact;
  for (int i = 0; i < 9; ++i) rounded(i) = std::round(exact(i) * 1e4) / 1e4;
  const Result<Eigen::Matrix3d> result = nearest_rotation(rounded);
  ASSERT_TRUE(result.has_value());
  EXPECT_NEAR((result->transpose() * *result - Eigen::Matrix3d::Identity()).norm(), 0, 1e-14);
  EXPECT_NEAR((*result - exact).norm(), 0, 2e-4);
  EXPECT_EQ(nearest_rotation(Eigen::Matrix3d::Zero()).error(), Fault::kBadConfig);
  EXPECT_EQ(nearest_rotation(-exact).error(), Fault::kBadConfig);
  EXPECT_EQ(nearest_rotation(1.05 * exact).error(), Fault::kBadConfig);
  EXPECT_EQ(nearest_rotation(exact * std::numeric_limits<double>::quiet_NaN()).error(), Fault::kNotFinite);
}

TEST(Rectify, AxesAreThoseOfOpenCv) {
  const StereoCalibration c = rig();
  const Result<RectificationPlan> plan = plan_rectification(c, kWidth, kHeight);
  ASSERT_TRUE(plan.has_value());
  const auto K = [](const CameraModel& m) { return cv::Matx33d(m.fx, 0, m.cx, 0, m.fy, m.cy, 0, 0, 1); };
  const auto D = [](const CameraModel& m) { return std::vector<double>(m.distortion.begin(), m.distortion.end()); };
  cv::Mat R1, R2, P1, P2, Q;
  cv::stereoRectify(K(c.left), D(c.left), K(c.right), D(c.right), {kWidth, kHeight}, matrix_of(c.R_right_left),
                    cv::Vec3d(c.t_right_left.x(), c.t_right_left.y(), c.t_right_left.z()), R1, R2, P1, P2, Q,
                    cv::CALIB_ZERO_DISPARITY);
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      EXPECT_NEAR(plan->R_rect_left(i, j), R1.at<double>(i, j), 1e-9);
      EXPECT_NEAR(plan->R_rect_right(i, j), R2.at<double>(i, j), 1e-9);
    }
  }
  EXPECT_DOUBLE_EQ(plan->geometry.baseline, c.t_right_left.norm());
}

TEST(Rectify, APointIsOnTheSameRowOfBothViewsAndItsDisparityGivesItsDepth) {
  for (LensModel lens : {LensModel::kRadtan, LensModel::kEquidistant}) {
    const StereoCalibration c = rig(lens);
    Arena arena;
    const Result<Rectifier> rectifier = Rectifier::create(c, kWidth, kHeight, arena);
    ASSERT_TRUE(rectifier.has_value());
    const RectifiedGeometry& g = rectifier->geometry();
    const RectificationPlan& plan = rectifier->plan();
    for (const Eigen::Vector3d& p :
         {Eigen::Vector3d(0.1, 0.2, 2), Eigen::Vector3d(-0.3, -0.1, 1.5), Eigen::Vector3d(0.5, 0.3, 6)}) {
      const Eigen::Vector3d in_right = c.R_right_left * p + c.t_right_left;
      const Eigen::Vector3d l = plan.R_rect_left * p;
      const Eigen::Vector3d r = plan.R_rect_right * in_right;
      const double u_left = g.cx_left + g.f * l.x() / l.z();
      const double u_right = g.cx_right + g.f * r.x() / r.z();
      const double v = g.cy + g.f * l.y() / l.z();
      EXPECT_NEAR(v, g.cy + g.f * r.y() / r.z(), 1e-9);
      const double d = u_left - u_right - g.offset;
      const std::optional<Estimate3> point = triangulate(g, {u_left, v, d}, {1, 1, 1});
      ASSERT_TRUE(point.has_value());
      EXPECT_NEAR((point->mean - l).norm(), 0, 1e-9);

      const std::optional<Eigen::Vector2d> raw = rectifier->raw_from_ray(l.x(), l.y(), l.z());
      ASSERT_TRUE(raw.has_value());
      const std::optional<Eigen::Vector2d> expected = plan.left.project({p.x() / p.z(), p.y() / p.z()});
      EXPECT_NEAR((*raw - *expected).norm(), 0, 1e-9);
      const std::optional<Eigen::Vector2d> back = rectifier->rectified_from_raw(raw->x(), raw->y());
      ASSERT_TRUE(back.has_value());
      EXPECT_NEAR(back->x(), u_left, 1e-8);
      EXPECT_NEAR(back->y(), v, 1e-8);
    }
  }
}

TEST(Rectify, OffsetIsAWholeNumberOfPixels) {
  const Result<RectificationPlan> plan = plan_rectification(rig(), kWidth, kHeight);
  ASSERT_TRUE(plan.has_value());
  EXPECT_EQ(plan->geometry.cx_left - plan->geometry.cx_right, plan->geometry.offset);
  EXPECT_NE(plan->geometry.offset, 0);
}

TEST(Rectify, EveryPixelOfBothRawPicturesIsOnItsCanvas) {
  const StereoCalibration c = rig();
  Arena arena;
  const Result<Rectifier> rectifier = Rectifier::create(c, kWidth, kHeight, arena);
  ASSERT_TRUE(rectifier.has_value());
  const RectifiedGeometry& g = rectifier->geometry();
  const RectificationPlan& plan = rectifier->plan();
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const Rectifier::PointF& p = rectifier->rectified_from_raw().at(x, y);
      ASSERT_TRUE(p.valid());
      EXPECT_TRUE(p.x > -0.5F && p.x < static_cast<float>(g.width_left) - 0.5F) << x << " " << y << " " << p.x;
      EXPECT_TRUE(p.y > -0.5F && p.y < static_cast<float>(g.height) - 0.5F) << x << " " << y << " " << p.y;
      const std::optional<Eigen::Vector2d> ray = plan.right.unproject({x, y});
      ASSERT_TRUE(ray.has_value());
      const Eigen::Vector3d r = plan.R_rect_right * Eigen::Vector3d(ray->x(), ray->y(), 1);
      const double u = g.cx_right + g.f * r.x() / r.z();
      EXPECT_TRUE(u > -0.5 && u < g.width_right - 0.5) << x << " " << y << " " << u;
    }
  }
}

TEST(Rectify, PicturesAreThoseOfCvRemapBitForBit) {
  for (LensModel lens : {LensModel::kRadtan, LensModel::kEquidistant}) {
    const StereoCalibration c = rig(lens);
    Arena arena;
    const Result<Rectifier> rectifier = Rectifier::create(c, kWidth, kHeight, arena);
    ASSERT_TRUE(rectifier.has_value());
    const RectifiedGeometry& g = rectifier->geometry();
    const cv::Mat raw = noise(kWidth, kHeight);
    for (View view : {View::kLeft, View::kRight}) {
      const bool is_left = view == View::kLeft;
      const CameraModel& m = is_left ? c.left : c.right;
      const int width = is_left ? g.width_left : g.width_right;
      const cv::Matx33d K(m.fx, 0, m.cx, 0, m.fy, m.cy, 0, 0, 1);
      const cv::Matx33d R = matrix_of(is_left ? rectifier->plan().R_rect_left : rectifier->plan().R_rect_right);
      const cv::Matx33d P(g.f, 0, is_left ? g.cx_left : g.cx_right, 0, g.f, g.cy, 0, 0, 1);
      cv::Mat map_x, map_y, expected;
      if (lens == LensModel::kRadtan) {
        const std::vector<double> D(m.distortion.begin(), m.distortion.end());
        cv::initUndistortRectifyMap(K, D, R, P, {width, g.height}, CV_32F, map_x, map_y);
      } else {
        const cv::Vec4d D(m.distortion[0], m.distortion[1], m.distortion[2], m.distortion[3]);
        cv::fisheye::initUndistortRectifyMap(K, D, R, P, {width, g.height}, CV_32F, map_x, map_y);
      }
      cv::remap(raw, expected, map_x, map_y, cv::INTER_LINEAR);
      cv::Mat out(g.height, width, CV_8U, cv::Scalar(99));
      rectifier->rectify(view_of(raw), view, {out.data, width, g.height, static_cast<std::ptrdiff_t>(out.step)});
      cv::Mat picked(g.height, width, CV_8U, cv::Scalar(99));
      rectifier->rectify(view_of(raw), view, {picked.data, width, g.height, static_cast<std::ptrdiff_t>(picked.step)},
                         Sampling::kNearest);
      int shown = 0;
      int different = 0;
      for (int v = 0; v < g.height; ++v) {
        for (int u = 0; u < width; ++u) {
          if (rectifier->mask(view).at(u, v) == 0) {
            EXPECT_EQ(out.at<std::uint8_t>(v, u), 0);
            EXPECT_EQ(picked.at<std::uint8_t>(v, u), 0);
            EXPECT_EQ(rectifier->raw_from_rectified(view).at(u, v), Rectifier::Point16{});
            continue;
          }
          ++shown;
          if (out.at<std::uint8_t>(v, u) != expected.at<std::uint8_t>(v, u)) ++different;
          const Rectifier::Point16 nearest = rectifier->raw_from_rectified(view).at(u, v);
          EXPECT_EQ(picked.at<std::uint8_t>(v, u), raw.at<std::uint8_t>(nearest.y, nearest.x));
          EXPECT_NEAR(nearest.x, map_x.at<float>(v, u), 0.52);
          EXPECT_NEAR(nearest.y, map_y.at<float>(v, u), 0.52);
        }
      }
      EXPECT_GT(shown, kWidth * kHeight * 3 / 4);
      // Where a position falls on the edge between two 1/32 px, OpenCV's float map may round it the other way.
      EXPECT_LE(different, shown / 1000);
    }
  }
}

TEST(Rectify, RectifiedRigGetsTheIdentity) {
  Arena arena;
  const Result<Rectifier> rectifier = Rectifier::create(rectified_rig(), kWidth, kHeight, arena);
  ASSERT_TRUE(rectifier.has_value());
  const RectifiedGeometry& g = rectifier->geometry();
  EXPECT_EQ(g.width_left, kWidth);
  EXPECT_EQ(g.width_right, kWidth);
  EXPECT_EQ(g.height, kHeight);
  EXPECT_EQ(g.f, 721.5377);
  EXPECT_EQ(g.cx_left, 79.5593);
  EXPECT_EQ(g.cx_right, 79.5593);
  EXPECT_EQ(g.cy, 52.854);
  EXPECT_EQ(g.offset, 0);
  EXPECT_EQ(g.baseline, 0.537);
  const cv::Mat raw = noise(kWidth, kHeight);
  for (View view : {View::kLeft, View::kRight}) {
    cv::Mat out(kHeight, kWidth, CV_8U);
    rectifier->rectify(view_of(raw), view, {out.data, kWidth, kHeight, static_cast<std::ptrdiff_t>(out.step)});
    EXPECT_EQ(cv::countNonZero(out != raw), 0);
    for (int v = 0; v < kHeight; ++v) {
      for (int u = 0; u < kWidth; ++u) {
        ASSERT_EQ(rectifier->mask(view).at(u, v), 255);
        ASSERT_EQ(rectifier->raw_from_rectified(view).at(u, v),
                  (Rectifier::Point16{static_cast<std::int16_t>(u), static_cast<std::int16_t>(v)}));
      }
    }
  }
  EXPECT_NEAR(rectifier->rectified_from_raw().at(17, 5).x, 17.0F, 1e-4F);
}

TEST(Rectify, BoxOfTheRawPictureLiesOnItsPartOfTheCanvas) {
  Arena arena;
  const auto made = Rectifier::create(rig(), kWidth, kHeight, arena);
  ASSERT_TRUE(made.has_value());
  const RectifiedGeometry& g = made->geometry();
  for (const Rect& box :
       {Rect{70, 50, 20, 15}, Rect{0, 0, kWidth, kHeight}, Rect{150, 0, 10, 12}, Rect{9, 100, 1, 1}}) {
    const Rect part = made->on_left_canvas(box);
    // Each pixel of the box falls into the part, and the part is no wider than that needs: the rim reaches its sides.
    double left = 1e9;
    double right = -1e9;
    for (int y = box.top; y < box.bottom(); ++y) {
      for (int x = box.left; x < box.right(); ++x) {
        const Rectifier::PointF p = made->rectified_from_raw().at(x, y);
        const double u = p.x;
        const double v = p.y;
        if (!p.valid() || u < 0 || v < 0 || u > g.width_left - 1 || v > g.height - 1) continue;
        EXPECT_TRUE(u >= part.left && u <= part.right() - 1 && v >= part.top && v <= part.bottom() - 1);
        left = std::min(left, u);
        right = std::max(right, u);
      }
    }
    EXPECT_LE(left - part.left, 2.0);
    EXPECT_LE(part.right() - 1 - right, 2.0);
  }
}

TEST(Rectify, BoxOfARectifiedRigIsGrownByAPixelAndClipped) {
  Arena arena;
  const auto made = Rectifier::create(rectified_rig(), kWidth, kHeight, arena);
  ASSERT_TRUE(made.has_value());
  const auto sides = [&](const Rect& box) {
    const Rect part = made->on_left_canvas(box);
    return std::array{part.left, part.top, part.right(), part.bottom()};
  };
  EXPECT_EQ(sides({20, 30, 11, 5}), (std::array{19, 29, 32, 36}));
  EXPECT_EQ(sides({0, 0, kWidth, kHeight}), (std::array{0, 0, kWidth, kHeight}));
  EXPECT_TRUE(made->on_left_canvas({}).empty());
}

TEST(Rectify, CanvasNeverExceedsOneAndAHalfTimesThePicture) {
  StereoCalibration c = rig(LensModel::kEquidistant);
  for (CameraModel* m : {&c.left, &c.right}) m->fx = m->fy = 50;
  Arena arena;
  const Result<Rectifier> rectifier = Rectifier::create(c, kWidth, kHeight, arena);
  ASSERT_TRUE(rectifier.has_value());
  const RectifiedGeometry& g = rectifier->geometry();
  EXPECT_EQ(g.width_left, kWidth * 3 / 2);
  EXPECT_EQ(g.width_right, kWidth * 3 / 2);
  EXPECT_EQ(g.height, kHeight * 3 / 2);
  const std::optional<Eigen::Vector2d> centre = rectifier->rectified_from_raw((kWidth - 1) / 2.0, (kHeight - 1) / 2.0);
  ASSERT_TRUE(centre.has_value());
  EXPECT_NEAR(centre->x(), g.width_left / 2.0, 1.0);
  EXPECT_NEAR(centre->y(), g.height / 2.0, 1.0);
}

TEST(Rectify, SmallestPictureIsTwoByTwo) {
  StereoCalibration c = rectified_rig();
  for (CameraModel* m : {&c.left, &c.right}) m->width = m->height = 0;
  Arena arena;
  for (int side : {-1, 0, 1}) {
    EXPECT_EQ(Rectifier::create(c, side, 8, arena).error(), Fault::kBadSize);
    EXPECT_EQ(Rectifier::create(c, 8, side, arena).error(), Fault::kBadSize);
  }
  const Result<Rectifier> rectifier = Rectifier::create(c, 2, 2, arena);
  ASSERT_TRUE(rectifier.has_value());
  const std::uint8_t raw[4] = {1, 2, 3, 4};
  std::uint8_t out[4] = {};
  rectifier->rectify({raw, 2, 2, 2}, View::kRight, {out, 2, 2, 2});
  EXPECT_TRUE(std::equal(std::begin(raw), std::end(raw), std::begin(out)));
}

TEST(Rectify, OutputOfAnotherSizeIsLeftUntouched) {
  Arena arena;
  const Result<Rectifier> rectifier = Rectifier::create(rectified_rig(), kWidth, kHeight, arena);
  ASSERT_TRUE(rectifier.has_value());
  const cv::Mat raw = noise(kWidth, kHeight);
  std::vector<std::uint8_t> out(static_cast<std::size_t>(kWidth) * kHeight, 77);
  rectifier->rectify(view_of(raw), View::kLeft, {out.data(), kWidth - 1, kHeight, kWidth});
  rectifier->rectify(view_of(noise(kWidth, kHeight - 1)), View::kLeft, {out.data(), kWidth, kHeight, kWidth});
  EXPECT_TRUE(std::all_of(out.begin(), out.end(), [](std::uint8_t v) { return v == 77; }));
}

TEST(Rectify, RefusesWhatIsNoStereoRig) {
  Arena arena;
  const auto fault = [&arena](const StereoCalibration& c) {
    return Rectifier::create(c, kWidth, kHeight, arena).error();
  };
  StereoCalibration c = rig();
  c.left.width = kWidth + 1;
  EXPECT_EQ(fault(c), Fault::kBadSize);
  c = rig();
  c.t_right_left.setZero();
  EXPECT_EQ(fault(c), Fault::kBadConfig);
  c = rig();
  c.t_right_left.x() = 0.3;
  EXPECT_EQ(fault(c), Fault::kBadConfig);
  c = rig();
  c.t_right_left = {-0.1, 0.3, 0};
  EXPECT_EQ(fault(c), Fault::kBadConfig);
  c = rig();
  c.t_right_left.y() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(fault(c), Fault::kNotFinite);
  c = rig();
  c.R_right_left(0, 1) += 0.1;
  EXPECT_EQ(fault(c), Fault::kBadConfig);
  c = rig();
  c.right.distortion[0] = -8;
  EXPECT_EQ(fault(c), Fault::kBadConfig);
  c = rig();
  c.left.fy = -1;
  EXPECT_EQ(fault(c), Fault::kBadConfig);
}

TEST(Rectify, SealedArenaIsAFault) {
  Arena arena;
  arena.seal();
  EXPECT_EQ(Rectifier::create(rig(), kWidth, kHeight, arena).error(), Fault::kOutOfMemory);
}

}  // namespace
}  // namespace stereotrack
