#include "tests/support/score/disparity_score.hpp"

#include <cmath>
#include <opencv2/imgcodecs.hpp>
#include <stdexcept>
#include <string>

namespace stereotrack::score {
namespace {

double ratio(std::uint64_t part, std::uint64_t whole) {
  return whole > 0 ? static_cast<double>(part) / static_cast<double>(whole) : 0.0;
}

void expect_map(const cv::Mat& map, const cv::Size& size, int type, const char* what) {
  if (map.type() == type && map.size() == size) return;
  throw std::runtime_error(std::string(what) + " is " + std::to_string(map.cols) + "x" + std::to_string(map.rows) +
                           ", the truth " + std::to_string(size.width) + "x" + std::to_string(size.height) +
                           ", or its pixels are of another type");
}

cv::Mat read(const std::filesystem::path& file, int flags) {
  cv::Mat picture = cv::imread(file.string(), flags);
  if (picture.empty()) throw std::runtime_error(file.string() + ": cannot be read as a picture");
  return picture;
}

}  // namespace

double DisparityScore::density() const { return ratio(matched, scored); }
double DisparityScore::bad_1() const { return ratio(over_1, matched); }
double DisparityScore::bad_2() const { return ratio(over_2, matched); }
double DisparityScore::bad_2_of_all() const { return ratio(over_2 + (scored - matched), scored); }

DisparityScore score_disparity(const cv::Mat& truth, const cv::Mat& estimate, const cv::Mat& mask) {
  expect_map(truth, truth.size(), CV_32FC1, "the truth");
  expect_map(estimate, truth.size(), CV_32FC1, "the disparity map");
  if (!mask.empty()) expect_map(mask, truth.size(), CV_8UC1, "the mask");
  DisparityScore score;
  for (int y = 0; y < truth.rows; ++y) {
    for (int x = 0; x < truth.cols; ++x) {
      const float wanted = truth.at<float>(y, x);
      if (wanted <= 0 || (!mask.empty() && mask.at<std::uint8_t>(y, x) != 255)) continue;
      ++score.scored;
      const float found = estimate.at<float>(y, x);
      if (found <= 0) continue;
      ++score.matched;
      const float error = std::abs(found - wanted);
      if (error > 1) ++score.over_1;
      if (error > 2) ++score.over_2;
    }
  }
  return score;
}

cv::Mat non_occluded(const cv::Mat& left, const cv::Mat& right, double tolerance) {
  expect_map(left, left.size(), CV_32FC1, "the left truth");
  expect_map(right, left.size(), CV_32FC1, "the right truth");
  cv::Mat seen(left.size(), CV_8UC1, cv::Scalar(0));
  for (int y = 0; y < left.rows; ++y) {
    for (int x = 0; x < left.cols; ++x) {
      const float disparity = left.at<float>(y, x);
      if (disparity <= 0) continue;
      const auto x_right = static_cast<int>(std::lround(static_cast<float>(x) - disparity));
      if (x_right < 0 || x_right >= right.cols) continue;
      const float back = right.at<float>(y, x_right);
      if (back > 0 && std::abs(back - disparity) <= tolerance) seen.at<std::uint8_t>(y, x) = 255;
    }
  }
  return seen;
}

cv::Mat read_truth(const std::filesystem::path& file, double scale) {
  if (!(scale > 0)) throw std::runtime_error(file.string() + ": the scale must be over 0");
  const cv::Mat stored = read(file, cv::IMREAD_ANYDEPTH | cv::IMREAD_GRAYSCALE);
  cv::Mat disparity;
  stored.convertTo(disparity, CV_32F, 1.0 / scale);
  for (float& value : cv::Mat_<float>(disparity)) {
    if (!std::isfinite(value) || value < 0) value = 0;
  }
  return disparity;
}

cv::Mat read_estimate(const std::filesystem::path& file) {
  const cv::Mat stored = read(file, cv::IMREAD_UNCHANGED);
  if (stored.type() != CV_16UC1) {
    throw std::runtime_error(file.string() + ": is not a 16-bit grey PNG (disparity x 256)");
  }
  cv::Mat disparity;
  stored.convertTo(disparity, CV_32F, 1.0 / 256);
  return disparity;
}

cv::Mat read_scored_mask(const std::filesystem::path& file) { return read(file, cv::IMREAD_GRAYSCALE); }

}  // namespace stereotrack::score
