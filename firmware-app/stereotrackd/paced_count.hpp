#pragma once

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <optional>

#include "pipeline/core/time.hpp"

namespace stereotrack::daemon {

/// When the log is told of what a counter counts: at once, then after waits that double up to kLongestWait for as long
/// as it goes on, so that a fault which lasts a night does not fill the journal. Nothing is left out: each time all
/// that was not told yet. Pure logic.
class PacedCount {
 public:
  static constexpr std::chrono::seconds kFirstWait{1};
  static constexpr std::chrono::seconds kLongestWait{600};
  static constexpr std::chrono::seconds kQuiet{60};  ///< without a count: what waits is told, and the next at once

  struct Told {
    std::uint64_t count = 0;          ///< > 0
    std::chrono::nanoseconds span{};  ///< in which they were counted
  };

  /// `total`: of the counter, which never falls; asked about once a second. `last`: what waits is told now.
  [[nodiscard]] std::optional<Told> tell(std::uint64_t total, MonotonicTime now, bool last = false) noexcept {
    if (total != seen_) counted_ = now;
    seen_ = total;
    if (now - counted_ >= kQuiet) wait_ = std::chrono::nanoseconds{0};
    if (total == told_) {
      since_ = now;
      return std::nullopt;
    }
    if (now - told_at_ < wait_ && !last) return std::nullopt;
    const Told told{total - told_, since_ ? now - *since_ : kFirstWait};
    told_ = total;
    since_ = told_at_ = now;
    wait_ = std::clamp<std::chrono::nanoseconds>(2 * wait_, kFirstWait, kLongestWait);
    return told;
  }

 private:
  std::uint64_t seen_ = 0;
  std::uint64_t told_ = 0;
  std::optional<MonotonicTime> since_;  ///< nothing waited to be told
  MonotonicTime counted_{};             ///< it rose last
  MonotonicTime told_at_{};
  std::chrono::nanoseconds wait_{0};
};

}  // namespace stereotrack::daemon
