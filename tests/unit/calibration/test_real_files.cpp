#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>
#include <stdexcept>
#include <string>
#include <vector>

#include "config/calibration/check.hpp"
#include "config/calibration/read_calibration.hpp"
#include "pipeline/geometry/rectify.hpp"

namespace fs = std::filesystem;

namespace stereotrack::calibration {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

const std::string kData = STEREOTRACK_SOURCE_DIR "/../shared/data";

class RealCalibration : public testing::Test {
 protected:
  void SetUp() override {
    if (!fs::exists(kData)) GTEST_SKIP() << "no test data at " << kData << " (see docs/CONTRIBUTING.md)";
  }
};

struct Rig {
  std::string source;
  Format format;
  int width;
  int height;
};

std::vector<Rig> rigs() {
  const std::string samples = kData + "/calib_samples";
  const std::string people = kData + "/stereo_people_overhead";
  return {{kData + "/dtu_conveyor_stereo/derived_stereo_calibration.yml", Format::kOpenCv, 1280, 720},
          {people + "/calibration_as_stored.yml", Format::kOpenCv, 320, 240},
          {people + "/calibration_flipped.yml", Format::kOpenCv, 320, 240},
          {people + "/derived_stereo_calibration.yml", Format::kOpenCv, 320, 240},
          {people + "/calib", Format::kOpenCv, 320, 240},
          {kData + "/baseball_stereo_slow126/calibration.yml", Format::kOpenCv, 640, 480},
          {samples + "/opencv_yaml/PRiME_intrinsics.yml", Format::kOpenCv, 1280, 720},
          {samples + "/kalibr/euroc_mav_kalibr_imucam_chain.yaml", Format::kKalibr, 752, 480},
          {samples + "/kalibr/rs_t265_kalibr_imucam_chain.yaml", Format::kKalibr, 848, 800},
          {samples + "/kalibr/tum_vi_camchain_pure.yaml", Format::kKalibr, 1024, 1024},
          {samples + "/kalibr/tum_vi_kalibr_imucam_chain.yaml", Format::kKalibr, 512, 512},
          {kData + "/euroc_micro", Format::kEuroc, 752, 480},
          {kData + "/euroc_micro/mav0", Format::kEuroc, 752, 480},
          {kData + "/euroc_micro/mav0/cam0/sensor.yaml", Format::kEuroc, 752, 480},
          {kData + "/kitti_odom_sample/sequences/03", Format::kKitti, 1242, 375}};
}

std::string said(const std::string& source) {
  try {
    (void)read_calibration(source);
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  return {};
}

cv::Mat camera_matrix(const CameraModel& m) {
  return (cv::Mat_<double>(3, 3) << m.fx, 0, m.cx, 0, m.fy, m.cy, 0, 0, 1);
}

TEST_F(RealCalibration, EveryRigIsReadCheckedAndRectified) {
  for (const Rig& rig : rigs()) {
    SCOPED_TRACE(rig.source);
    const CalibrationFile file = read_calibration_file(rig.source);
    EXPECT_EQ(file.format, rig.format);
    ASSERT_NO_THROW(check_size(file.stereo, rig.width, rig.height, rig.source));
    const Result<RectificationPlan> plan = plan_rectification(file.stereo, rig.width, rig.height);
    ASSERT_TRUE(plan.has_value());
    EXPECT_GE(plan->geometry.width_left, rig.width * 9 / 10);
    EXPECT_GE(plan->geometry.height, rig.height * 9 / 10);
    EXPECT_LE(plan->geometry.width_left, rig.width * 3 / 2);
    EXPECT_LE(plan->geometry.width_right, rig.width * 3 / 2);
    EXPECT_LE(plan->geometry.height, rig.height * 3 / 2);
  }
}

TEST_F(RealCalibration, AxesOfEveryRigAreThoseOfOpenCv) {
  for (const Rig& rig : rigs()) {
    SCOPED_TRACE(rig.source);
    const StereoCalibration c = read_calibration(rig.source);
    const Result<RectificationPlan> plan = plan_rectification(c, rig.width, rig.height);
    ASSERT_TRUE(plan.has_value());
    cv::Mat R(3, 3, CV_64F);
    for (int i = 0; i < 9; ++i) R.at<double>(i / 3, i % 3) = c.R_right_left(i / 3, i % 3);
    const cv::Mat T = (cv::Mat_<double>(3, 1) << c.t_right_left.x(), c.t_right_left.y(), c.t_right_left.z());
    // The axes depend on R and T alone; OpenCV uses the lens only for its own choice of focal length.
    cv::Mat R1, R2, P1, P2, Q;
    cv::stereoRectify(camera_matrix(c.left), cv::Mat(), camera_matrix(c.right), cv::Mat(), {rig.width, rig.height}, R,
                      T, R1, R2, P1, P2, Q, cv::CALIB_ZERO_DISPARITY);
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) {
        EXPECT_NEAR(plan->R_rect_left(i, j), R1.at<double>(i, j), 1e-9);
        EXPECT_NEAR(plan->R_rect_right(i, j), R2.at<double>(i, j), 1e-9);
      }
    }
  }
}

TEST_F(RealCalibration, NumbersAreThoseThatOpenCvReads) {
  for (const Rig& rig : rigs()) {
    if (rig.format != Format::kOpenCv || fs::is_directory(rig.source)) continue;
    SCOPED_TRACE(rig.source);
    const StereoCalibration c = read_calibration(rig.source);
    cv::FileStorage intrinsics(rig.source, cv::FileStorage::READ);
    cv::FileStorage extrinsics;
    const std::size_t word = rig.source.find("intrinsics");
    if (word != std::string::npos) {
      extrinsics.open(std::string(rig.source).replace(word, 10, "extrinsics"), cv::FileStorage::READ);
    }
    const auto mat = [&](const char* key, const char* other) {
      cv::Mat m = intrinsics[key].mat();
      if (m.empty()) m = intrinsics[other].mat();
      if (m.empty() && extrinsics.isOpened()) m = extrinsics[key].mat();
      return m;
    };
    const cv::Mat K1 = mat("K1", "M1"), K2 = mat("K2", "M2"), D1 = mat("D1", "D1"), D2 = mat("D2", "D2");
    const cv::Mat R = mat("R", "R"), T = mat("T", "T");
    ASSERT_FALSE(K1.empty() || K2.empty() || D1.empty() || D2.empty() || R.empty() || T.empty());
    EXPECT_EQ(cv::norm(camera_matrix(c.left), K1), 0);
    EXPECT_EQ(cv::norm(camera_matrix(c.right), K2), 0);
    for (int i = 0; i < static_cast<int>(D1.total()); ++i) {
      EXPECT_EQ(c.left.distortion[static_cast<std::size_t>(i)], D1.at<double>(i));
      EXPECT_EQ(c.right.distortion[static_cast<std::size_t>(i)], D2.at<double>(i));
    }
    for (int i = 0; i < 3; ++i) {
      EXPECT_EQ(c.t_right_left(i), T.at<double>(i));
      for (int j = 0; j < 3; ++j) EXPECT_EQ(c.R_right_left(i, j), R.at<double>(i, j));
    }
  }
}

TEST_F(RealCalibration, EurocIsTheSameFromKalibrAndFromSensorYaml) {
  const StereoCalibration a = read_calibration(kData + "/calib_samples/kalibr/euroc_mav_kalibr_imucam_chain.yaml");
  const StereoCalibration b =
      read_calibration(kData + "/euroc_micro/mav0/cam0/sensor.yaml," + kData + "/euroc_micro/mav0/cam1/sensor.yaml");
  EXPECT_NEAR((a.R_right_left - b.R_right_left).norm(), 0, 1e-11);
  EXPECT_NEAR((a.t_right_left - b.t_right_left).norm(), 0, 1e-11);
  EXPECT_EQ(a.left.distortion, b.left.distortion);
  // 110.074 mm: published with the data set, and in ORB-SLAM's settings (bf 47.906 / fx 435.205)
  EXPECT_NEAR(a.t_right_left.norm(), 47.90639384423901 / 435.2046959714599, 1e-6);
}

TEST_F(RealCalibration, KalibrPoseToTheImuGivesWhatKalibrSaysBetweenTheCameras) {
  const StereoCalibration c = read_calibration(kData + "/calib_samples/kalibr/rs_t265_kalibr_imucam_chain.yaml");
  EXPECT_EQ(c.left.lens, LensModel::kEquidistant);
  EXPECT_DOUBLE_EQ(c.t_right_left.x(), -0.06274034262839549);
  const StereoCalibration imu = read_calibration(kData + "/calib_samples/kalibr/tum_vi_kalibr_imucam_chain.yaml");
  EXPECT_NEAR(imu.t_right_left.x(), -0.101, 5e-4);
  EXPECT_NEAR(imu.R_right_left(2, 1), 0.0469, 1e-4);
}

TEST_F(RealCalibration, KittiIsTheIdentity) {
  const StereoCalibration c = read_calibration(kData + "/kitti_odom_sample/sequences/03/calib.txt");
  EXPECT_NEAR(c.t_right_left.x(), -387.5744 / 721.5377, 1e-12);
  const Result<RectificationPlan> plan = plan_rectification(c, 1242, 375);
  ASSERT_TRUE(plan.has_value());
  EXPECT_EQ(plan->geometry.width_right, 1242);
  EXPECT_EQ(plan->geometry.f, 721.5377);
  EXPECT_EQ(plan->R_rect_left, Eigen::Matrix3d(Eigen::Matrix3d::Identity()));
  const StereoCalibration colour =
      read_calibration(kData + "/kitti_odom_sample/sequences/03/calib.txt", {.kitti_colour = true});
  EXPECT_NEAR(colour.t_right_left.x(), -0.5327, 1e-4);
  EXPECT_EQ(plan_rectification(colour, 1242, 375)->geometry.width_right, 1242);
}

TEST_F(RealCalibration, ExchangedCamerasAreRefused) {
  const std::string folder = kData + "/calib_samples/opencv_yaml/";
  const auto refused = AllOf(HasSubstr("left and right are exchanged"), HasSubstr("91.2"), Not(HasSubstr("\n")));
  EXPECT_THAT(said(folder + "BarryLiang_intrinsics.yml"), refused);
  EXPECT_THAT(said(folder + "BarryLiang_intrinsics.yml," + folder + "BarryLiang_extrinsics.yml"), refused);
}

TEST_F(RealCalibration, WhatIsNotReadIsNamedWithTheWayOut) {
  const std::string samples = kData + "/calib_samples/";
  const std::vector<std::pair<std::string, std::string>> cases = {
      {"basalt_json/euroc_ds_calib.json", "Basalt"},
      {"basalt_json/tumvi_512_ds_calib.json", "Kalibr"},
      {"opencv_yaml/vins_euroc_cam0_mei.yaml", "MEI"},
      {"opencv_yaml/vins_euroc_cam0_pinhole.yaml", "camodocal"},
      {"opencv_yaml/vins_euroc_stereo_config.yaml", "VINS-Fusion"},
      {"opencv_yaml/ORB_SLAM2_EuRoC.yaml", "ORB-SLAM"},
      {"opencv_yaml/ORB_SLAM2_KITTI00-02.yaml", "ORB-SLAM"},
      {"kalibr/rs_d455_kalibr_imucam_chain.yaml", "cam1 is missing"},
      {"ros_camera_info/rovio_euroc_cam0.yaml", "give both as LEFT,RIGHT"},
      {"ros_camera_info/calib5.ini", "give both as LEFT,RIGHT"}};
  for (const auto& [name, what] : cases) {
    EXPECT_THAT(said(samples + name), AllOf(HasSubstr(name), HasSubstr(what), Not(HasSubstr("\n"))));
  }
  const std::string ros = samples + "ros_camera_info/";
  EXPECT_THAT(said(ros + "rovio_euroc_cam0.yaml," + ros + "rovio_euroc_cam1.yaml"),
              HasSubstr("rovio_euroc_cam0.yaml: rectification_matrix is missing"));
  EXPECT_THAT(said(ros + "test_calibration.yaml," + ros + "test_calibration.yaml"), HasSubstr("baseline is zero"));
  EXPECT_THAT(said(ros + "calib5.ini," + ros + "calib8.ini"), HasSubstr("baseline is zero"));
}

TEST_F(RealCalibration, AnotherPictureSizeIsRefused) {
  const std::string source = kData + "/baseball_stereo_slow126/calibration.yml";
  const StereoCalibration c = read_calibration(source);
  EXPECT_NO_THROW(check_size(c, 640, 480, source));
  EXPECT_THROW(check_size(c, 1280, 720, source), std::runtime_error);
}

}  // namespace
}  // namespace stereotrack::calibration
