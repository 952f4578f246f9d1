#include "pipeline/shape/morphology.hpp"

#include <gtest/gtest.h>

#include "tests/unit/shape/pictures.hpp"

namespace stereotrack {
namespace {

using test::const_view;
using test::random_grey;
using test::salt;
using test::view;

template <class Stage>
cv::Mat_<std::uint8_t> result_of(cv::Mat_<std::uint8_t>& in, int repeats) {
  Arena arena;
  auto stage = Stage::create({repeats}, in.cols, in.rows, arena);
  EXPECT_TRUE(stage.has_value());
  cv::Mat_<std::uint8_t> out(in.size(), std::uint8_t{77});
  EXPECT_TRUE(stage->run(const_view(in), view(out)).has_value());
  return out;
}

cv::Mat_<std::uint8_t> reference(const cv::Mat_<std::uint8_t>& in, int operation, int repeats) {
  const cv::Mat square = cv::getStructuringElement(cv::MORPH_RECT, {3, 3});
  cv::Mat_<std::uint8_t> out;
  cv::morphologyEx(in, out, operation, square, {-1, -1}, repeats);
  return out;
}

// Figure 3.12: only where the whole square fits does erosion keep a pixel, and dilation gives the square back.
TEST(Opening, SquareStaysAndSpikeGoes) {
  cv::Mat_<std::uint8_t> mask(9, 9, std::uint8_t{0});
  mask(cv::Rect(2, 2, 3, 3)).setTo(255);
  cv::Mat_<std::uint8_t> spiked = mask.clone();
  spiked(3, 5) = 255;
  spiked(7, 7) = 255;
  EXPECT_EQ(test::differing(result_of<Opening>(spiked, 1), mask), 0);
}

TEST(Opening, ObjectAtThePictureBorderIsNotErodedFromOutside) {
  cv::Mat_<std::uint8_t> mask(8, 8, std::uint8_t{0});
  mask(cv::Rect(0, 0, 2, 8)).setTo(255);
  EXPECT_EQ(test::differing(result_of<Opening>(mask, 1), mask), 0);
}

TEST(Opening, EqualsOpenCv) {
  for (const cv::Size size : {cv::Size(1, 1), cv::Size(1, 9), cv::Size(9, 1), cv::Size(2, 3), cv::Size(15, 11),
                              cv::Size(16, 11), cv::Size(17, 11), cv::Size(131, 77)}) {
    for (int repeats = 0; repeats <= 4; ++repeats) {
      cv::Mat_<std::uint8_t> mask = salt(size.width, size.height, 0.85, 5);
      const cv::Mat_<std::uint8_t> open_mask = repeats == 0 ? mask : reference(mask, cv::MORPH_OPEN, repeats);
      EXPECT_EQ(test::differing(result_of<Opening>(mask, repeats), open_mask), 0) << size << repeats;
    }
  }
}

// Words begin and end at multiples of 64 pixels.
TEST(Opening, EqualsOpenCvAtEveryWidth) {
  for (int width = 1; width <= 200; ++width) {
    cv::Mat_<std::uint8_t> mask = salt(width, 9, 0.9, static_cast<std::uint64_t>(width));
    EXPECT_EQ(test::differing(result_of<Opening>(mask, 1), reference(mask, cv::MORPH_OPEN, 1)), 0) << width;
    EXPECT_EQ(test::differing(result_of<Closing>(mask, 2), reference(mask, cv::MORPH_CLOSE, 2)), 0) << width;
    mask = 255 - mask;
    EXPECT_EQ(test::differing(result_of<Closing>(mask, 1), reference(mask, cv::MORPH_CLOSE, 1)), 0) << width;
  }
}

TEST(Opening, WhatIsNotZeroIsSet) {
  cv::Mat_<std::uint8_t> mask = salt(70, 20, 0.9, 5);
  const cv::Mat_<std::uint8_t> grey(random_grey(70, 20, 6) | 1);
  cv::Mat_<std::uint8_t> values(mask & grey);
  for (int repeats = 0; repeats <= 2; ++repeats) {
    EXPECT_EQ(test::differing(result_of<Opening>(values, repeats), result_of<Opening>(mask, repeats)), 0);
    EXPECT_EQ(test::differing(result_of<Closing>(values, repeats), result_of<Closing>(mask, repeats)), 0);
  }
}

TEST(Closing, EqualsOpenCv) {
  for (const cv::Size size : {cv::Size(1, 1), cv::Size(1, 9), cv::Size(9, 1), cv::Size(17, 11), cv::Size(131, 77)}) {
    for (int repeats = 1; repeats <= 3; ++repeats) {
      cv::Mat_<std::uint8_t> mask = salt(size.width, size.height, 0.15, 5);
      EXPECT_EQ(test::differing(result_of<Closing>(mask, repeats), reference(mask, cv::MORPH_CLOSE, repeats)), 0);
    }
  }
}

TEST(Opening, AllSetAndNoneSetStay) {
  cv::Mat_<std::uint8_t> all(7, 9, std::uint8_t{255});
  cv::Mat_<std::uint8_t> none(7, 9, std::uint8_t{0});
  EXPECT_EQ(test::differing(result_of<Opening>(all, 3), all), 0);
  EXPECT_EQ(test::differing(result_of<Opening>(none, 3), none), 0);
  EXPECT_EQ(test::differing(result_of<Closing>(all, 3), all), 0);
  EXPECT_EQ(test::differing(result_of<Closing>(none, 3), none), 0);
}

TEST(Opening, InPlace) {
  for (int repeats = 0; repeats <= 3; ++repeats) {
    cv::Mat_<std::uint8_t> mask = salt(40, 30, 0.9, 8);
    const cv::Mat_<std::uint8_t> expected = result_of<Opening>(mask, repeats);
    Arena arena;
    auto opening = Opening::create({repeats}, 40, 30, arena);
    ASSERT_TRUE(opening.has_value());
    ASSERT_TRUE(opening->run(const_view(mask), view(mask)).has_value());
    EXPECT_EQ(test::differing(mask, expected), 0);
  }
}

TEST(Opening, OtherSizeIsAFaultAndLeavesTheOutput) {
  Arena arena;
  auto opening = Opening::create({}, 8, 6, arena);
  auto closing = Closing::create({}, 8, 6, arena);
  ASSERT_TRUE(opening.has_value());
  ASSERT_TRUE(closing.has_value());
  cv::Mat_<std::uint8_t> in(6, 8, std::uint8_t{1});
  cv::Mat_<std::uint8_t> wrong(7, 8, std::uint8_t{9});
  EXPECT_EQ(opening->run(const_view(in), view(wrong)).error(), Fault::kBadSize);
  EXPECT_EQ(closing->run(const_view(in), view(wrong)).error(), Fault::kBadSize);
  EXPECT_EQ(cv::countNonZero(wrong != 9), 0);
}

TEST(Opening, BadConfigurationIsRefused) {
  Arena arena;
  EXPECT_EQ(Opening::create({-1}, 8, 6, arena).error(), Fault::kBadConfig);
  EXPECT_EQ(Opening::create({}, 0, 6, arena).error(), Fault::kBadConfig);
  EXPECT_EQ(Closing::create({-1}, 8, 6, arena).error(), Fault::kBadConfig);
  arena.seal();
  EXPECT_EQ(Closing::create({}, 8, 6, arena).error(), Fault::kOutOfMemory);
}

}  // namespace
}  // namespace stereotrack
