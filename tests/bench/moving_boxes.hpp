#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "drivers/capture/frame_source.hpp"

namespace stereotrack::bench {

/// N textured, tinted squares of 24 px that glide to and fro, each in a cell of its own, before a textured gray wall,
/// with sensor noise: what the number of objects costs, and nothing else changes. 640x480, rectified, kBgr8; the wall
/// has disparity 8, the squares 16 to 31. The first frames show the wall alone.
class MovingBoxes final : public capture::FrameSource {
 public:
  static constexpr int kWidth = 640;
  static constexpr int kHeight = 480;
  static constexpr int kMost = 64;

  /// boxes: 0..kMost. empty_frames: how many show the wall alone.
  MovingBoxes(int boxes, int empty_frames);

  [[nodiscard]] const capture::SourceInfo& info() const noexcept override { return info_; }
  [[nodiscard]] capture::Next next(FramePair& out) noexcept override;
  [[nodiscard]] const std::string& skip_reason() const noexcept override { return skip_reason_; }
  void skip_to(std::uint64_t ordinal) noexcept override { done_ = ordinal; }

  /// Of the last pair: where box i stands in the left view [px].
  [[nodiscard]] cv::Rect box(int i) const noexcept;
  [[nodiscard]] static int disparity(int i) noexcept;  ///< [px]

 private:
  void draw(cv::Mat& view, int wall_at, int boxes_shift);

  int boxes_;
  int empty_frames_;
  capture::SourceInfo info_;
  std::string skip_reason_;
  std::uint64_t done_ = 0;
  cv::Mat wall_;  ///< wider than a picture by the wall's disparity
  std::vector<cv::Mat> textures_;
  cv::Mat noise_;  ///< twice a picture's size; each view adds another part of it
  cv::RNG random_;
  cv::Mat left_, right_;
};

}  // namespace stereotrack::bench
