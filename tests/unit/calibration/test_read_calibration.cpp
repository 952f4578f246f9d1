#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <opencv2/core.hpp>
#include <stdexcept>
#include <string>

#include "config/calibration/read_calibration.hpp"

namespace fs = std::filesystem;

namespace stereotrack::calibration {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

class ReadCalibration : public testing::Test {
 protected:
  void SetUp() override {
    const testing::TestInfo* info = testing::UnitTest::GetInstance()->current_test_info();
    folder_ = fs::temp_directory_path() / ("stereotrack_" + std::to_string(getpid()) + "_" + info->name());
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }

  std::string write(const std::string& name, const std::string& text) const {
    const fs::path path = folder_ / name;
    fs::create_directories(path.parent_path());
    std::ofstream(path, std::ios::binary) << text;
    return path.string();
  }
  std::string path(const std::string& name) const { return (folder_ / name).string(); }

  fs::path folder_;
};

std::string said(const std::string& source) {
  try {
    (void)read_calibration(source);
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  return {};
}

auto line(const std::string& part) { return AllOf(HasSubstr(part), Not(HasSubstr("\n"))); }

StereoCalibration example() {
  StereoCalibration c;
  c.left = {640, 480, 500.1, 501.0 / 3, 320, 240, LensModel::kRadtan, {-0.3, 0.1, 1e-5, -2e-17}};
  c.left.fy = 501.0 / 0.999;
  c.right = {640, 480, 503, 502, 318.25, 239.5, LensModel::kRadtan, {-0.31, 0.11, 0, 0, 0.7}};
  c.t_right_left = {-0.1 / 3, 1e-4, 0};
  return c;
}

void expect_same(const StereoCalibration& a, const StereoCalibration& b) {
  for (const auto& [x, y] : {std::pair{&a.left, &b.left}, std::pair{&a.right, &b.right}}) {
    EXPECT_EQ(x->width, y->width);
    EXPECT_EQ(x->height, y->height);
    EXPECT_EQ(x->fx, y->fx);
    EXPECT_EQ(x->fy, y->fy);
    EXPECT_EQ(x->cx, y->cx);
    EXPECT_EQ(x->cy, y->cy);
    EXPECT_EQ(x->lens, y->lens);
    EXPECT_EQ(x->distortion, y->distortion);
  }
  EXPECT_EQ(a.R_right_left, b.R_right_left);
  EXPECT_EQ(a.t_right_left, b.t_right_left);
}

std::string content(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

/// K1 D1 K2 D2 R T, with D of `coefficients` elements as a column or a row.
std::string opencv_text(int coefficients, bool column, const std::string& K = "K", const std::string& extra = "") {
  const auto matrix = [](const std::string& key, int rows, int cols, const std::string& data) {
    return key + ": !!opencv-matrix\n   rows: " + std::to_string(rows) + "\n   cols: " + std::to_string(cols) +
           "\n   dt: d\n   data: [ " + data + " ]\n";
  };
  std::string d = "-0.125";
  for (int i = 1; i < coefficients; ++i) d += ", 0.00" + std::to_string(i);
  const int rows = column ? coefficients : 1;
  const int cols = column ? 1 : coefficients;
  return "%YAML:1.0\n---\n" + extra + matrix(K + "1", 3, 3, "500., 0., 320., 0., 501., 240., 0., 0., 1.") +
         matrix("D1", rows, cols, d) + matrix(K + "2", 3, 3, "502., 0., 321., 0., 503., 241., 0., 0., 1.") +
         matrix("D2", rows, cols, d) + matrix("R", 3, 3, "1., 0., 0., 0., 1., 0., 0., 0., 1.") +
         matrix("T", 3, 1, "-2., 0., 0.");
}

TEST_F(ReadCalibration, WhatWriteOpencvWroteIsReadBackToTheSameBits) {
  for (std::size_t coefficients : {0U, 5U, 8U, 12U, 14U}) {
    StereoCalibration c = example();
    if (coefficients > 0) c.right.distortion[coefficients - 1] = 0.001;
    write_opencv(path("a.yml"), c);
    expect_same(read_calibration(path("a.yml")), c);
  }
}

TEST_F(ReadCalibration, EquidistantLensesAreWrittenAndReadBack) {
  StereoCalibration c = example();
  for (CameraModel* camera : {&c.left, &c.right}) {
    camera->lens = LensModel::kEquidistant;
    camera->distortion = {0.01, -0.01, 0.006, -0.0017};
  }
  write_opencv(path("a.yml"), c);
  expect_same(read_calibration(path("a.yml")), c);
  c.left.lens = LensModel::kRadtan;
  EXPECT_THROW(write_opencv(path("b.yml"), c), std::runtime_error);
}

TEST_F(ReadCalibration, SameCalibrationIsWrittenAsTheSameBytes) {
  write_opencv(path("a.yml"), example());
  write_opencv(path("b.yml"), example());
  EXPECT_EQ(content(path("a.yml")), content(path("b.yml")));
  EXPECT_FALSE(fs::exists(path("a.yml.part")));
}

TEST_F(ReadCalibration, FolderThatIsNotThereCannotBeWrittenTo) {
  try {
    write_opencv(path("none/a.yml"), example());
    FAIL();
  } catch (const std::runtime_error& error) {
    EXPECT_THAT(error.what(), line("none/a.yml: cannot be written"));
  }
}

TEST_F(ReadCalibration, FullDiskLeavesNoFile) {
  if (!fs::exists("/dev/full")) GTEST_SKIP() << "no /dev/full on this system";
  fs::create_symlink("/dev/full", path("a.yml.part"));
  EXPECT_THROW(write_opencv(path("a.yml"), example()), std::runtime_error);
  EXPECT_FALSE(fs::exists(path("a.yml")));
}

TEST_F(ReadCalibration, AllLengthsOfDistortionAsRowAndAsColumn) {
  for (int n : {4, 5, 8, 12}) {
    for (bool column : {false, true}) {
      const StereoCalibration c = read_calibration(write("a.yml", opencv_text(n, column)));
      EXPECT_EQ(c.left.distortion[0], -0.125);
      EXPECT_DOUBLE_EQ(c.left.distortion[static_cast<std::size_t>(n - 1)], std::stod("0.00" + std::to_string(n - 1)));
      EXPECT_EQ(c.left.distortion[static_cast<std::size_t>(n)], 0);
      EXPECT_EQ(c.left.width, 0);
    }
  }
  EXPECT_DOUBLE_EQ(read_calibration(write("a.yml", opencv_text(14, true, "M"))).right.distortion[13], 0.0013);
  EXPECT_THAT(said(write("a.yml", opencv_text(6, false))), line("D1: 6 distortion coefficients"));
}

TEST_F(ReadCalibration, PictureSizeInEitherForm) {
  EXPECT_EQ(read_calibration(write("a.yml", opencv_text(5, false, "K", "image_size: [ 640, 480 ]\n"))).left.height,
            480);
  EXPECT_EQ(
      read_calibration(write("b.yml", opencv_text(5, false, "K", "image_width: 640\nimage_height: 480\n"))).right.width,
      640);
  EXPECT_THAT(said(write("c.yml", opencv_text(5, false, "K", "image_size: [ 640, 0 ]\n"))), line("picture size"));
}

TEST_F(ReadCalibration, XmlAndJsonOfOpenCvAreTheSameAsItsYaml) {
  write_opencv(path("a.yml"), example());
  const cv::FileStorage in(path("a.yml"), cv::FileStorage::READ);
  for (const char* name : {"a.xml", "a.json"}) {
    cv::FileStorage out(path(name), cv::FileStorage::WRITE);
    out << "image_size" << cv::Size(640, 480);
    for (const char* key : {"K1", "D1", "K2", "D2", "R", "T"}) out << key << in[key].mat();
    out.release();
    expect_same(read_calibration(path(name)), example());
  }
}

TEST_F(ReadCalibration, IntrinsicsFindTheExtrinsicsBesideThem) {
  const std::string text = opencv_text(5, false, "M");
  const std::size_t at = text.find("R:");
  const std::string intrinsics = write("my_intrinsics.yml", text.substr(0, at));
  EXPECT_THAT(said(intrinsics), line("my_intrinsics.yml: R is missing; if it is in a second file"));
  const std::string extrinsics = write("my_extrinsics.yml", "%YAML:1.0\n---\n" + text.substr(at));
  EXPECT_EQ(read_calibration(intrinsics).t_right_left.x(), -2);
  EXPECT_EQ(read_calibration(intrinsics + "," + extrinsics).t_right_left.x(), -2);
  EXPECT_THAT(said(extrinsics), line("my_extrinsics.yml: K1 (or M1) is missing"));
  EXPECT_THAT(said(intrinsics + "," + intrinsics), line("R is in neither file"));
}

TEST_F(ReadCalibration, FolderIsSearchedForAKnownName) {
  EXPECT_THAT(said(folder_.string()), line("no calibration in this folder"));
  write("calibration.yml", opencv_text(5, false));
  EXPECT_EQ(read_calibration(folder_.string()).left.fx, 500);
}

TEST_F(ReadCalibration, FileThatIsNoneIsSaid) {
  EXPECT_THAT(said(path("none.yml")), line("none.yml: no such calibration file"));
  EXPECT_THAT(said(path("a.yml") + "," + path("b.yml")), line("a.yml: no such calibration file"));
  EXPECT_THAT(said(write("empty.yml", "")), line("empty.yml: is empty"));
  EXPECT_THAT(said(write("blank.yml", " \n\n")), line("blank.yml: is empty"));
  EXPECT_THAT(said(write("binary.yml", std::string("K1:\0\0", 5))), line("binary"));
  EXPECT_THAT(said(write("poem.txt", "roses are red\n")), line("poem.txt: not a calibration that is known"));
}

TEST_F(ReadCalibration, TruncatedOpenCvFileIsSaidWithItsLine) {
  const std::string whole = opencv_text(5, false);
  for (std::size_t length = 40; length + 20 < whole.size(); length += 23) {
    const std::string message = said(write("cut.yml", whole.substr(0, length)));
    EXPECT_THAT(message, line("cut.yml")) << length;
  }
  EXPECT_THAT(said(write("cut.yml", whole.substr(0, whole.find("321.")))), line("cut.yml(17)"));
}

TEST_F(ReadCalibration, MatrixOfAnotherShapeIsSaid) {
  std::string text = opencv_text(5, false);
  const std::size_t at = text.find("T: !!opencv-matrix\n   rows: 3");
  text.replace(at, std::string::npos, "T: [ -2., 0. ]\n");
  EXPECT_THAT(said(write("a.yml", text)), line("a.yml: T holds 2 numbers, must be 3"));
  std::string skewed = opencv_text(5, false);
  skewed.replace(skewed.find("500., 0.,"), 9, "500., 9.,");
  EXPECT_THAT(said(write("b.yml", skewed)), line("b.yml: K1 is not a camera matrix"));
}

constexpr const char* kKalibr = R"(cam0:
  camera_model: pinhole
  distortion_coeffs: [-0.28, 0.07, 0.0002, 0.00002]
  distortion_model: radtan
  intrinsics: [458.0, 457.0, 367.0, 248.0]
  resolution: [752, 480]
cam1:
  T_cn_cnm1:
  - [1.0, 0.0, 0.0, -0.11]
  - [0.0, 1.0, 0.0, 0.001]
  - [0.0, 0.0, 1.0, 0.002]
  - [0.0, 0.0, 0.0, 1.0]
  camera_model: pinhole
  distortion_coeffs: [-0.28, 0.07, 0.0002, 0.00002]
  distortion_model: radtan
  intrinsics: [459.0, 456.0, 366.0, 249.0]
  resolution: [752, 480]
)";

std::string replaced(std::string text, const std::string& from, const std::string& to) {
  text.replace(text.rfind(from), from.size(), to);
  return text;
}

TEST_F(ReadCalibration, KalibrChainWithAndWithoutOpenCvHeader) {
  for (const char* header : {"", "%YAML:1.0\n", "%YAML:1.0\n---\n"}) {
    const CalibrationFile file = read_calibration_file(write("chain.yaml", std::string(header) + kKalibr));
    EXPECT_EQ(file.format, Format::kKalibr);
    EXPECT_EQ(unit_m(file.format), 1.0);
    EXPECT_EQ(file.stereo.right.fx, 459);
    EXPECT_EQ(file.stereo.left.width, 752);
    EXPECT_EQ(file.stereo.t_right_left, Eigen::Vector3d(-0.11, 0.001, 0.002));
  }
}

TEST_F(ReadCalibration, KalibrMistakesAreSaidWithTheirLine) {
  const auto say = [this](const std::string& text) { return said(write("chain.yaml", text)); };
  EXPECT_THAT(say(replaced(kKalibr, "camera_model: pinhole", "camera_model: omni")),
              line("chain.yaml:13: camera model omni is not supported"));
  EXPECT_THAT(say(replaced(kKalibr, "distortion_model: radtan", "distortion_model: fov")),
              line("chain.yaml:15: distortion model fov is not supported"));
  EXPECT_THAT(say(replaced(kKalibr, "[459.0, 456.0, 366.0, 249.0]", "[459.0, 456.0, 366.0]")),
              line("chain.yaml:16: intrinsics holds 3 numbers, must be 4"));
  EXPECT_THAT(say(replaced(kKalibr, "[459.0, 456.0", "[459.0, wide")),
              line("chain.yaml:16: intrinsics holds something"));
  EXPECT_THAT(say(replaced(kKalibr, "[752, 480]", "[752, 480")), line("chain.yaml:"));
  EXPECT_THAT(say(replaced(kKalibr, "  resolution: [752, 480]\n", "")), line("chain.yaml:8: resolution is missing"));
  EXPECT_THAT(say(replaced(kKalibr, "T_cn_cnm1", "T_other")), line("add T_cn_cnm1 to cam1"));
  EXPECT_THAT(say(replaced(kKalibr, "- [0.0, 0.0, 0.0, 1.0]", "- [0.0, 0.0, 1.0, 1.0]")), line("row 0 0 0 1"));
  EXPECT_THAT(say(replaced(kKalibr, "cam1:", "cam7:")), line("cam1 is missing"));
  EXPECT_THAT(say(replaced(kKalibr, "-0.11", "0.11")), line("left and right are exchanged"));
  EXPECT_THAT(say(replaced(kKalibr, "[752, 480]", "[640, 480]")), line("same size"));
  EXPECT_THAT(say(replaced(kKalibr, "[459.0", "[.nan")), line("not finite"));
}

std::string ros_text(double tx, const std::string& rotation) {
  return "image_width: 640\nimage_height: 480\ncamera_name: a\ncamera_matrix:\n  rows: 3\n  cols: 3\n"
         "  data: [500, 0, 320, 0, 500, 240, 0, 0, 1]\ndistortion_model: plumb_bob\ndistortion_coefficients:\n"
         "  rows: 1\n  cols: 5\n  data: [-0.1, 0.01, 0, 0, 0]\nrectification_matrix:\n  rows: 3\n  cols: 3\n  data: [" +
         rotation + "]\nprojection_matrix:\n  rows: 3\n  cols: 4\n  data: [400, 0, 310, " + std::to_string(tx) +
         ", 0, 400, 235, 0, 0, 0, 1, 0]\n";
}

TEST_F(ReadCalibration, RosPairGivesTheBaselineInTheRightCamerasAxes) {
  // b = -100 / 400 = -0.25; T = R_r^T (b, 0, 0), which is b times the first row of R_r: (0.8, 0, 0.6).
  const std::string left = write("left.yaml", ros_text(0, "1, 0, 0, 0, 1, 0, 0, 0, 1"));
  const std::string right = write("right.yaml", ros_text(-100, "0.8, 0, 0.6, 0, 1, 0, -0.6, 0, 0.8"));
  const CalibrationFile file = read_calibration_file(left + "," + right);
  EXPECT_EQ(file.format, Format::kRos);
  EXPECT_NEAR((file.stereo.t_right_left - Eigen::Vector3d(-0.2, 0, -0.15)).norm(), 0, 1e-15);
  EXPECT_NEAR(file.stereo.R_right_left(0, 2), -0.6, 1e-15);
  EXPECT_EQ(file.stereo.left.distortion[1], 0.01);
  EXPECT_EQ(read_calibration(folder_.string()).t_right_left, file.stereo.t_right_left);
  EXPECT_THAT(said(left), line("describes one camera; give both as LEFT,RIGHT"));
  EXPECT_THAT(said(right + "," + left), line("left and right are exchanged"));
}

TEST_F(ReadCalibration, RosIniPair) {
  const auto ini = [](const std::string& p3) {
    return "# calibration\n[image]\n\nwidth\n640\n\nheight\n480\n\n[left]\n\ncamera matrix\n500 0 320\n0 500 240\n0 0 "
           "1\n\n"
           "distortion\n-0.1 0.01 0 0 0\n\nrectification\n1 0 0\n0 1 0\n0 0 1\n\nprojection\n400 0 310 " +
           p3 + "\n0 400 235 0\n0 0 1 0\n";
  };
  const std::string left = write("left.ini", ini("0"));
  const std::string right = write("right.ini", ini("-100"));
  const StereoCalibration c = read_calibration(left + "," + right);
  EXPECT_EQ(c.t_right_left, Eigen::Vector3d(-0.25, 0, 0));
  EXPECT_EQ(c.right.cy, 240);
  EXPECT_EQ(c.right.distortion[0], -0.1);
  EXPECT_THAT(said(left + "," + write("bad.ini", ini("-1x0"))), line("bad.ini:26: not a number"));
}

TEST_F(ReadCalibration, KittiGreyAndColour) {
  const std::string calib = write("calib.txt",
                                  "P0: 700 0 600 0 0 700 170 0 0 0 1 0\nP1: 700 0 600 -350 0 700 170 0 0 0 1 0\n"
                                  "P2: 700 0 600 35 0 700 170 0.2 0 0 1 0\nP3: 700 0 600 -329 0 700 170 2.1 0 0 1 0\n");
  EXPECT_EQ(read_calibration(calib).t_right_left, Eigen::Vector3d(-0.5, 0, 0));
  EXPECT_NEAR(read_calibration(calib, {.kitti_colour = true}).t_right_left.x(), -0.52, 1e-15);
  EXPECT_EQ(read_calibration(folder_.string()).left.cx, 600);
  EXPECT_THAT(said(write("short.txt", "P0: 700 0 600 0 0 700 170 0 0 0 1 0\n")), line("short.txt: P1 is missing"));
  EXPECT_THAT(said(write("bad.txt", "P0: 700 0 600\n")), line("bad.txt:1: P0 must be 12 numbers"));
}

TEST_F(ReadCalibration, TwoFilesOfDifferentKindsAreRefused) {
  const std::string a = write("a.yml", opencv_text(5, false));
  const std::string b = write("b.yaml", kKalibr);
  EXPECT_THAT(said(a + "," + b), line("give two files of one kind"));
  EXPECT_THAT(said(b + "," + b), line("holds both cameras; give one file"));
}

}  // namespace
}  // namespace stereotrack::calibration
