#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <sstream>
#include <string>
#include <vector>

#include "tests/support/run_program.hpp"

namespace stereotrack::test {

namespace fs = std::filesystem;

inline std::vector<std::string> command(std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), std::string(STEREOTRACK_BIN_DIR) + "/stereotrack");
  return arguments;
}

inline ProgramResult stereotrack_command(std::vector<std::string> arguments, ProgramOptions options = {}) {
  return run_program(command(std::move(arguments)), std::move(options));
}

/// stderr is one line that begins with the program's name. Before it may stand how far it was, which is told every ten
/// seconds: an emulator takes so long.
inline testing::AssertionResult is_one_line(const std::string& said) {
  std::string text = said;
  for (std::size_t end = text.find('\n'); end != std::string::npos && std::isdigit(text[0]) != 0 &&
                                          text.substr(0, end).find(" frames, ") != std::string::npos;
       end = text.find('\n')) {
    text.erase(0, end + 1);
  }
  if (text.starts_with("stereotrack: ") && text.ends_with('\n') && std::count(text.begin(), text.end(), '\n') == 1) {
    return testing::AssertionSuccess();
  }
  return testing::AssertionFailure() << "not one line of ours: " << said;
}

inline std::string numbered(int ordinal) {
  std::array<char, 32> name{};
  (void)std::snprintf(name.data(), name.size(), "%06d.png", ordinal);
  return name.data();
}

inline std::string calibration_text(int width, int height, double translation_x) {
  std::ostringstream text;
  const auto matrix = [&text](const char* name, int rows, int cols, const std::string& data) {
    text << name << ": !!opencv-matrix\n   rows: " << rows << "\n   cols: " << cols << "\n   dt: d\n   data: [ " << data
         << " ]\n";
  };
  text << "%YAML:1.0\n---\nimage_size: [ " << width << ", " << height << " ]\n";
  const std::string camera =
      "150, 0, " + std::to_string((width - 1) / 2.0) + ", 0, 150, " + std::to_string((height - 1) / 2.0) + ", 0, 0, 1";
  for (const char* name : {"K1", "K2"}) matrix(name, 3, 3, camera);
  for (const char* name : {"D1", "D2"}) matrix(name, 1, 5, "0, 0, 0, 0, 0");
  matrix("R", 3, 3, "1, 0, 0, 0, 1, 0, 0, 0, 1");
  matrix("T", 3, 1, std::to_string(translation_x) + ", 0, 0");
  return text.str();
}

enum class Paint { kColour, kGrey };

/// left/ right/ calibration.yml: a textured square at disparity 12 px crosses a textured wall at 3 px.
/// From the 7th pair on it moves by 3 px a frame.
struct SmallScene {
  static constexpr int kWidth = 160;
  static constexpr int kHeight = 120;

  static void write(const fs::path& folder, int pairs, Paint paint = Paint::kColour) {
    for (const char* view : {"left", "right"}) fs::create_directories(folder / view);
    std::ofstream(folder / "calibration.yml") << calibration_text(kWidth, kHeight, -0.2);
    cv::RNG random(7);
    const cv::Mat wall = texture(random, kWidth + 16, kHeight, 40, 130);
    const cv::Mat square = texture(random, 30, 30, 120, 250);
    for (int ordinal = 1; ordinal <= pairs; ++ordinal) {
      const int x = 20 + 3 * std::max(0, ordinal - 6);
      for (const bool right : {false, true}) {
        cv::Mat picture = wall(cv::Rect(right ? 3 : 0, 0, kWidth, kHeight)).clone();
        const cv::Rect place = cv::Rect(right ? x - 12 : x, 40, 30, 30);
        const cv::Rect seen = place & cv::Rect(0, 0, kWidth, kHeight);
        if (ordinal > 6 && !seen.empty()) square(seen - place.tl()).copyTo(picture(seen));
        if (paint == Paint::kGrey) cv::cvtColor(picture, picture, cv::COLOR_BGR2GRAY);
        cv::imwrite((folder / (right ? "right" : "left") / numbered(ordinal)).string(), picture);
      }
    }
  }

 private:
  static cv::Mat texture(cv::RNG& random, int width, int height, int low, int high) {
    cv::Mat picture(height, width, CV_8UC3);
    random.fill(picture, cv::RNG::UNIFORM, low, high);
    cv::GaussianBlur(picture, picture, {3, 3}, 0);
    return picture;
  }
};

inline nlohmann::ordered_json summary_of(const fs::path& out) {
  return nlohmann::ordered_json::parse(read_text(out / "summary.json"));
}

/// Names in a folder, sorted; empty if it is not there.
inline std::vector<std::string> names_in(const fs::path& folder) {
  std::vector<std::string> names;
  std::error_code missing;
  for (const auto& entry : fs::directory_iterator(folder, missing)) names.push_back(entry.path().filename().string());
  std::sort(names.begin(), names.end());
  return names;
}

/// A row of tracks.csv: the text, and its first two columns.
struct CsvRow {
  std::uint64_t frame = 0;
  std::uint32_t id = 0;
  std::string text;
};

inline std::vector<CsvRow> rows_of(const fs::path& csv) {
  std::vector<CsvRow> rows;
  std::istringstream lines(read_text(csv));
  for (std::string line; std::getline(lines, line);) {
    CsvRow row;
    char comma = 0;
    std::istringstream(line) >> row.frame >> comma >> row.id;
    row.text = line;
    rows.push_back(row);
  }
  return rows;
}

}  // namespace stereotrack::test
