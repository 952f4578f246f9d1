#pragma once

#include <chrono>
#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <opencv2/videoio.hpp>
#include <optional>
#include <string>

#include "drivers/capture/frame_source.hpp"
#include "drivers/capture/replay/replay.hpp"

namespace stereotrack::capture {

/// One video file, read forwards.
class VideoFile {
 public:
  /// Throws if the file is missing or no picture can be read from it.
  VideoFile(const std::string& path, double fallback_fps);

  /// Goes to the next picture without converting its pixels; false at the end.
  [[nodiscard]] bool grab();
  /// The pixels of the picture that was grabbed, CV_8UC3, in memory of this object; empty, and fault() says why, if
  /// they cannot be had.
  [[nodiscard]] cv::Mat& retrieve();

  [[nodiscard]] const std::string& path() const { return path_; }
  [[nodiscard]] const std::string& fault() const { return fault_; }
  [[nodiscard]] int width() const { return width_; }
  [[nodiscard]] int height() const { return height_; }
  [[nodiscard]] PixelFormat format() const { return format_; }  ///< of the first picture, see adjust.hpp
  [[nodiscard]] double fps() const { return fps_; }
  [[nodiscard]] bool has_time() const { return has_time_; }
  [[nodiscard]] std::uint64_t grabbed() const { return grabbed_; }
  [[nodiscard]] std::uint64_t announced() const { return announced_; }  ///< pictures, by the container; 0: unknown
  /// Of the picture that was grabbed, by the rule in replay.hpp.
  [[nodiscard]] std::chrono::nanoseconds time() const { return time_; }

 private:
  void open();

  std::string path_;
  std::string fault_;
  cv::VideoCapture capture_;
  cv::Mat picture_;
  int width_ = 0;
  int height_ = 0;
  PixelFormat format_ = PixelFormat::kGrey8;
  double fps_ = 0;
  bool has_time_ = false;
  std::uint64_t announced_ = 0;
  std::uint64_t grabbed_ = 0;
  double first_stamp_s_ = 0;
  std::chrono::nanoseconds time_{0};
};

/// Time of a video's picture since its first one, from the container's stamp [s] since the first one and the time of
/// the picture before: see replay.hpp.
[[nodiscard]] std::chrono::nanoseconds video_time(double stamp_s, std::chrono::nanoseconds before, double fps);

/// One video (mono), one that holds both views side by side, or two. Rules: replay.hpp.
class VideoSource final : public FrameSource {
 public:
  enum class Layout : std::uint8_t { kMono, kSideBySide, kTwoFiles };

  /// `right` is for kTwoFiles alone.
  VideoSource(std::string name, Layout layout, const std::string& left, const std::string& right,
              const ReplayOptions& options);

  [[nodiscard]] const SourceInfo& info() const noexcept override { return info_; }
  [[nodiscard]] Next next(FramePair& out) noexcept override;
  [[nodiscard]] const std::string& skip_reason() const noexcept override { return reason_; }
  void skip_to(std::uint64_t ordinal) noexcept override;

 private:
  [[nodiscard]] Next read_next(FramePair& out);
  [[nodiscard]] Next at_end(bool left, bool right);
  [[nodiscard]] Next skip(std::string reason);

  SourceInfo info_;
  Layout layout_;
  ReplayOptions options_;
  VideoFile left_;
  std::optional<VideoFile> right_;
  cv::Mat views_[2];  ///< left, right: parts of the videos' pictures
  std::uint64_t ordinal_ = 0;
  bool ended_ = false;
  std::chrono::nanoseconds time_{0};
  std::string reason_;
};

}  // namespace stereotrack::capture
