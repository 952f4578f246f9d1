#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <type_traits>

#include "pipeline/pipeline.hpp"

namespace stereotrack::test {

/// Everything that leaves Pipeline::run, as bytes: equal results and no others give equal ones.
class ResultBytes {
 public:
  [[nodiscard]] static std::string of(const FrameResult& result) {
    ResultBytes bytes;
    bytes.add(result.ordinal);
    bytes.add(result.capture_time.time_since_epoch().count());
    bytes.add(result.flags);
    bytes.add(result.hulls_reduced);
    for (const std::uint32_t count : result.rejections) bytes.add(count);
    bytes.add_picture(result.mask);
    bytes.add_picture(result.labels);
    for (const TrackReport& track : result.tracks) bytes.add_track(track);
    for (const Detection& detection : result.detections) bytes.add_detection(detection);
    return bytes.text_;
  }

 private:
  template <class T>
  void add(const T& value) {
    static_assert(std::is_arithmetic_v<T> || std::is_enum_v<T>);
    text_.append(reinterpret_cast<const char*>(&value), sizeof value);
  }
  void add_box(const Rect& box) {
    for (const int side : {box.left, box.top, box.width, box.height}) add(side);
  }
  template <class Points>
  void add_points(const Points& points) {
    add(points.size());
    for (const Point& point : points) {
      add(point.x);
      add(point.y);
    }
  }
  template <class Matrix>
  void add_matrix(const Matrix& matrix) {
    for (Eigen::Index i = 0; i < matrix.size(); ++i) add(matrix.data()[i]);
  }
  template <class T>
  void add_picture(const ImageView<T>& picture) {
    for (int y = 0; y < picture.height; ++y) {
      text_.append(reinterpret_cast<const char*>(picture.row(y)), sizeof(T) * static_cast<std::size_t>(picture.width));
    }
  }
  void add_track(const TrackReport& track) {
    add(track.id);
    add(track.state);
    add(track.measured);
    add(track.has_depth);
    add_box(track.box);
    add_points(track.hull);
    for (const double value :
         {track.image_x, track.image_y, track.image_vx, track.image_vy, track.confidence, track.age_s}) {
      add(value);
    }
    add_matrix(track.position);
    add_matrix(track.velocity);
    add_matrix(track.covariance);
  }
  void add_detection(const Detection& detection) {
    add_box(detection.box);
    add_points(detection.hull);
    add(detection.area);
    add(detection.has_depth);
    for (const double value :
         {detection.disparity, detection.disparity_sd, detection.disparity_reach, detection.strength}) {
      add(value);
    }
    add_matrix(detection.position);
    add_matrix(detection.position_covariance);
    add(detection.whole);
    add(detection.region);
  }

  std::string text_;
};

}  // namespace stereotrack::test
