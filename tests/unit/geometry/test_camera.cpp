#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <opencv2/calib3d.hpp>
#include <vector>

#include "pipeline/geometry/camera.hpp"

namespace stereotrack {
namespace {

CameraModel model(LensModel lens, std::initializer_list<double> coefficients) {
  CameraModel m;
  m.width = 640;
  m.height = 480;
  m.fx = 500;
  m.fy = 510;
  m.cx = 321.5;
  m.cy = 236.25;
  m.lens = lens;
  std::copy(coefficients.begin(), coefficients.end(), m.distortion.begin());
  return m;
}

/// A lens of each kind, of the strength that real ones have.
std::vector<CameraModel> lenses() {
  return {model(LensModel::kRadtan, {}),
          model(LensModel::kRadtan, {-0.28, 0.07, 2e-4, -3e-4}),
          model(LensModel::kRadtan, {-0.32, 0.107, -2.6e-4, -2.5e-4, -0.01}),
          model(LensModel::kRadtan, {0.19, -0.018, -6e-4, 5e-5, -2e-4, 0.54, -0.028, 0.001}),
          model(LensModel::kRadtan, {-0.2, 0.05, 1e-3, -1e-3, 0.01, 0.02, 0.01, 0.003, 0.01, -0.002, -0.008, 0.004}),
          model(LensModel::kRadtan,
                {-0.2, 0.05, 1e-3, -1e-3, 0.01, 0.02, 0.01, 0.003, 0.01, -0.002, -0.008, 0.004, 0.03, -0.05}),
          model(LensModel::kEquidistant, {}),
          model(LensModel::kEquidistant, {0.0102, -0.0108, 0.0059, -0.0017}),
          model(LensModel::kEquidistant, {-0.0033, 0.0541, -0.0516, 0.0107})};
}

cv::Point2d by_opencv(const CameraModel& m, double x, double y) {
  const cv::Matx33d K(m.fx, 0, m.cx, 0, m.fy, m.cy, 0, 0, 1);
  std::vector<cv::Point2d> out;
  if (m.lens == LensModel::kEquidistant) {
    const cv::Vec4d D(m.distortion[0], m.distortion[1], m.distortion[2], m.distortion[3]);
    cv::fisheye::distortPoints(std::vector<cv::Point2d>{{x, y}}, out, K, D);
  } else {
    const std::vector<double> D(m.distortion.begin(), m.distortion.end());
    cv::projectPoints(std::vector<cv::Point3d>{{x, y, 1}}, cv::Vec3d(), cv::Vec3d(), K, D, out);
  }
  return out[0];
}

TEST(Camera, ProjectsAsOpenCvDoes) {
  for (const CameraModel& m : lenses()) {
    const Result<Camera> camera = Camera::create(m);
    ASSERT_TRUE(camera.has_value());
    for (double y = -0.5; y <= 0.5; y += 0.0625) {
      for (double x = -0.7; x <= 0.7; x += 0.0625) {
        const std::optional<Eigen::Vector2d> pixel = camera->project({x, y});
        ASSERT_TRUE(pixel.has_value()) << x << " " << y;
        const cv::Point2d expected = by_opencv(m, x, y);
        ASSERT_NEAR(pixel->x(), expected.x, 1e-9);
        ASSERT_NEAR(pixel->y(), expected.y, 1e-9);
      }
    }
  }
}

TEST(Camera, UnprojectUndoesProjectOverTheWholePicture) {
  for (const CameraModel& m : lenses()) {
    const Result<Camera> camera = Camera::create(m);
    ASSERT_TRUE(camera.has_value());
    for (int y = 0; y < m.height; y += 13) {
      for (int x = 0; x < m.width; x += 13) {
        const std::optional<Eigen::Vector2d> ray = camera->unproject({x, y});
        ASSERT_TRUE(ray.has_value()) << x << " " << y;
        const std::optional<Eigen::Vector2d> pixel = camera->project(*ray);
        ASSERT_TRUE(pixel.has_value()) << x << " " << y;
        ASSERT_NEAR(pixel->x(), x, 2e-9);
        ASSERT_NEAR(pixel->y(), y, 2e-9);
      }
    }
  }
}

TEST(Camera, PixelOfAPinholeByHand) {
  const Result<Camera> camera = Camera::create(model(LensModel::kRadtan, {}));
  ASSERT_TRUE(camera.has_value());
  const std::optional<Eigen::Vector2d> pixel = camera->project({0.1, -0.2});
  ASSERT_TRUE(pixel.has_value());
  EXPECT_DOUBLE_EQ(pixel->x(), 371.5);
  EXPECT_DOUBLE_EQ(pixel->y(), 134.25);
}

TEST(Camera, PixelOfABarrelLensByHand) {
  // k1 = -0.25 at r = 0.4: x' = 0.4 (1 - 0.25 * 0.16) = 0.384, u = 500 * 0.384 + 321.5
  const Result<Camera> camera = Camera::create(model(LensModel::kRadtan, {-0.25}));
  ASSERT_TRUE(camera.has_value());
  EXPECT_NEAR(camera->project({0.4, 0})->x(), 513.5, 1e-12);
  EXPECT_NEAR(camera->unproject({513.5, 236.25})->x(), 0.4, 1e-11);
}

TEST(Camera, RayWhereTheLensEquationBendsBackHasNoPixel) {
  // r (1 - r^2 / 4) grows up to r = sqrt(4 / 3).
  const Result<Camera> camera = Camera::create(model(LensModel::kRadtan, {-0.25}));
  ASSERT_TRUE(camera.has_value());
  EXPECT_NEAR(camera->max_radius(), std::sqrt(4.0 / 3.0), 1e-9);
  EXPECT_TRUE(camera->project({1.15, 0}).has_value());
  EXPECT_FALSE(camera->project({1.16, 0}).has_value());
  EXPECT_FALSE(camera->project({1.9, 0}).has_value()) << "would land inside the picture";
  const double edge = 321.5 + 500 * (2.0 / 3.0) * std::sqrt(4.0 / 3.0);
  EXPECT_TRUE(camera->unproject({edge - 0.01, 236.25}).has_value());
  EXPECT_FALSE(camera->unproject({edge + 0.01, 236.25}).has_value());
}

TEST(Camera, FisheyePixelBeyondTheLastAngleHasNoRay) {
  const Result<Camera> camera = Camera::create(model(LensModel::kEquidistant, {}));
  ASSERT_TRUE(camera.has_value());
  EXPECT_EQ(camera->max_radius(), Camera::kMaxRadius);
  const double edge = 321.5 + 500 * std::atan(Camera::kMaxRadius);
  EXPECT_NEAR(camera->unproject({edge - 0.01, 236.25})->x(), Camera::kMaxRadius, 0.01);
  EXPECT_FALSE(camera->unproject({edge + 0.01, 236.25}).has_value());
}

TEST(Camera, PrincipalPointIsTheRayAhead) {
  for (const CameraModel& m : lenses()) {
    const Result<Camera> camera = Camera::create(m);
    ASSERT_TRUE(camera.has_value());
    EXPECT_NEAR(camera->unproject({m.cx, m.cy})->norm(), 0, 1e-12);
  }
}

TEST(Camera, NotANumberHasNeitherPixelNorRay) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (const CameraModel& m : lenses()) {
    const Result<Camera> camera = Camera::create(m);
    ASSERT_TRUE(camera.has_value());
    EXPECT_FALSE(camera->project({nan, 0}).has_value());
    EXPECT_FALSE(camera->unproject({0, nan}).has_value());
    EXPECT_FALSE(camera->unproject({std::numeric_limits<double>::infinity(), 0}).has_value());
  }
}

TEST(Camera, RefusesAModelThatIsNone) {
  CameraModel bad = model(LensModel::kRadtan, {});
  bad.fx = 0;
  EXPECT_EQ(Camera::create(bad).error(), Fault::kBadConfig);
  bad.fx = std::numeric_limits<double>::infinity();
  EXPECT_EQ(Camera::create(bad).error(), Fault::kNotFinite);
  bad = model(LensModel::kRadtan, {});
  bad.distortion[13] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(Camera::create(bad).error(), Fault::kNotFinite);
  bad.distortion[13] = 1.6;
  EXPECT_EQ(Camera::create(bad).error(), Fault::kBadConfig);
}

}  // namespace
}  // namespace stereotrack
