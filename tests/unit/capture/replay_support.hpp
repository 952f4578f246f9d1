#pragma once

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <optional>
#include <string>
#include <vector>

#include "drivers/capture/replay/replay.hpp"
#include "tests/support/temp_dir.hpp"

namespace stereotrack::capture {

/// A picture whose pixels say which one it is: value at (x, y) = id + 3 y + x, modulo 256.
inline cv::Mat grey_picture(int id, int width = 16, int height = 8) {
  cv::Mat picture(height, width, CV_8UC1);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) picture.at<std::uint8_t>(y, x) = static_cast<std::uint8_t>(id + 3 * y + x);
  }
  return picture;
}

/// Blue, green, red of every pixel.
inline cv::Mat colour_picture(int blue, int green, int red, int width = 16, int height = 8) {
  return {height, width, CV_8UC3, cv::Scalar(blue, green, red)};
}

inline void write_picture(const std::filesystem::path& file, const cv::Mat& picture) {
  std::filesystem::create_directories(file.parent_path());
  ASSERT_TRUE(cv::imwrite(file.string(), picture)) << file;
}

inline std::string file_bytes(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

inline void put_bytes(const std::filesystem::path& file, const std::string& bytes) {
  std::ofstream(file, std::ios::binary) << bytes;
}

/// One answer of a source, pixels copied.
struct Answer {
  Next next = Next::kEnd;
  std::uint64_t ordinal = 0;
  std::int64_t time_ns = 0;
  std::optional<std::chrono::nanoseconds> skew;
  int left = -1;   ///< first pixel's first byte, -1: none
  int right = -1;  ///< same
  std::string reason;
};

inline Answer ask(FrameSource& source) {
  FramePair pair;
  Answer answer;
  answer.next = source.next(pair);
  answer.ordinal = pair.ordinal;
  answer.time_ns = pair.capture_time.time_since_epoch().count();
  answer.skew = pair.skew;
  if (!pair.left.empty()) answer.left = pair.left.data[0];
  if (!pair.right.empty()) answer.right = pair.right.data[0];
  if (answer.next == Next::kSkipped) answer.reason = source.skip_reason();
  return answer;
}

inline std::vector<Answer> ask_all(FrameSource& source) {
  std::vector<Answer> answers;
  for (Answer answer = ask(source); answer.next != Next::kEnd; answer = ask(source)) answers.push_back(answer);
  return answers;
}

inline std::vector<Answer> replay_all(const std::filesystem::path& path, const ReplayOptions& options = {}) {
  return ask_all(*open_replay(path.string(), options));
}

/// The message with which opening fails, "" if it does not.
inline std::string open_error(const std::string& source, const ReplayOptions& options = {}) {
  try {
    const auto opened = open_replay(source, options);
    return {};
  } catch (const std::runtime_error& error) {
    return error.what();
  }
}

inline std::filesystem::path shared_data(const std::string& set) {
  return std::filesystem::path(STEREOTRACK_SOURCE_DIR) / ".." / "shared" / "data" / set;
}

}  // namespace stereotrack::capture
