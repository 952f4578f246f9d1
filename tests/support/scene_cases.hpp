#pragma once

#include <array>
#include <cstdint>
#include <ostream>
#include <string>
#include <vector>

#include "config/load.hpp"
#include "pipeline/pipeline_config.hpp"
#include "tests/support/moving_scene.hpp"

namespace stereotrack::test {

enum class SceneMatching : std::uint8_t { kMono, kRegions, kDense };

/// One way to run the moving scene.
struct SceneCase {
  const char* preset;
  const SceneFormat* format;
  SceneMatching matching;

  [[nodiscard]] bool stereo() const { return matching != SceneMatching::kMono; }
  [[nodiscard]] bool is_robust() const { return std::string(preset) == "robust"; }
  [[nodiscard]] std::string name() const {
    constexpr std::array kMatchings{"mono", "regions", "dense"};
    return std::string(preset) + "_" + format->name + "_" + kMatchings[static_cast<std::size_t>(matching)];
  }
};
inline void PrintTo(const SceneCase& one, std::ostream* out) { *out << one.name(); }

/// Each preset, source format and way of matching; formats that differ from others in ingest alone once, and some of
/// them only for who wants every format.
[[nodiscard]] inline std::vector<SceneCase> scene_cases(bool every_format = false) {
  std::vector<SceneCase> cases;
  for (const char* preset : {"robust", "thesis"}) {
    for (const SceneFormat& format : kSceneFormats) {
      if (format.runs != SceneRuns::kEach) continue;
      for (const SceneMatching matching : {SceneMatching::kMono, SceneMatching::kRegions, SceneMatching::kDense}) {
        cases.push_back({preset, &format, matching});
      }
    }
  }
  for (const SceneFormat& format : kSceneFormats) {
    const bool once = format.runs == SceneRuns::kOne || (every_format && format.runs == SceneRuns::kNone);
    if (once) cases.push_back({"robust", &format, SceneMatching::kRegions});
  }
  return cases;
}

[[nodiscard]] inline PipelineConfig scene_config(const SceneCase& one) {
  const std::string mode = one.matching == SceneMatching::kDense ? "dense" : "regions";
  const std::vector<config::Layer> layers{config::override_layer(std::string("preset=") + one.preset),
                                          config::override_layer("disparity.mode=" + mode),
                                          config::override_layer("disparity.max=48")};
  return config::load(layers).configuration.pipeline;
}

}  // namespace stereotrack::test
