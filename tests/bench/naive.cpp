#include "tests/bench/naive.hpp"

#include <algorithm>
#include <bit>
#include <cstdint>
#include <cstdlib>
#include <vector>

namespace stereotrack::bench {

namespace {

struct Window {
  int sum = 0;
  int columns = 0;
};

// beats(window, best so far): whether the window wins.
template <class Cost, class Beats>
cv::Mat match(cv::Size size, int block, DisparityRange range, const Cost& cost, const Beats& beats) {
  const int radius = block / 2;
  // Cost of (pixel, d), a picture a candidate; those without a partner stay 0 and are never read.
  std::vector<cv::Mat> costs;
  for (int d = range.min; d <= range.max; ++d) {
    costs.emplace_back(size, CV_8U, cv::Scalar(0));
    for (int y = 0; y < size.height; ++y) {
      for (int x = d; x < size.width; ++x) costs.back().at<std::uint8_t>(y, x) = cost(x, y, d);
    }
  }
  cv::Mat out(size, CV_16U, cv::Scalar(kNoDisparity));
  for (int y = 0; y < size.height; ++y) {
    const int top = std::max(y - radius, 0);
    const int bottom = std::min(y + radius, size.height - 1);
    for (int x = range.min; x < size.width; ++x) {
      Window best;
      for (int d = range.min; d <= std::min(range.max, x); ++d) {
        const int begin = std::max(x - radius, d);
        const int end = std::min(x + radius, size.width - 1);
        Window window{0, end - begin + 1};
        for (int v = top; v <= bottom; ++v) {
          const std::uint8_t* row = costs[static_cast<std::size_t>(d - range.min)].ptr<std::uint8_t>(v);
          for (int u = begin; u <= end; ++u) window.sum += row[u];
        }
        if (best.columns != 0 && !beats(window, best)) continue;
        best = window;
        out.at<std::uint16_t>(y, x) = static_cast<std::uint16_t>(d);
      }
    }
  }
  return out;
}

cv::Mat census(const cv::Mat& picture) {
  cv::Mat codes(picture.size(), CV_32S);
  const auto grey = [&](int x, int y) {
    return picture.at<std::uint8_t>(std::clamp(y, 0, picture.rows - 1), std::clamp(x, 0, picture.cols - 1));
  };
  for (int y = 0; y < picture.rows; ++y) {
    for (int x = 0; x < picture.cols; ++x) {
      std::uint32_t code = 0;
      for (int j = -3; j <= 3; ++j) {
        for (int i = -3; i <= 3; ++i) {
          if ((i + j) % 2 != 0) code = 2 * code + (grey(x + i, y + j) < grey(x, y) ? 1U : 0U);
        }
      }
      codes.at<std::int32_t>(y, x) = static_cast<std::int32_t>(code);
    }
  }
  return codes;
}

}  // namespace

cv::Mat naive_sad(const cv::Mat& left, const cv::Mat& right, int block, DisparityRange range) {
  const auto cost = [&](int x, int y, int d) {
    return static_cast<std::uint8_t>(std::abs(left.at<std::uint8_t>(y, x) - right.at<std::uint8_t>(y, x - d)));
  };
  // Means: all windows of a pixel have the same rows.
  return match(left.size(), block, range, cost, [](const Window& window, const Window& best) {
    return window.sum * best.columns < best.sum * window.columns;
  });
}

cv::Mat naive_census(const cv::Mat& left, const cv::Mat& right, int block, DisparityRange range) {
  const cv::Mat left_codes = census(left);
  const cv::Mat right_codes = census(right);
  const auto cost = [&](int x, int y, int d) {
    const auto differing =
        static_cast<std::uint32_t>(left_codes.at<std::int32_t>(y, x) ^ right_codes.at<std::int32_t>(y, x - d));
    return static_cast<std::uint8_t>(std::popcount(differing));
  };
  return match(left.size(), block, range, cost, [block](const Window& window, const Window& best) {
    return window.sum * block / window.columns < best.sum * block / best.columns;
  });
}

}  // namespace stereotrack::bench
