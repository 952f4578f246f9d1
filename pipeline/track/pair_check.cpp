#include "pipeline/track/pair_check.hpp"

#include <algorithm>

#include "pipeline/core/bounded_vector.hpp"
#include "pipeline/core/square.hpp"

namespace stereotrack {

namespace {

constexpr double kMostCost = 25;
constexpr double kSure = 16;
constexpr double kSureAlone = 22;
constexpr double kStillSure = 3;
constexpr double kModelVariance_px2 = 0.2;
constexpr double kLeastWay_px = 0.5;  // a period
constexpr double kLeastOverlap = 0.5;
constexpr double kBelievedFor_s = 0.5;
constexpr double kPeriodGrowth = 1.01;  // a frame: a rate that was lowered is followed within a second or two
constexpr std::size_t kMostWitnesses = 64;

struct Witness {
  double residual;  // [px]
  double speed;     // in the right picture [px/s]
  double reach;     // Prediction::disparity_reach [px]
  double variance;  // [px^2]
};

const Detection* find_detection(const Prediction& target, std::span<const Detection> detections) noexcept {
  const Detection* best = nullptr;
  double most = kLeastOverlap;
  for (const Detection& detection : detections) {
    const double common = overlap(target.box, detection.box);
    if (common < most) continue;
    most = common;
    best = &detection;
  }
  return best;
}

}  // namespace

PairCheck::Verdict PairCheck::run(std::span<const Prediction> predictions, std::span<const Detection> detections,
                                  double dt) noexcept {
  Verdict verdict;
  if (!(dt > 0)) return verdict;
  period_s_ = period_s_ > 0 ? std::min(dt, kPeriodGrowth * period_s_) : dt;
  FixedVector<Witness, kMostWitnesses> witnesses;
  for (const Prediction& target : predictions) {
    const double speed = target.vx - target.disparity_rate;
    if (!target.confirmed || !target.has_depth || speed * speed * square(period_s_) < square(kLeastWay_px)) continue;
    const Detection* detection = find_detection(target, detections);
    if (detection == nullptr || !detection->has_depth || is_blind(detection->box, target.disparity)) continue;
    const double variance = square(detection->disparity_sd) + square(target.disparity_sd) + kModelVariance_px2;
    (void)witnesses.push({detection->disparity - target.disparity, speed, target.disparity_reach, variance});
  }
  // One alone may have turned, and shows another part of its surface.
  const bool alone = witnesses.size() == 1;
  for (Witness& w : witnesses) w.variance += square((alone ? 0.5 : 0.25) * w.reach);
  const auto cost = [&](double lag) {
    double sum = 0;
    for (const Witness& w : witnesses) sum += std::min(square(w.residual + w.speed * lag) / w.variance, kMostCost);
    return sum;
  };
  verdict.witnesses = static_cast<int>(witnesses.size());
  double least = cost(0) - (wrong_for_s_ > 0 ? kStillSure : alone ? kSureAlone : kSure);
  for (const double lag : {period_s_, -period_s_}) {
    const double here = cost(lag);
    if (!(here < least)) continue;
    least = here;
    verdict.lag_s = lag;
    verdict.wrong = true;
  }
  wrong_for_s_ = verdict.wrong ? wrong_for_s_ + dt : 0;
  if (wrong_for_s_ > kBelievedFor_s) verdict.wrong = false;
  return verdict;
}

}  // namespace stereotrack
