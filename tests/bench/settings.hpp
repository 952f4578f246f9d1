#pragma once

#include <string>
#include <vector>

#include "config/load.hpp"
#include "pipeline/geometry/calibration.hpp"

// What is measured and what is counted is the same: settings that the benchmark's programs share.
namespace stereotrack::bench {

/// Of synthetic:eleven: the act is under way.
inline constexpr std::uint64_t kFirstFrame = 60;

/// Each KEY=VALUE in turn.
[[nodiscard]] inline config::Configuration configured(const std::vector<std::string>& settings) {
  std::vector<config::Layer> layers;
  layers.reserve(settings.size());
  for (const std::string& setting : settings) layers.push_back(config::override_layer(setting));
  return config::load(layers).configuration;
}

/// The search range of both sides, for the dense map and for regions.
[[nodiscard]] inline std::vector<std::string> range_settings(int width, int disparities) {
  return {"disparity.max=" + std::to_string(disparities - 1),
          "disparity.reach=" + std::to_string(static_cast<double>(disparities) / width)};
}

/// The document's preset as far as it does not depend on the picture; its mean is learnt when the warm-up ends.
[[nodiscard]] inline std::vector<std::string> thesis_settings(int warm_up) {
  return {"preset=thesis", "disparity.mode=dense", "background.frames=" + std::to_string(warm_up)};
}

[[nodiscard]] inline std::vector<std::string> joined(std::vector<std::string> a, const std::vector<std::string>& b) {
  a.insert(a.end(), b.begin(), b.end());
  return a;
}

/// synthetic:eleven's cameras are ideal, which would make rectification copy pixels. With a lens that bends the corner
/// by a few pixels, alike in both views, both sides interpolate; rows still meet within 0.2 px.
[[nodiscard]] inline StereoCalibration with_lens(StereoCalibration calibration) {
  calibration.left.distortion[0] = calibration.right.distortion[0] = -0.01;
  return calibration;
}

}  // namespace stereotrack::bench
