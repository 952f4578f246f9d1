#pragma once

#include <chrono>
#include <cstdint>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "drivers/capture/frame_source.hpp"
#include "pipeline/geometry/rectify.hpp"
#include "pipeline/pipeline.hpp"

namespace stereotrack::render {

inline constexpr int kWidth = 320;
inline constexpr int kHeight = 240;
inline constexpr std::chrono::nanoseconds kPeriod{40'000'000};

/// A rig that is already rectified: f = 300 px, b = 0.2 units.
inline StereoCalibration rig() {
  StereoCalibration out;
  out.left = {kWidth, kHeight, 300, 300, 160, 120, LensModel::kRadtan, {}};
  out.right = out.left;
  out.t_right_left = {-0.2, 0, 0};
  return out;
}

inline capture::SourceInfo source_info(bool stereo) {
  capture::SourceInfo out;
  out.name = "scene";
  out.width = kWidth;
  out.height = kHeight;
  out.stereo = stereo;
  out.period = kPeriod;
  return out;
}

inline TrackReport track_at(std::uint32_t id, TrackState state, double x, double z) {
  TrackReport out;
  out.id = id;
  out.state = state;
  out.measured = state != TrackState::kCoasting;
  out.has_depth = true;
  out.age_s = 2;
  out.position = {x, 0, z};
  out.velocity = {0.5, 0, 0.2};
  out.covariance.topLeftCorner<3, 3>() = Eigen::Matrix3d::Identity() * 0.01;
  out.image_x = 160 + 300 * x / z;
  out.image_y = 120;
  out.image_vx = 300 * 0.5 / z;
  const int left = static_cast<int>(out.image_x) - 12;
  out.box = {left, 105, 25, 31};
  for (const Point& p : {Point{left, 105}, Point{left + 24, 110}, Point{left + 20, 135}, Point{left + 2, 130}}) {
    (void)out.hull.push(p);
  }
  return out;
}

/// A textured grey picture with one track of each state, which moves on from frame to frame.
class Scene {
 public:
  explicit Scene(bool stereo) : stereo_(stereo) {
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x)
        grey_.at<std::uint8_t>(y, x) = static_cast<std::uint8_t>(60 + (x * 3 + y * 5) % 90);
    }
  }

  void go_to(std::uint64_t ordinal) {
    const double s = 0.04 * static_cast<double>(ordinal);
    tracks_ = {track_at(1, TrackState::kConfirmed, -0.6 + 0.5 * s, 2 + 0.2 * s),
               track_at(2, TrackState::kCoasting, 0.2 + 0.5 * s, 3 + 0.2 * s),
               track_at(3, TrackState::kTentative, 0.8, 2.5)};
    mask_.setTo(cv::Scalar::all(0));
    for (TrackReport& track : tracks_) {
      track.has_depth = stereo_;
      cv::rectangle(mask_, cv::Rect(track.box.left, track.box.top, track.box.width, track.box.height),
                    cv::Scalar::all(255), cv::FILLED);
    }
    pair_.ordinal = result_.ordinal = ordinal;
    pair_.capture_time = result_.capture_time = CaptureTime(kPeriod * static_cast<std::int64_t>(ordinal));
    pair_.left = {grey_.data, kWidth, kHeight, static_cast<std::ptrdiff_t>(grey_.step), PixelFormat::kGrey8};
    result_.flags = kFlagNoColour | (stereo_ ? 0U : kFlagMono);
    result_.tracks = tracks_;
    result_.mask = {mask_.data, kWidth, kHeight, static_cast<std::ptrdiff_t>(mask_.step)};
  }

  [[nodiscard]] const FramePair& pair() const { return pair_; }
  [[nodiscard]] FrameResult& result() { return result_; }
  [[nodiscard]] std::vector<TrackReport>& tracks() { return tracks_; }

 private:
  bool stereo_;
  cv::Mat grey_ = cv::Mat(kHeight, kWidth, CV_8UC1);
  cv::Mat mask_ = cv::Mat(kHeight, kWidth, CV_8UC1);
  std::vector<TrackReport> tracks_;
  FramePair pair_;
  FrameResult result_;
};

}  // namespace stereotrack::render
