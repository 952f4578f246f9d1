#include "firmware-app/stereotrack/disparity.hpp"

#include <algorithm>
#include <cstdint>
#include <fstream>
#include <iterator>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <ostream>
#include <stdexcept>
#include <string>
#include <vector>

#include "firmware-app/runtime/large_pages.hpp"
#include "firmware-app/stereotrack/output_file.hpp"
#include "pipeline/core/arena.hpp"
#include "pipeline/stereo/census_matcher.hpp"
#include "pipeline/stereo/sad_matcher.hpp"

namespace stereotrack {

namespace fs = std::filesystem;

namespace {

constexpr int kFileScale = 256;  ///< file values in one pixel
constexpr int kLargestInFile = 65535 / kFileScale;

// Decoded from memory: imread prints a warning of its own beside our line.
cv::Mat read_grey(const fs::path& path) {
  std::error_code ignored;
  if (fs::is_directory(path, ignored)) throw std::runtime_error(path.string() + ": is a folder; want a picture file");
  std::ifstream file(path, std::ios::binary);
  const std::vector<char> bytes{std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
  if (!file.is_open() || file.bad() || bytes.empty()) {
    throw std::runtime_error(path.string() + ": cannot be opened or is empty; want a picture file");
  }
  cv::Mat picture;
  try {
    picture = cv::imdecode(bytes, cv::IMREAD_GRAYSCALE);
  } catch (const cv::Exception&) {
    picture.release();
  }
  if (picture.empty()) {
    throw std::runtime_error(path.string() + ": not a picture, or damaged; want PNG, JPEG, PGM or the like");
  }
  return picture;
}

ImageView<const std::uint8_t> view(const cv::Mat& m) {
  return {m.ptr<std::uint8_t>(), m.cols, m.rows, static_cast<std::ptrdiff_t>(m.step)};
}

template <class Matcher>
DisparityCounts match(const typename Matcher::Config& config, const cv::Mat& left, const cv::Mat& right,
                      cv::Mat& disparity) {
  Arena arena{runtime::advise_large_pages};
  Result<Matcher> matcher = Matcher::create(config, arena);
  if (!matcher.has_value()) {
    throw std::runtime_error("disparity: " + std::string(to_string(matcher.error())) + " for pictures of " +
                             std::to_string(left.cols) + "x" + std::to_string(left.rows) +
                             "; want at most 8192x8192, or a smaller disparity.max");
  }
  const ImageView<std::uint16_t> out{disparity.ptr<std::uint16_t>(), disparity.cols, disparity.rows,
                                     static_cast<std::ptrdiff_t>(disparity.step / sizeof(std::uint16_t))};
  const Result<DisparityCounts> counts = matcher->run(view(left), view(right), out);
  if (!counts.has_value()) throw std::runtime_error(std::string("disparity: ") + to_string(counts.error()));
  return *counts;
}

template <class Config>
Config stage_config(const DisparityConfig& user, const cv::Mat& left) {
  Config config;
  config.width = left.cols;
  config.height = left.rows;
  config.block = user.block;
  config.range = {0, user.max};
  return config;
}

/// From 1/16 px with kNoDisparity to 1/256 px with 0.
void to_file_values(cv::Mat& disparity) {
  for (int y = 0; y < disparity.rows; ++y) {
    auto* row = disparity.ptr<std::uint16_t>(y);
    for (int x = 0; x < disparity.cols; ++x) {
      const int value = row[x] * (kFileScale / kDisparityScale);
      row[x] = row[x] == kNoDisparity ? std::uint16_t{0} : static_cast<std::uint16_t>(std::clamp(value, 1, 65535));
    }
  }
}

}  // namespace

int run_disparity(const DisparityArguments& arguments, const config::Loaded& loaded, std::ostream& messages) {
  const DisparityConfig& user = loaded.configuration.pipeline.disparity;
  if (user.max > kLargestInFile) {
    throw config::error_at(loaded.origins, "disparity.max",
                           "a 16-bit file of disparity x 256 holds at most " + std::to_string(kLargestInFile) +
                               " px; set disparity.max to that or less");
  }
  const cv::Mat left = read_grey(arguments.left);
  const cv::Mat right = read_grey(arguments.right);
  if (left.size() != right.size()) {
    throw std::runtime_error(arguments.right.string() + ": " + std::to_string(right.cols) + "x" +
                             std::to_string(right.rows) + ", but " + arguments.left.string() + " is " +
                             std::to_string(left.cols) + "x" + std::to_string(left.rows) +
                             "; a rectified pair has one size");
  }
  cv::Mat disparity(left.size(), CV_16U);
  const DisparityCounts counts =
      user.method == MatchMethod::kSad
          ? match<SadMatcher>(stage_config<SadMatcher::Config>(user, left), left, right, disparity)
          : match<CensusMatcher>(stage_config<CensusMatcher::Config>(user, left), left, right, disparity);
  to_file_values(disparity);

  std::vector<std::uint8_t> png;
  cv::imencode(".png", disparity, png);
  OutputFile file(arguments.out);
  file.write({reinterpret_cast<const char*>(png.data()), png.size()});
  file.commit();
  messages << arguments.out.string() << ": disparity on " << counts.matched << " of " << counts.wanted
           << " pixels (rejected: border " << counts.border << ", texture " << counts.texture << ", uniqueness "
           << counts.uniqueness << ", left-right " << counts.left_right << ", speckle " << counts.speckle
           << "; of these filled " << counts.filled << ")\n";
  return 0;
}

}  // namespace stereotrack
