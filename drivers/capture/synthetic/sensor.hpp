#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "drivers/capture/synthetic/vec.hpp"

namespace stereotrack::capture::synthetic {

/// From light to grey levels, as a camera does it: vignetting, exposure and colour balance, a curve,
/// noise, 8 bits.
///     level = 255 (exposure gain v light)^(29/64),   v = 1 - vignetting (r / half diagonal)^2
///     noise = (sigma_luma(level) n0 + 1.9 n_channel) k,   sigma_luma^2 = 2.9^2 + 0.022 level
/// Noise n: normal, from (seed, camera, frame, pixel) alone. Its standard deviation is 3.5 to 4.1 levels in a
/// channel and 3.2 to 3.9 in the luma where k = 1. The curve is near sRGB's; its exponent is a product of square roots.
class Sensor {
 public:
  struct Config {
    std::uint64_t seed = 1;
    int camera = 0;
    int width = 0;
    int height = 0;
    Vec3 gain{1, 1, 1};  ///< red, green, blue
    double vignetting = 0.16;
    double noise = 1;  ///< k, 0 .. 8
  };

  explicit Sensor(const Config& config);

  /// One row: `light` holds width x (red, green, blue), `bgr` receives width x (blue, green, red).
  /// `exposure`: a factor on the gain.
  void expose(const float* light, int y, std::uint64_t frame, std::uint8_t* bgr, double exposure = 1.0) const noexcept;

 private:
  static constexpr int kCurveSize = 1 << 14;

  Config config_;
  std::vector<std::uint16_t> curve_;            ///< light / kCurveSize to level x 128
  std::array<std::int32_t, 256> luma_sigma_{};  ///< level to standard deviation x 128
  std::int32_t channel_sigma_ = 0;              ///< x 128
  std::vector<float> column_fall_off_;          ///< vignetting's part of x
};

}  // namespace stereotrack::capture::synthetic
