#pragma once

#include <array>
#include <cstdint>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>
#include <opencv2/video/tracking.hpp>
#include <span>
#include <vector>

namespace stereotrack::bench {

/// The calls of the composition as they are timed: each ends where the next begins.
enum class CvStep : std::uint8_t {
  kColour,      ///< cvtColor, split: gray 3.1, chroma 3.17-3.19
  kEqualise,    ///< equalizeHist of both views 3.2-3.5
  kRectify,     ///< remap of both views
  kBackground,  ///< accumulate: mean of K frames 3.7; nothing once it is learnt
  kEdges,       ///< absdiff 3.8, Sobel, magnitude 3.9-3.11, threshold 3.12
  kContours,    ///< findContours, drawContours filled
  kOpening,     ///< morphologyEx 3.13-3.15, connectedComponentsWithStats
  kLevelSet,    ///< convexHull 3.16, Chan and Vese from the hull
  kMatching,    ///< StereoBM 3.6
  kChromaTest,  ///< meanStdDev, compare 3.20-3.23, opening and components of what is left
  kDepth,       ///< undistortPoints, median disparity of each object
  kTracking,    ///< KalmanFilter 3.24-3.32, goodFeaturesToTrack, matchTemplate
};
inline constexpr std::size_t kCvSteps = 12;
[[nodiscard]] const char* to_string(CvStep step) noexcept;

/// Told when a step has ended.
struct CvObserver {
  void (*ended)(void* context, CvStep step) noexcept = nullptr;
  void* context = nullptr;
};

/// The thesis' pipeline as somebody composes it of stock OpenCV calls who knows OpenCV well: what our own is measured
/// against. Written once and then left alone: what it is measured against must not move. Where there was a choice, the
/// faster call was taken (8 bits where 8 bits do, maps of floats, one conversion for gray and chroma, the fastest
/// labelling, blobs instead of the whole picture, buffers kept between frames, four features a target where ours has
/// twelve).
///
/// In: raw pictures, kBgr8. Throws cv::Exception. One thread: call cv::setNumThreads(1).
class OpenCvPipeline {
 public:
  static constexpr int kConfirmHits = 3;  ///< detections that confirm a target

  struct Config {
    int disparities = 64;         ///< of StereoBM, a multiple of 16
    int block = 9;                ///< odd
    int background_frames = 100;  ///< K
    int edge_threshold = 90;      ///< on the Sobel magnitude [grey levels]
    int min_blob_px = 20;
    int max_blobs = 128;
    int level_set_margin_px = 8;
    int level_set_iterations = 20;
  };
  /// As OpenCV's stereoCalibrate gives it.
  struct Rig {
    cv::Size size;
    cv::Mat K1, D1, K2, D2, R, T;
  };
  struct Detection {
    cv::Rect box;          ///< raw left picture
    float disparity = -1;  ///< [px], -1 = not known
  };
  struct Feature {
    cv::KalmanFilter filter;  ///< u v, speeds
    cv::Mat patch;
  };
  struct Target {
    int id = 0;
    int hits = 0;
    int misses = 0;
    cv::Rect box;
    cv::KalmanFilter filter;  ///< u v disparity, speeds
    std::vector<Feature> features;
    cv::Point3f position;  ///< left rectified camera frame, unit of T; z <= 0 = not known
  };

  OpenCvPipeline(const Config& config, const Rig& rig, const CvObserver& observer);

  /// dt: since the last pair [s].
  void run(const cv::Mat& left_bgr, const cv::Mat& right_bgr, double dt);

  [[nodiscard]] std::span<const Target> targets() const noexcept { return targets_; }
  [[nodiscard]] const cv::Mat& mask() const noexcept { return objects_; }

 private:
  void ended(CvStep step) const noexcept {
    if (observer_.ended != nullptr) observer_.ended(observer_.context, step);
  }
  void learn_background();
  void find_edges();
  void fill_contours();
  void label(const cv::Mat& mask);
  void refine_blobs();
  void evolve(const cv::Rect& roi);
  void test_chroma();
  void measure_depth();
  void track(double dt);
  void follow_features(Target& target, double dt);
  void refill_features(Target& target);
  void associate();

  Config config_;
  CvObserver observer_;
  cv::Rect picture_;
  cv::Mat K1_, D1_, R1_, P1_;
  double focal_baseline_ = 0;
  std::array<cv::Mat, 2> left_maps_, right_maps_;
  cv::Ptr<cv::StereoBM> matcher_;
  cv::Mat kernel_;

  int learnt_ = 0;
  int next_id_ = 1;
  std::array<cv::Mat, 3> sums_, means_;  ///< Y Cr Cb

  // Buffers kept between frames; those of one blob are picture-sized and used in part.
  cv::Mat ycrcb_, right_gray_, left_canvas_, right_canvas_, disparity_;
  std::array<cv::Mat, 3> planes_;
  cv::Mat difference_, gradient_x_, gradient_y_, magnitude_, edges_, filled_, opened_, objects_;
  cv::Mat labels_, stats_, centroids_, chroma_difference_, same_blue_, same_red_;
  cv::Mat region_buffer_, phi_buffer_, feature_buffer_, score_;
  std::vector<std::vector<cv::Point>> contours_;
  std::vector<cv::Point> points_, hull_;
  std::vector<std::int16_t> depths_;
  std::vector<cv::Point2f> corners_, rectified_;
  std::vector<Detection> detections_;
  std::vector<Target> targets_;
};

}  // namespace stereotrack::bench
