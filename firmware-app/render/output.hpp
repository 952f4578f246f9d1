#pragma once

#include <cstdint>
#include <memory>
#include <opencv2/core.hpp>
#include <string>

namespace stereotrack::render {

/// Where drawn pictures go. Everything throws std::runtime_error with one line: file, what is wrong, way out.
class Output {
 public:
  Output() = default;
  Output(const Output&) = delete;
  Output& operator=(const Output&) = delete;
  virtual ~Output() = default;

  virtual void write(std::uint64_t ordinal, const cv::Mat& picture) = 0;
  virtual void commit() = 0;
};

/// Whether the name ends in .mp4, .avi or .mkv, in either case.
[[nodiscard]] bool names_video(const std::string& target);

/// A video at `fps`, under NAME.part.EXT until commit(), which reads it back and counts its frames before it
/// takes its name: the encoder itself says nothing when the disk is full. Nothing written: no file.
[[nodiscard]] std::unique_ptr<Output> make_video_output(const std::string& target, cv::Size size, double fps);

/// %06d.png in a folder, which is made where it does not exist; each appears when it is whole.
/// Pictures of another run under other ordinals stay.
[[nodiscard]] std::unique_ptr<Output> make_folder_output(const std::string& target);

}  // namespace stereotrack::render
