#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <limits>
#include <stdexcept>

#include "config/calibration/check.hpp"

namespace stereotrack::calibration {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;
using testing::StartsWith;

StereoCalibration good() {
  StereoCalibration c;
  c.left = {640, 480, 500, 500, 320, 240, LensModel::kRadtan, {-0.3, 0.1}};
  c.right = c.left;
  c.t_right_left = {-0.2, 0, 0};
  return c;
}

/// What check() says about `good()` after `spoil`; empty if it says nothing.
std::string said(const std::function<void(StereoCalibration&)>& spoil) {
  StereoCalibration c = good();
  spoil(c);
  try {
    check(c, "rig.yml");
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  return {};
}

auto line(const char* part) { return AllOf(StartsWith("rig.yml: "), HasSubstr(part), Not(HasSubstr("\n"))); }

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

TEST(CheckCalibration, AGoodOnePasses) {
  EXPECT_EQ(said([](StereoCalibration&) {}), "");
}

TEST(CheckCalibration, LeftAndRightExchangedIsSaid) {
  EXPECT_THAT(said([](StereoCalibration& c) { c.t_right_left.x() = 0.2; }), line("left and right are exchanged"));
}

TEST(CheckCalibration, BaselineOfNothingIsSaid) {
  EXPECT_THAT(said([](StereoCalibration& c) { c.t_right_left.setZero(); }), line("baseline is zero"));
}

TEST(CheckCalibration, BaselineUpwardsOrForwardsIsSaid) {
  EXPECT_THAT(said([](StereoCalibration& c) { c.t_right_left = {-0.1, 0.2, 0}; }), line("baseline is not along x"));
  EXPECT_THAT(said([](StereoCalibration& c) { c.t_right_left = {-0.1, 0, 0.2}; }), line("baseline is not along x"));
}

TEST(CheckCalibration, MatrixThatIsNoRotationIsSaid) {
  EXPECT_THAT(said([](StereoCalibration& c) { c.R_right_left(0, 1) = 0.01; }), line("R is not a rotation: "));
  EXPECT_THAT(said([](StereoCalibration& c) { c.R_right_left.setZero(); }), line("R is not a rotation: "));
  EXPECT_THAT(said([](StereoCalibration& c) { c.R_right_left(2, 2) = -1; }), line("mirrors"));
  EXPECT_EQ(said([](StereoCalibration& c) { c.R_right_left(0, 1) = 0.0004; }), "") << "rounding in a file";
}

TEST(CheckCalibration, NotANumberIsSaidAndWhere) {
  EXPECT_THAT(said([](StereoCalibration& c) { c.left.cx = kNan; }), line("left camera matrix"));
  EXPECT_THAT(said([](StereoCalibration& c) { c.right.distortion[3] = 1 / 0.0; }), line("right distortion"));
  EXPECT_THAT(said([](StereoCalibration& c) { c.R_right_left(1, 1) = kNan; }), line("R holds"));
  EXPECT_THAT(said([](StereoCalibration& c) { c.t_right_left(1) = kNan; }), line("T holds"));
}

TEST(CheckCalibration, FocalLengthThatIsNoneIsSaid) {
  EXPECT_THAT(said([](StereoCalibration& c) { c.right.fy = 0; }), line("right focal length"));
  EXPECT_THAT(said([](StereoCalibration& c) { c.left.fx = -500; }), line("left focal length"));
}

TEST(CheckCalibration, PrincipalPointFarOutsideIsSaid) {
  EXPECT_THAT(said([](StereoCalibration& c) { c.left.cx = 970; }), line("left principal point"));
  EXPECT_THAT(said([](StereoCalibration& c) { c.right.cy = -250; }), line("right principal point"));
  EXPECT_EQ(said([](StereoCalibration& c) { c.left.cx = 700; }), "");
  EXPECT_THAT(said([](StereoCalibration& c) {
                c.left.width = c.left.height = c.right.width = c.right.height = 0;
                c.left.cx = 2001;
              }),
              line("left principal point"));
}

TEST(CheckCalibration, CamerasOfDifferentSizeAreSaid) {
  EXPECT_THAT(said([](StereoCalibration& c) { c.right.width = 320; }), line("same size"));
}

TEST(CheckCalibration, DistortionThatCannotBeUndoneIsSaid) {
  EXPECT_THAT(said([](StereoCalibration& c) { c.right.distortion[0] = -30; }), line("lens distortion"));
}

TEST(CheckSize, PicturesOfAnotherSizeAreSaidWithBothSizes) {
  EXPECT_NO_THROW(check_size(good(), 640, 480, "rig.yml"));
  try {
    check_size(good(), 320, 240, "rig.yml");
    FAIL();
  } catch (const std::runtime_error& error) {
    EXPECT_THAT(error.what(), AllOf(line("640x480"), HasSubstr("320x240")));
  }
}

TEST(CheckSize, WhereTheFileDoesNotSayThePrincipalPointDoes) {
  StereoCalibration c = good();
  c.left.width = c.left.height = c.right.width = c.right.height = 0;
  EXPECT_NO_THROW(check_size(c, 640, 480, "rig.yml"));
  try {
    check_size(c, 160, 120, "rig.yml");
    FAIL();
  } catch (const std::runtime_error& error) {
    EXPECT_THAT(error.what(), line("principal point"));
  }
}

}  // namespace
}  // namespace stereotrack::calibration
