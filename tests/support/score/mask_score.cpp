#include "tests/support/score/mask_score.hpp"

#include <map>
#include <opencv2/imgcodecs.hpp>
#include <optional>
#include <stdexcept>
#include <string>

namespace stereotrack::score {
namespace {

namespace fs = std::filesystem;

constexpr std::uint8_t kStatic = 0;
constexpr std::uint8_t kShadow = 50;
constexpr std::uint8_t kOutside = 85;
constexpr std::uint8_t kUnknown = 170;
constexpr std::uint8_t kMoving = 255;

double ratio(std::uint64_t part, std::uint64_t whole) {
  return whole > 0 ? static_cast<double>(part) / static_cast<double>(whole) : 0.0;
}

std::optional<std::int64_t> last_number(const std::string& name) {
  const auto end = name.find_last_of("0123456789");
  if (end == std::string::npos) return std::nullopt;
  const auto before = name.find_last_not_of("0123456789", end);
  const auto start = before == std::string::npos ? 0 : before + 1;
  constexpr std::size_t kMostDigits = 18;
  if (end + 1 - start > kMostDigits) return std::nullopt;
  return std::stoll(name.substr(start, end + 1 - start));
}

std::map<std::int64_t, fs::path> pictures(const fs::path& folder) {
  if (!fs::is_directory(folder)) throw std::runtime_error(folder.string() + ": is not a folder");
  std::map<std::int64_t, fs::path> by_number;
  for (const auto& entry : fs::directory_iterator(folder)) {
    const auto number = last_number(entry.path().stem().string());
    if (entry.path().extension() != ".png" || !number) continue;
    const auto [other, is_new] = by_number.try_emplace(*number, entry.path());
    if (!is_new) throw std::runtime_error(entry.path().string() + ": same number as " + other->second.string());
  }
  if (by_number.empty()) throw std::runtime_error(folder.string() + ": holds no numbered PNG");
  return by_number;
}

cv::Mat read_grey(const fs::path& file) {
  cv::Mat picture = cv::imread(file.string(), cv::IMREAD_GRAYSCALE);
  if (picture.empty()) throw std::runtime_error(file.string() + ": cannot be read as a picture");
  return picture;
}

}  // namespace

double MaskScore::precision() const { return ratio(true_positives, true_positives + false_positives); }
double MaskScore::recall() const { return ratio(true_positives, true_positives + false_negatives); }
double MaskScore::f_measure() const {
  return ratio(2 * true_positives, 2 * true_positives + false_positives + false_negatives);
}
double MaskScore::shadow_rate() const { return ratio(shadow_as_object, shadow_pixels); }

void add_frame(MaskScore& score, const cv::Mat& truth, const cv::Mat& mask) {
  if (truth.type() != CV_8UC1 || mask.type() != CV_8UC1) throw std::runtime_error("a mask must have one byte a pixel");
  if (truth.size() != mask.size()) {
    throw std::runtime_error("the mask is " + std::to_string(mask.cols) + "x" + std::to_string(mask.rows) +
                             ", the truth " + std::to_string(truth.cols) + "x" + std::to_string(truth.rows));
  }
  ++score.frames;
  for (int y = 0; y < truth.rows; ++y) {
    const auto* label = truth.ptr<std::uint8_t>(y);
    const auto* mark = mask.ptr<std::uint8_t>(y);
    for (int x = 0; x < truth.cols; ++x) {
      if (mark[x] != 0 && mark[x] != 255) {
        throw std::runtime_error("the mask holds " + std::to_string(mark[x]) + ", but only 0 and 255 mean something");
      }
      const bool object = mark[x] == 255;
      switch (label[x]) {
        case kMoving: ++(object ? score.true_positives : score.false_negatives); break;
        case kShadow:
          ++score.shadow_pixels;
          if (object) ++score.shadow_as_object;
          [[fallthrough]];
        case kStatic: ++(object ? score.false_positives : score.true_negatives); break;
        case kOutside:
        case kUnknown: break;
        default: throw std::runtime_error("the truth holds the unknown label " + std::to_string(label[x]));
      }
    }
  }
}

MaskScore score_mask_folders(const fs::path& truth_folder, const fs::path& mask_folder, std::size_t skip,
                             std::int64_t offset) {
  const auto truths = pictures(truth_folder);
  const auto masks = pictures(mask_folder);
  MaskScore score;
  std::size_t seen = 0;
  for (const auto& [number, truth_file] : truths) {
    if (seen++ < skip) continue;
    const auto mask_file = masks.find(number - offset);
    if (mask_file == masks.end()) {
      throw std::runtime_error(truth_file.string() + ": " + mask_folder.string() + " has no mask with the number " +
                               std::to_string(number - offset) + "; is --offset right?");
    }
    try {
      add_frame(score, read_grey(truth_file), read_grey(mask_file->second));
    } catch (const std::runtime_error& error) {
      throw std::runtime_error(mask_file->second.string() + " (truth " + truth_file.filename().string() +
                               "): " + error.what());
    }
  }
  if (score.frames == 0) {
    throw std::runtime_error(truth_folder.string() + ": has " + std::to_string(truths.size()) +
                             " frames and all are skipped; give a smaller --skip");
  }
  return score;
}

}  // namespace stereotrack::score
