// opencv_tracker SOURCE --calibration FILE --out tracks.csv: what an afternoon with OpenCV makes of a stereo sequence,
// to score beside ours. MOG2 or KNN, connected components, StereoSGBM's median depth in each, a Kalman filter of
// constant velocity for each target's place in the picture and its disparity, Hungarian assignment. The values are the
// usual ones, tuned on nothing; the same for every sequence.

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <exception>
#include <iostream>
#include <memory>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/video/background_segm.hpp>
#include <opencv2/video/tracking.hpp>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "config/calibration/read_calibration.hpp"
#include "drivers/capture/replay/replay.hpp"
#include "firmware-app/evaluation/assignment.hpp"

namespace {

using stereotrack::FramePair;
using stereotrack::Picture;
namespace capture = stereotrack::capture;

constexpr int kLearning = 30;             ///< frames in which the background is learnt and nothing is tracked
constexpr int kLeastArea_px = 60;         ///< of a component
constexpr int kConfirmed = 5;             ///< frames measured before a track counts
constexpr int kMostMisses = 15;           ///< frames without a measurement before it is dropped
constexpr int kTentativeMisses = 2;       ///< the same of one that does not count yet
constexpr double kGate_px = 50;           ///< from the predicted place
constexpr double kCentreNoise_px = 2;     ///< standard deviation
constexpr double kAcceleration_px = 600;  ///< [px/s^2]
constexpr int kDisparities = 128;         ///< [px], a multiple of 16
constexpr int kBlock_px = 5;

struct Detection {
  cv::Rect box;
  std::optional<double> disparity;  ///< [px]
};

cv::Point2d centre(const cv::Rect& box) { return {box.x + 0.5 * (box.width - 1), box.y + 0.5 * (box.height - 1)}; }

/// Constant velocity of (u, v, disparity): state (place, velocity).
class Target {
 public:
  Target(int id, const Detection& first) : id_(id), filter_(6, 3, 0, CV_64F), box_(first.box) {
    const cv::Point2d c = centre(first.box);
    filter_.statePost = (cv::Mat_<double>(6, 1) << c.x, c.y, first.disparity.value_or(0), 0, 0, 0);
    filter_.measurementMatrix = cv::Mat::eye(3, 6, CV_64F);
    filter_.measurementNoiseCov = cv::Mat::eye(3, 3, CV_64F) * (kCentreNoise_px * kCentreNoise_px);
    filter_.measurementNoiseCov.at<double>(2, 2) = 0.25;
    filter_.errorCovPost = cv::Mat::eye(6, 6, CV_64F) * 4.0;
    for (int i = 3; i < 6; ++i) filter_.errorCovPost.at<double>(i, i) = 1e4;
    has_disparity_ = first.disparity.has_value();
  }

  void predict(double dt) {
    filter_.transitionMatrix = cv::Mat::eye(6, 6, CV_64F);
    filter_.processNoiseCov = cv::Mat::zeros(6, 6, CV_64F);
    for (int i = 0; i < 3; ++i) {
      const double q = std::pow(i == 2 ? 0.05 * kAcceleration_px : kAcceleration_px, 2);
      filter_.transitionMatrix.at<double>(i, i + 3) = dt;
      filter_.processNoiseCov.at<double>(i, i) = q * dt * dt * dt * dt / 4;
      filter_.processNoiseCov.at<double>(i, i + 3) = q * dt * dt * dt / 2;
      filter_.processNoiseCov.at<double>(i + 3, i) = q * dt * dt * dt / 2;
      filter_.processNoiseCov.at<double>(i + 3, i + 3) = q * dt * dt;
    }
    filter_.predict();
    ++misses_;
  }

  void correct(const Detection& d) {
    const cv::Point2d c = centre(d.box);
    // Without a disparity the predicted one stands for it.
    const double disparity = d.disparity.value_or(filter_.statePre.at<double>(2));
    if (d.disparity && !has_disparity_) filter_.statePre.at<double>(2) = *d.disparity;
    has_disparity_ = has_disparity_ || d.disparity.has_value();
    filter_.correct((cv::Mat_<double>(3, 1) << c.x, c.y, disparity));
    box_ = d.box;
    misses_ = 0;
    ++hits_;
  }

  [[nodiscard]] cv::Point2d place() const { return {filter_.statePost.at<double>(0), filter_.statePost.at<double>(1)}; }
  [[nodiscard]] cv::Point2d predicted() const {
    return {filter_.statePre.at<double>(0), filter_.statePre.at<double>(1)};
  }
  [[nodiscard]] double disparity() const { return has_disparity_ ? filter_.statePost.at<double>(2) : 0.0; }
  [[nodiscard]] const cv::Rect& box() const { return box_; }
  [[nodiscard]] int id() const { return id_; }
  [[nodiscard]] bool counts() const { return hits_ + 1 >= kConfirmed; }
  [[nodiscard]] bool measured() const { return misses_ == 0; }
  [[nodiscard]] bool is_over() const { return misses_ > (counts() ? kMostMisses : kTentativeMisses); }

  std::string waiting;  ///< rows of before it counted

 private:
  int id_;
  cv::KalmanFilter filter_;
  cv::Rect box_;
  bool has_disparity_ = false;
  int misses_ = 0;
  int hits_ = 0;
};

cv::Mat view_of(const Picture& p) {
  const bool colour = p.format == stereotrack::PixelFormat::kBgr8;
  // OpenCV has no view of memory that may only be read.
  return {p.height, p.width, colour ? CV_8UC3 : CV_8UC1, const_cast<std::uint8_t*>(p.data),
          static_cast<std::size_t>(p.stride_bytes)};
}

/// For rectified pairs: synthetic ones are.
class Tracker {
 public:
  Tracker(const stereotrack::StereoCalibration& calibration, const std::string& method)
      : f_(calibration.left.fx),
        cx_(calibration.left.cx),
        cy_(calibration.left.cy),
        baseline_(-calibration.t_right_left.x()) {
    if (method == "knn") {
      background_ = cv::createBackgroundSubtractorKNN();
    } else {
      background_ = cv::createBackgroundSubtractorMOG2();
    }
    const int smooth = 8 * kBlock_px * kBlock_px;
    matcher_ = cv::StereoSGBM::create(0, kDisparities, kBlock_px, smooth, 4 * smooth, 1, 63, 10, 100, 2,
                                      cv::StereoSGBM::MODE_SGBM_3WAY);
  }

  void run(const FramePair& pair) {
    const double now_s = std::chrono::duration<double>(pair.capture_time.time_since_epoch()).count();
    const double dt = seen_ > 0 ? now_s - before_s_ : 0.0;
    before_s_ = now_s;
    const std::vector<Detection> detections = detect(view_of(pair.left), view_of(pair.right));
    if (++seen_ <= kLearning) return;
    for (Target& target : targets_) target.predict(dt);
    const std::vector<bool> used = assign(detections);
    for (std::size_t i = 0; i < detections.size(); ++i) {
      if (!used[i]) targets_.emplace_back(next_id_++, detections[i]);
    }
    for (Target& target : targets_) {
      if (!target.measured()) continue;
      std::string& rows = target.counts() ? rows_ : target.waiting;
      if (target.counts()) rows_ += std::exchange(target.waiting, {});
      rows += row(pair.ordinal, target);
    }
    std::erase_if(targets_, [](const Target& target) { return target.is_over(); });
  }

  [[nodiscard]] const std::string& rows() const { return rows_; }

 private:
  std::vector<Detection> detect(const cv::Mat& left, const cv::Mat& right) {
    background_->apply(left, mask_);
    cv::threshold(mask_, mask_, 200, 255, cv::THRESH_BINARY);  // OpenCV's shadows (127) are background
    cv::medianBlur(mask_, mask_, 5);
    cv::morphologyEx(mask_, mask_, cv::MORPH_CLOSE, cv::getStructuringElement(cv::MORPH_ELLIPSE, {7, 7}));
    if (seen_ < kLearning) return {};
    cv::Mat labels;
    cv::Mat stats;
    cv::Mat centroids;
    const int count = cv::connectedComponentsWithStats(mask_, labels, stats, centroids);
    bool any = false;
    for (int i = 1; i < count; ++i) any = any || stats.at<int>(i, cv::CC_STAT_AREA) >= kLeastArea_px;
    cv::Mat disparity;
    if (any) matcher_->compute(left, right, disparity);
    std::vector<Detection> detections;
    for (int i = 1; i < count; ++i) {
      if (stats.at<int>(i, cv::CC_STAT_AREA) < kLeastArea_px) continue;
      Detection d;
      d.box = {stats.at<int>(i, cv::CC_STAT_LEFT), stats.at<int>(i, cv::CC_STAT_TOP),
               stats.at<int>(i, cv::CC_STAT_WIDTH), stats.at<int>(i, cv::CC_STAT_HEIGHT)};
      std::vector<short> known;
      for (int y = d.box.y; y < d.box.y + d.box.height; ++y) {
        for (int x = d.box.x; x < d.box.x + d.box.width; ++x) {
          if (labels.at<int>(y, x) == i && disparity.at<short>(y, x) > 0) known.push_back(disparity.at<short>(y, x));
        }
      }
      if (!known.empty()) {
        std::nth_element(known.begin(), known.begin() + static_cast<std::ptrdiff_t>(known.size() / 2), known.end());
        d.disparity = known[known.size() / 2] / 16.0;
      }
      detections.push_back(d);
    }
    return detections;
  }

  std::vector<bool> assign(const std::vector<Detection>& detections) {
    std::vector<bool> used(detections.size(), false);
    if (targets_.empty() || detections.empty()) return used;
    Eigen::MatrixXd score(targets_.size(), detections.size());
    for (std::size_t t = 0; t < targets_.size(); ++t) {
      for (std::size_t d = 0; d < detections.size(); ++d) {
        const cv::Point2d off = centre(detections[d].box) - targets_[t].predicted();
        const double distance = std::sqrt(off.x * off.x + off.y * off.y);
        score(static_cast<Eigen::Index>(t), static_cast<Eigen::Index>(d)) = std::max(0.0, kGate_px - distance);
      }
    }
    const std::vector<int> column = stereotrack::evaluation::assign_best(score);
    for (std::size_t t = 0; t < column.size(); ++t) {
      if (column[t] < 0 || score(static_cast<Eigen::Index>(t), column[t]) <= 0) continue;
      targets_[t].correct(detections[static_cast<std::size_t>(column[t])]);
      used[static_cast<std::size_t>(column[t])] = true;
    }
    return used;
  }

  [[nodiscard]] std::string row(std::uint64_t frame, const Target& target) const {
    double x = -1;
    double y = -1;
    double z = -1;
    if (target.disparity() > 0) {
      z = f_ * baseline_ / target.disparity();
      x = (target.place().x - cx_) / f_ * z;
      y = (target.place().y - cy_) / f_ * z;
    }
    std::array<char, 200> line{};
    (void)std::snprintf(line.data(), line.size(), "%llu,%d,%d,%d,%d,%d,1,%.5f,%.5f,%.5f\n",
                        static_cast<unsigned long long>(frame), target.id(), target.box().x, target.box().y,
                        target.box().width, target.box().height, x, y, z);
    return line.data();
  }

  double f_;
  double cx_;
  double cy_;
  double baseline_;
  cv::Ptr<cv::BackgroundSubtractor> background_;
  cv::Ptr<cv::StereoSGBM> matcher_;
  cv::Mat mask_;
  std::vector<Target> targets_;
  int next_id_ = 1;
  int seen_ = 0;
  double before_s_ = 0;
  std::string rows_;
};

void track(const std::string& source_name, const std::string& calibration, const std::string& method,
           const std::string& out) {
  const auto read = stereotrack::calibration::read_calibration_file(calibration);
  const std::unique_ptr<capture::FrameSource> source = capture::open_replay(source_name, {});
  Tracker tracker(read.stereo, method);
  FramePair pair;
  for (;;) {
    const capture::Next next = source->next(pair);
    if (next == capture::Next::kEnd) break;
    if (next == capture::Next::kPair) tracker.run(pair);
  }
  std::FILE* file = std::fopen(out.c_str(), "w");
  if (file == nullptr) throw std::runtime_error(out + ": cannot be written");
  const bool written = std::fwrite(tracker.rows().data(), 1, tracker.rows().size(), file) == tracker.rows().size();
  if ((std::fclose(file) != 0) || !written) throw std::runtime_error(out + ": cannot be written");
}

}  // namespace

int main(int argc, char** argv) {
  std::string source;
  std::string calibration;
  std::string method = "mog2";
  std::string out;
  CLI::App app("Tracks of a rectified stereo sequence by OpenCV's stock parts, MOT columns.", "opencv_tracker");
  app.add_option("source", source, "folder with left/ and right/, rectified")->required();
  app.add_option("--calibration", calibration, "OpenCV calibration file")->required();
  app.add_option("--method", method, "knn or mog2")->check(CLI::IsMember({"knn", "mog2"}))->capture_default_str();
  app.add_option("--out", out, "tracks, MOT columns")->required();
  CLI11_PARSE(app, argc, argv);
  try {
    track(source, calibration, method, out);
    return 0;
  } catch (const std::exception& error) {
    std::cerr << "opencv_tracker: " << error.what() << '\n';
    return 1;
  }
}
