#include "drivers/capture/stereo_cameras/phase.hpp"

#include <algorithm>
#include <cmath>

namespace stereotrack::capture {

namespace {

/// Of the first `count`, which it reorders; count > 0.
template <std::size_t N>
double median(std::array<double, N>& values, std::size_t count) noexcept {
  auto* const middle = values.data() + count / 2;
  std::nth_element(values.data(), middle, values.data() + count);
  return *middle;
}

}  // namespace

double PhaseEstimator::folded(double distance_s) const noexcept {
  const double period = to_seconds(period_);
  return distance_s - period * std::floor(distance_s / period + 0.5);
}

std::optional<PhaseEstimator::Latest> PhaseEstimator::latest() const noexcept {
  if (seconds_count_ == 0) return std::nullopt;
  const Second& last = seconds_[seconds_count_ - 1];
  return Latest{last.time, std::chrono::nanoseconds(std::llround(folded(last.distance_s) * 1e9))};
}

void PhaseEstimator::restart() noexcept {
  count_ = 0;
  seconds_count_ = 0;
  phase_.reset();
  drift_.reset();
}

void PhaseEstimator::add(CaptureTime time, std::chrono::nanoseconds distance) noexcept {
  if (count_ > 0 && time < last_) restart();
  if (count_ > 0 && time - began_ >= std::chrono::seconds(1)) end_second();
  if (count_ == 0) began_ = time;
  last_ = time;
  if (count_ == kInOne) return;
  // About the first of the second, so that what lies at the fold is not torn apart.
  const double first = count_ == 0 ? 0 : distances_[0];
  distances_[count_++] = first + folded(to_seconds(distance) - first);
}

void PhaseEstimator::end_second() noexcept {
  if (seconds_count_ == kSeconds) {
    std::copy(seconds_.begin() + 1, seconds_.end(), seconds_.begin());
    --seconds_count_;
  }
  const double before = seconds_count_ == 0 ? 0 : seconds_[seconds_count_ - 1].distance_s;
  const double middle = median(distances_, count_);
  seconds_[seconds_count_++] = {began_ + (last_ - began_) / 2, before + folded(middle - before)};
  count_ = 0;
  estimate();
}

void PhaseEstimator::estimate() noexcept {
  double drift = 0;
  if (seconds_count_ >= kLeast) {
    std::array<double, kSeconds*(kSeconds - 1) / 2> slopes;  // all that are read are written below
    std::size_t count = 0;
    for (std::size_t k = 0; k < seconds_count_; ++k) {
      for (std::size_t l = k + 1; l < seconds_count_; ++l) {
        const double span = seconds_between(seconds_[k].time, seconds_[l].time);
        if (span > 0) slopes[count++] = (seconds_[l].distance_s - seconds_[k].distance_s) / span;
      }
    }
    if (count > 0) drift_ = drift = median(slopes, count);
  }
  std::array<double, kSeconds> now{};
  const CaptureTime newest = seconds_[seconds_count_ - 1].time;
  for (std::size_t k = 0; k < seconds_count_; ++k) {
    now[k] = seconds_[k].distance_s + drift * seconds_between(seconds_[k].time, newest);
  }
  phase_ = std::chrono::nanoseconds(std::llround(folded(median(now, seconds_count_)) * 1e9));
}

}  // namespace stereotrack::capture
