#include "firmware-app/runtime/effort.hpp"

#include <algorithm>

namespace stereotrack::runtime {

namespace {

std::size_t index(Effort effort) noexcept { return static_cast<std::size_t>(effort); }

}  // namespace

Result<EffortController> EffortController::create(const Config& config) noexcept {
  EffortBits named = 0;
  for (const Effort effort : config.order) {
    if (index(effort) >= kEfforts || (named & bit_of(effort)) != 0) return fail(Fault::kBadConfig);
    named = static_cast<EffortBits>(named | bit_of(effort));
  }
  const bool good = config.restore_below > 0 && config.restore_below < config.shed_above && config.shed_above <= 1 &&
                    config.shed_after >= 1 && config.restore_after >= 1 && config.patience_most >= config.restore_after;
  if (!good) return fail(Fault::kBadConfig);
  return EffortController(config);
}

EffortBits EffortController::shed() const noexcept {
  EffortBits bits = 0;
  for (std::size_t i = 0; i < level_; ++i) bits = static_cast<EffortBits>(bits | bit_of(config_.order[i]));
  return bits;
}

void EffortController::shed_one() noexcept {
  heavy_ = 0;
  light_ = 0;
  if (on_trial_) {
    on_trial_ = false;
    ++counters_.failed_trials;
    patience_ = patience_ > config_.patience_most / 2 ? config_.patience_most : 2 * patience_;
  }
  if (level_ == config_.order.size()) return;
  ++counters_.sheds[index(config_.order[level_])];
  ++level_;
}

void EffortController::restore_one() noexcept {
  heavy_ = 0;
  light_ = 0;
  if (on_trial_) patience_ = config_.restore_after;  // the one before is settled: this row began behind it
  --level_;
  ++counters_.restores[index(config_.order[level_])];
  on_trial_ = true;
  trial_ = 0;
}

EffortBits EffortController::next(std::chrono::nanoseconds compute, std::chrono::nanoseconds budget) noexcept {
  const auto spent = static_cast<double>(compute.count());
  const auto whole = static_cast<double>(budget.count());
  const bool overrun = budget.count() <= 0 || compute > budget;
  heavy_ = overrun || spent > config_.shed_above * whole ? heavy_ + 1 : 0;
  light_ = !overrun && spent < config_.restore_below * whole ? std::min(light_ + 1, patience_) : 0;
  if (on_trial_ && ++trial_ > patience_) {
    on_trial_ = false;
    patience_ = config_.restore_after;
    light_ = std::min(light_, patience_);
  }
  if (overrun) {
    ++counters_.overruns;
    if (level_ == config_.order.size()) ++counters_.helpless;
  }
  if (overrun || heavy_ >= config_.shed_after) {
    shed_one();
  } else if (level_ > 0 && light_ >= patience_) {
    restore_one();
  }
  for (std::size_t i = 0; i < level_; ++i) ++counters_.frames[index(config_.order[i])];
  return shed();
}

}  // namespace stereotrack::runtime
