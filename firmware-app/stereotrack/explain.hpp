#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "firmware-app/render/annotation.hpp"
#include "firmware-app/stereotrack/rig.hpp"

namespace stereotrack {

/// `--explain ID`, or `--explain A:B`: of one target everything, or everything of some frames.
struct ExplainRequest {
  std::uint32_t id = 0;  ///< 0: all targets
  FrameRange frames;
};

/// Throws config::Error.
[[nodiscard]] ExplainRequest parse_explain(const std::string& text);

/// Puts what the detector and the tracker decided in a frame into words. Give observer() to the pipeline; it takes no
/// memory while the pipeline runs. One thread.
class Explanation {
 public:
  /// unit_m: metres in one unit of the calibration, 0 = not known.
  Explanation(const ExplainRequest& request, const PipelineConfig& config, double unit_m);

  [[nodiscard]] DecisionObserver observer() noexcept {
    return {&Explanation::decided, &Explanation::rejected, &Explanation::mispaired, this};
  }

  /// Before each frame.
  void frame_begins() noexcept;
  /// After it: what was asked for, line by line, and what to mark in the picture; nothing where nothing was asked for.
  /// Valid until the next frame_begins().
  [[nodiscard]] const render::Annotation& frame_ends(const FrameResult& result, double seconds);

 private:
  static void decided(void* self, const Decision& decision) noexcept;
  static void rejected(void* self, const RejectedCandidate& candidate) noexcept;
  static void mispaired(void* self, const WrongPair& pair) noexcept;
  void say(std::string line) { annotation_.lines.push_back(std::move(line)); }
  void explain_detections(const FrameResult& result);
  void explain_target(const FrameResult& result, std::uint32_t id);
  void explain_others(const FrameResult& result, std::uint32_t id, std::uint16_t taken);
  void explain_rejected();
  [[nodiscard]] std::string sentence(const Decision& decision) const;
  [[nodiscard]] std::string fate(std::uint16_t detection) const;
  [[nodiscard]] std::string length(double value) const;

  ExplainRequest request_;
  PipelineConfig config_;
  double unit_m_ = 0;
  std::vector<Decision> decisions_;
  std::vector<RejectedCandidate> rejected_;
  std::optional<WrongPair> wrong_pair_;
  std::size_t left_out_ = 0;
  Rect last_box_;
  render::Annotation annotation_;
};

}  // namespace stereotrack
