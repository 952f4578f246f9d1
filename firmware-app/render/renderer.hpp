#pragma once

#include <memory>
#include <string>
#include <vector>

#include "drivers/capture/frame_source.hpp"
#include "firmware-app/render/annotation.hpp"
#include "firmware-app/render/zones.hpp"
#include "pipeline/pipeline.hpp"

namespace stereotrack::render {

/// Draws frames for people: the left picture with hulls, ids, distance, velocity arrows and trails, and a top
/// view of the tracks beside it.
class Renderer {
 public:
  Renderer() = default;
  Renderer(const Renderer&) = delete;
  Renderer& operator=(const Renderer&) = delete;
  virtual ~Renderer() = default;

  /// Throws std::runtime_error with one line naming the file (disk full).
  /// `annotation`: what is said of the frame beside its targets; null for nothing.
  virtual void draw(const FramePair& pair, const FrameResult& result, const Annotation* annotation) = 0;

  /// Makes what was drawn whole under its name. Without it nothing that looks whole stays.
  virtual void commit() = 0;
};

/// target: FILE.mp4 (or .avi, .mkv): a video; any other name: a folder that receives %06d.png.
/// rectifier: null for mono. zones: drawn, too. unit_m: metres in one unit of the calibration, 0 = not known.
/// Throws std::runtime_error with one line naming the target and the way out.
[[nodiscard]] std::unique_ptr<Renderer> make_renderer(const std::string& target, const capture::SourceInfo& info,
                                                      const Rectifier* rectifier, double unit_m,
                                                      std::vector<ShownZone> zones = {});

}  // namespace stereotrack::render
