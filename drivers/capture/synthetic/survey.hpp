#pragma once

#include <span>
#include <vector>

#include "drivers/capture/synthetic/scene.hpp"

namespace stereotrack::capture::synthetic {

/// What a cast will look like in the left picture, found with few rays (a 160 x 120 picture, five a
/// second): for scenes that draw their paths and must keep what they promise.
struct SurveyDetail {
  double step_s = 0.2;         ///< from one picture to the next
  double hidden_share = 0.75;  ///< of what lies in the picture
};
struct Survey {
  struct PerActor {
    double largest_px = 0;         ///< visible area, at 640 x 480
    double seconds_seen = 0;       ///< with anything visible
    double hidden_s = 0;           ///< in the picture, but with more than SurveyDetail::hidden_share hidden
    double longest_hidden_s = 0;   ///< the longest of these times without a break
    double longest_hidden_at = 0;  ///< when that one ended [s]
  };
  std::vector<PerActor> actors;  ///< as in the cast
  int occlusions = 0;            ///< times that an actor hid a quarter or more of another, each once
  int pairs = 0;                 ///< how many different pairs that were
  int most_in_view = 0;          ///< actors of which a quarter or more of what lies in the picture is visible, at once
};
[[nodiscard]] Survey survey(const Scene& scene, std::span<const Actor> cast, double from_s, double to_s,
                            const SurveyDetail& detail = {});

/// True when `actor` on its way comes nearer than `gap_m` to an actor of `others` or to something that
/// stands still (but the floor, which is the scene's first shape).
[[nodiscard]] bool collides(const Scene& scene, const Actor& actor, std::span<const Actor> others, double gap_m);

}  // namespace stereotrack::capture::synthetic
