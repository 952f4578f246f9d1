#include "drivers/record/format.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <set>
#include <stdexcept>

#include "drivers/record/calibration_text.hpp"

namespace stereotrack::record {
namespace {

std::string message_of(auto&& call) {
  try {
    call();
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  return {};
}

TEST(RecordFormat, AboutReadsBackAsItWas) {
  About about;
  about.source = "left cam, right cam";
  about.program = "stereotrackd 1.2";
  about.cause = cause_text(kDeadlineMiss | kGpioInput);
  about.width = 640;
  about.height = 480;
  about.format = PixelFormat::kYuyv;
  about.period_ns = 33'333'333;
  about.rig = 7;
  about.session = std::numeric_limits<std::uint64_t>::max();
  about.unit_m = 0.1;
  about.reduce = 2;
  about.every = 3;
  about.exact = true;
  const About read = about_from_text(to_text(about), "x.strec");
  EXPECT_EQ(to_text(read), to_text(about));
  EXPECT_EQ(read.source, about.source);
  EXPECT_EQ(read.session, about.session);
  EXPECT_EQ(read.cause, "deadline-gpio");
}

TEST(RecordFormat, EachPixelFormatHasANameOfItsOwn) {
  std::set<std::string> texts;
  for (int i = 0; i < kPixelFormats; ++i) {
    About about;
    about.width = about.height = 4;
    about.format = static_cast<PixelFormat>(i);
    const std::string text = to_text(about);
    EXPECT_EQ(about_from_text(text, "x.strec").format, about.format) << text;
    texts.insert(text);
  }
  EXPECT_EQ(texts.size(), std::size_t{kPixelFormats});
}

TEST(RecordFormat, WhatIsMissingOrWrongIsOneLineWithTheKey) {
  About about;
  about.width = about.height = 4;
  std::string text = to_text(about);
  EXPECT_EQ(message_of([&] { (void)about_from_text("size 1 1\n", "x.strec"); }),
            "x.strec: 'source' is missing; the recording is damaged or of another version");
  text.replace(text.find("size 4 4"), 8, "size 4 x");
  EXPECT_EQ(message_of([&] { (void)about_from_text(text, "x.strec"); }),
            "x.strec: 'size' is not what it should be: '4 x'; the recording is damaged or of another version");
}

TEST(RecordFormat, SizesThatAreNoPicturesAreRefused) {
  for (const auto& [width, height, format] : {std::tuple{0, 4, PixelFormat::kGrey8},
                                              {4, 100000, PixelFormat::kGrey8},
                                              {5, 4, PixelFormat::kYuyv},
                                              {6, 4, PixelFormat::kGrey10Packed},
                                              {4, 5, PixelFormat::kBayerRggb8}}) {
    About about;
    about.width = width;
    about.height = height;
    about.format = format;
    EXPECT_NE(message_of([&] { (void)about_from_text(to_text(about), "x"); }), "");
  }
}

TEST(RecordFormat, CalibrationReadsBackToTheBit) {
  StereoCalibration calibration;
  calibration.left.fx = 1.0 / 3;
  calibration.left.distortion = {-0.3, 1e-17, 0.1, 5e-324, 0, 0, 7};
  calibration.right.lens = LensModel::kEquidistant;
  calibration.right.width = 1280;
  calibration.R_right_left(0, 1) = -1e-300;
  calibration.R_right_left(2, 0) = 0.1;
  calibration.t_right_left = {-0.12, 1.0 / 7, 3};
  const StereoCalibration read = calibration_from_text(to_text(calibration), "x");
  EXPECT_EQ(read.left.fx, calibration.left.fx);
  EXPECT_EQ(read.left.distortion, calibration.left.distortion);
  EXPECT_EQ(read.right.lens, LensModel::kEquidistant);
  EXPECT_EQ(read.right.width, 1280);
  EXPECT_EQ(read.R_right_left, calibration.R_right_left);
  EXPECT_EQ(read.t_right_left, calibration.t_right_left);
}

TEST(RecordFormat, CalibrationOfAnUnknownLensIsRefused) {
  std::string text = to_text(StereoCalibration{});
  text.replace(text.find("radtan"), 6, "cubist");
  EXPECT_NE(message_of([&] { (void)calibration_from_text(text, "x"); }).find("cubist"), std::string::npos);
}

}  // namespace
}  // namespace stereotrack::record
