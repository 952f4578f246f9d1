#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "pipeline/core/counter.hpp"

namespace stereotrack::daemon {

/// The last outputs, for the time after a fault: what the daemon had just done. One thread writes; a signal handler
/// reads, when it is too late to be exact: the newest entry may be half written.
class LastStates {
 public:
  static constexpr std::size_t kKept = 64;

  struct State {
    std::uint64_t ordinal = 0;       ///< of the pair; 0: none came
    std::int64_t due_ns = 0;         ///< on CLOCK_MONOTONIC
    std::int64_t send_error_ns = 0;  ///< sent - due
    std::uint64_t compute_max_ns = 0;
    std::uint32_t kind = 0;   ///< OutputSchedule::Kind
    std::uint32_t flags = 0;  ///< telemetry::Flag bits
    std::uint32_t targets = 0;
    std::uint32_t health = 0;  ///< telemetry::Health bits
  };

  void add(const State& state) noexcept {
    states_[count_.get() % kKept] = state;
    count_.add();
  }

  /// Calls `tell(state)` for each that is kept, oldest first.
  template <class Tell>
  void for_each(Tell&& tell) const noexcept {
    const std::uint64_t count = count_.get();
    for (std::uint64_t i = count > kKept ? count - kKept : 0; i < count; ++i) tell(states_[i % kKept]);
  }

 private:
  std::array<State, kKept> states_{};
  Counter count_;
};

}  // namespace stereotrack::daemon
