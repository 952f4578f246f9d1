#include "drivers/trigger/pulse_train.hpp"

#include <algorithm>
#include <utility>

namespace stereotrack::trigger {

/// The capture thread's end of the queue.
class PulseTrain::Told final : public Trigger {
 public:
  explicit Told(std::shared_ptr<Untold> untold) : untold_(std::move(untold)) {}
  [[nodiscard]] int descriptor() const noexcept override { return -1; }
  [[nodiscard]] bool take(Pulse& pulse) noexcept override { return untold_->pop(pulse); }
  [[nodiscard]] std::uint64_t lost() const noexcept override { return untold_->refused(); }

 private:
  std::shared_ptr<Untold> untold_;
};

Result<std::unique_ptr<PulseTrain>> PulseTrain::create(const Config& config, gpio::OutputLines lines) {
  const bool good = config.period.count() > 0 && config.width.count() > 0 && config.late.count() >= 0 &&
                    config.width + config.late < config.period && lines.size() == 1;
  if (!good) return fail(Fault::kBadConfig);
  return std::unique_ptr<PulseTrain>(new PulseTrain(config, std::move(lines)));
}

PulseTrain::PulseTrain(const Config& config, gpio::OutputLines lines)
    : config_(config), lines_(std::move(lines)), untold_(std::make_shared<Untold>()) {}

PulseTrain::~PulseTrain() = default;

std::unique_ptr<Trigger> PulseTrain::trigger() { return std::make_unique<Told>(untold_); }

void PulseTrain::tell(MonotonicTime time) noexcept { (void)untold_->push({counters_.given.get(), time}); }

void PulseTrain::rise(MonotonicTime now) noexcept {
  given_ = lines_.set(1, now).failed == 0;
  // Refused or not: who knows what the pin did.
  active_ = true;
  fall_at_ = now + config_.width;
  due_ = next_;
  next_ += config_.period;
  if (!given_) {
    counters_.failed.add();
    return;
  }
  rose_ = true;
  counters_.given.add();
  if (!config_.falls) tell(now);
}

void PulseTrain::fall(MonotonicTime now) noexcept {
  if (lines_.set(0, now).failed != 0) {
    counters_.failed.add();
    fall_at_ = now + config_.period / 4;
    return;
  }
  active_ = false;
  rested_ = now + std::min(config_.width, (config_.period - config_.width) / 2);
  if (given_ && config_.falls) tell(now);
}

MonotonicTime PulseTrain::step(MonotonicTime now) noexcept {
  rose_ = false;
  if (!begun_) {
    begun_ = true;
    next_ = now + config_.period;
    rested_ = now;
  }
  if (active_ && now >= fall_at_) fall(now);
  if (const std::chrono::nanoseconds over = now - next_ - config_.late; over.count() > 0) {
    const std::int64_t missed = (over.count() - 1) / config_.period.count() + 1;
    counters_.skipped.add(static_cast<std::uint64_t>(missed));
    next_ += config_.period * missed;
  }
  if (!active_ && now >= next_ && now >= rested_) rise(now);
  return active_ ? fall_at_ : std::max(next_, rested_);
}

void PulseTrain::end(MonotonicTime now) noexcept {
  if (lines_.set(0, now).failed != 0) counters_.failed.add();
  active_ = begun_ = rose_ = false;
}

}  // namespace stereotrack::trigger
