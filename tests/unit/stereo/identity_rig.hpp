#pragma once

#include <cstdint>
#include <optional>
#include <random>

#include "pipeline/core/arena.hpp"
#include "pipeline/geometry/rectify.hpp"
#include "pipeline/stereo/block_matcher.hpp"

namespace stereotrack::test {

/// A rig that is rectified already, so that canvases are raw pictures, with the canvases of one pair.
class IdentityRig {
 public:
  IdentityRig(int width, int height) : width_(width), height_(height) {
    StereoCalibration calibration;
    calibration.left.width = calibration.right.width = width;
    calibration.left.height = calibration.right.height = height;
    calibration.left.fx = calibration.left.fy = calibration.right.fx = calibration.right.fy = width;
    calibration.left.cx = calibration.right.cx = 0.5 * width;
    calibration.left.cy = calibration.right.cy = 0.5 * height;
    calibration.R_right_left = Eigen::Matrix3d::Identity();
    calibration.t_right_left = Eigen::Vector3d(-1, 0, 0);
    rectifier_.emplace(*Rectifier::create(calibration, width, height, arena));
    pair = {LazyCanvas::create(rectifier_->table(View::kLeft), Sampling::kBilinear, arena),
            LazyCanvas::create(rectifier_->table(View::kRight), Sampling::kBilinear, arena)};
    left = arena.image<std::uint8_t>(width, height);
    right = arena.image<std::uint8_t>(width, height);
    map = arena.image<std::uint16_t>(width, height);
  }

  [[nodiscard]] const Rectifier& rectifier() const { return *rectifier_; }

  /// Noise on the left; on the right the same, `disparity` further left, and other noise where nothing of it falls.
  void show(int disparity, unsigned seed = 1) {
    std::mt19937 random(seed);
    for (int y = 0; y < height_; ++y) {
      for (int x = 0; x < width_; ++x) left.at(x, y) = static_cast<std::uint8_t>(random() % 256);
      for (int x = 0; x < width_; ++x) {
        right.at(x, y) = x + disparity < width_ ? left.at(x + disparity, y) : static_cast<std::uint8_t>(random() % 256);
      }
    }
    pair.left.show(left);
    pair.right.show(right);
  }

  Arena arena;
  CanvasPair pair;
  ImageView<std::uint8_t> left;
  ImageView<std::uint8_t> right;
  ImageView<std::uint16_t> map;

 private:
  int width_;
  int height_;
  std::optional<Rectifier> rectifier_;
};

}  // namespace stereotrack::test
