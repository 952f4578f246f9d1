#include <gtest/gtest.h>

#include <filesystem>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <string>

#include "pipeline/shape/blob_extractor.hpp"
#include "pipeline/shape/contour_fill.hpp"
#include "pipeline/shape/level_set.hpp"
#include "pipeline/shape/morphology.hpp"
#include "pipeline/shape/sobel.hpp"
#include "pipeline/shape/threshold.hpp"
#include "tests/unit/shape/pictures.hpp"

// The stages of this room in the document's order on real frames, against their pixel masks.
namespace stereotrack {
namespace {

using test::const_view;
using test::view;

constexpr int kWidth = 320;
constexpr int kHeight = 240;
constexpr std::uint8_t kOutsideRoi = 85;
constexpr std::uint8_t kUnknown = 170;
constexpr std::uint8_t kMoving = 255;

struct Score {
  double hit = 0;
  double wrong = 0;
  double missed = 0;

  void add(ImageView<const std::uint16_t> labels, const cv::Mat_<std::uint8_t>& truth) {
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        const std::uint8_t t = truth(y, x);
        if (t == kOutsideRoi || t == kUnknown) continue;
        const bool object = labels.at(x, y) != 0;
        hit += t == kMoving && object;
        wrong += t != kMoving && object;
        missed += t == kMoving && !object;
      }
    }
  }
  [[nodiscard]] double f() const { return 2 * hit / (2 * hit + wrong + missed); }
};

class Highway : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = std::string(STEREOTRACK_SOURCE_DIR) + "/../shared/data/cdnet_highway/";
    if (!std::filesystem::exists(folder_)) GTEST_SKIP() << "no recording in " << folder_;
    cv::Mat_<double> sum(kHeight, kWidth, 0.0);
    for (int i = 470; i < 570; ++i) {
      cv::Mat_<double> grey;
      read("input/in", i, ".jpg").convertTo(grey, CV_64F);
      sum += grey;
    }
    sum.convertTo(background_, CV_8U, 0.01);
  }

  cv::Mat_<std::uint8_t> read(const char* kind, int number, const char* ending) const {
    return cv::imread(cv::format("%s%s%06d%s", folder_.c_str(), kind, number, ending), cv::IMREAD_GRAYSCALE);
  }

  std::string folder_;
  cv::Mat_<std::uint8_t> background_;
};

TEST_F(Highway, LevelSetImprovesTheMask) {
  Arena arena;
  auto sobel = Sobel::create({}, kWidth, kHeight, arena);
  auto fill = ContourFill::create({}, kWidth, kHeight, arena);
  auto opening = Opening::create({}, kWidth, kHeight, arena);
  auto extractor = BlobExtractor::create({.min_area_px = 20}, kWidth, kHeight, arena);
  auto level_set = LevelSet::create({}, kWidth, kHeight, arena);
  ASSERT_TRUE(sobel.has_value() && fill.has_value() && opening.has_value() && extractor.has_value() &&
              level_set.has_value());
  Score before;
  Score after;
  for (int number = 600; number < 1000; number += 20) {
    cv::Mat_<std::uint8_t> difference;
    cv::absdiff(read("input/in", number, ".jpg"), background_, difference);
    const cv::Mat_<std::uint8_t> truth = read("groundtruth/gt", number, ".png");
    cv::Mat_<std::uint8_t> mask(kHeight, kWidth);
    ASSERT_TRUE(sobel->run(const_view(difference), view(mask)).has_value());
    ASSERT_TRUE(threshold(const_view(mask), 60, view(mask)).has_value());
    ASSERT_TRUE(fill->run(const_view(mask), view(mask)).has_value());
    ASSERT_TRUE(opening->run(const_view(mask), view(mask)).has_value());
    const auto blobs = extractor->run(const_view(mask));
    ASSERT_TRUE(blobs.has_value());
    before.add(blobs->labels, truth);
    for (const Blob& blob : blobs->blobs) {
      ASSERT_TRUE(level_set->run(const_view(difference), blobs->labels, blob.box, blob.label).has_value());
    }
    after.add(blobs->labels, truth);
  }
  RecordProperty("f_before", std::to_string(before.f()));
  RecordProperty("f_after", std::to_string(after.f()));
  EXPECT_GE(before.f(), 0.87);
  EXPECT_GE(after.f(), 0.93);
}

}  // namespace
}  // namespace stereotrack
