#pragma once

#include <cstdint>
#include <span>

#include "pipeline/core/stage.hpp"
#include "pipeline/track/detection.hpp"

namespace stereotrack {

/// Whether both pictures of a pair show one instant, told by what moves in them: time stamps may agree where a driver
/// or a cable has lost a frame.
///
/// A right picture that was taken tau after the left one shows a target further along its way, and its disparity
/// x_l - x_r is off by -v_r tau, v_r its speed in the right picture along the rows. Over the confirmed targets i with
/// residuals r_i = d_i - d'_i (measured, predicted) each lag tau of -1, 0, 1 period costs
///     C(tau) = sum_i min((r_i + v_i tau)^2 / s_i^2, 25)
///     s_i^2 = sd(d_i)^2 + sd(d'_i)^2 + (reach_i / 4)^2 + 0.2 px^2    (reach_i / 2 of one alone)
/// The pair is wrong if a lag costs less than none by 16, by 22 where one target alone tells, by 3 where the pair
/// before was wrong, too: one target that moves by 4 px a frame tells, or several slower ones. Nothing that stands
/// still does.
///
/// Half a second of wrong pairs in a row are believed; after that it is the targets that have changed.
/// One thread. O(targets x detections).
class PairCheck {
 public:
  struct Verdict {
    bool wrong = false;
    double lag_s = 0;   ///< the right picture was taken so much later than the left one [s]
    int witnesses = 0;  ///< targets that moved enough to tell
  };

  /// Predictions and detections of this pair, dt since the pair before [s].
  [[nodiscard]] Verdict run(std::span<const Prediction> predictions, std::span<const Detection> detections,
                            double dt) noexcept;

  /// What crosses frames: pipeline/core/state.hpp.
  template <class Self, class Archive>
  static void visit_state(Self& self, Archive& archive) noexcept {
    archive(self.period_s_, self.wrong_for_s_);
  }

 private:
  double period_s_ = 0;  ///< the shortest time between pairs lately; 0 = not known yet
  double wrong_for_s_ = 0;
};
static_assert(RealTimeStage<PairCheck, &PairCheck::run>);

}  // namespace stereotrack
