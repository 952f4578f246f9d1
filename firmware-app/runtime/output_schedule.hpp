#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "pipeline/core/result.hpp"
#include "pipeline/core/time.hpp"

namespace stereotrack::runtime {

/// What leaves when: the latency contract, as logic. No thread, no sleep, no clock: the time is told.
///
///     The pair exposed at t has a slot, which leaves at  t + L  (monotonic time; t through the ClockMap).
///
/// The publisher's loop:
///
///     sleep until next_wake(), or until there is a notice or a result: then notice(), result(), next_wake() again
///     at next_wake():  take what has come, then  while (output = decide(now))  predict to output->due, encode,
///     sleep until output->due, send
///
/// A slot leaves as one of
///     kOnTime     with the pair's own result
///     kPredicted  its own result is not there at due - lead: the last state is predicted instead, and flagged
///     kMissing    no pair came: the slot is where the period puts it, a period after the last; flagged; at most
///                 missing_limit in a row, then status_only() until the next pair
/// at most once, in the order of their times, and never later than due + grace.
///
/// What happens when (each a test of that name in tests/unit/runtime):
/// * late result: its slot left as kPredicted; the result then only updates the state.
/// * superseded result, the frame loop passed over this pair: kPredicted from the newer state.
/// * late notice, its slot left as kMissing, or t + L has passed: it leaves no more; the cadence takes its phase.
/// * notice out of order: refused; its slot leaves as kMissing.
/// * capture clock steps: stamps from the future, or older than a period over L, are not believed. The cadence goes on
///   in monotonic time, as kMissing, and map_is_suspect() asks for a new ClockMap. A smaller step moves the outputs by
///   as much until the owner measures anew, which it does every second.
/// * process suspended: slots overslept by more than grace are dropped and counted, none is sent in a burst.
/// * L under the pipeline: all slots are kPredicted from the state of the pair or two before.
/// * L of several periods: several slots in flight, each with its own result.
///
/// Payloads (targets, covariances) stay with the caller, in an array of kKeeps: result() says where a payload belongs,
/// an output says which to take. One thread. No memory but its own. O(kMaxInFlight) a call.
class OutputSchedule {
 public:
  static constexpr std::size_t kMaxInFlight = 32;
  static constexpr std::size_t kKeeps = kMaxInFlight + 2;

  struct Config {
    std::chrono::nanoseconds latency{0};       ///< L, > 0, at most kMaxInFlight / 2 periods
    std::chrono::nanoseconds period{0};        ///< nominal time between pairs, > 0
    std::chrono::nanoseconds lead{0};          ///< from decision to leaving, 0 <= lead < L
    std::chrono::nanoseconds grace{0};         ///< how late a slot may still leave, 0 <= grace < period
    std::chrono::nanoseconds oldest_state{0};  ///< no state is predicted further from its capture, >= L
    int missing_limit = 0;                     ///< kMissing in a row, >= 1
  };

  enum class Kind : std::uint8_t { kOnTime, kPredicted, kMissing };

  /// What to predict from.
  struct State {
    std::uint64_t ordinal = 0;
    CaptureTime capture_time{};
    std::chrono::nanoseconds ahead{0};  ///< from its capture to `due`: predict over this
    std::size_t keep = 0;               ///< whose payload; valid until the next result()
  };

  struct Output {
    Kind kind = Kind::kMissing;
    std::uint64_t ordinal = 0;   ///< of the pair; 0: kMissing
    MonotonicTime captured{};    ///< t; of kMissing: where the period puts it
    MonotonicTime due{};         ///< t + L
    bool superseded = false;     ///< kPredicted from the state of a later pair
    bool after_due = false;      ///< decided after `due`, within grace: send at once, and flag it
    std::optional<State> state;  ///< none: nothing is known, or nothing young enough: no targets leave
  };

  /// Since the start. Each slot is counted once where it ends, in one of the first six.
  struct Counters {
    std::uint64_t on_time = 0;
    std::uint64_t predicted_late = 0;        ///< kPredicted: the result had not come
    std::uint64_t predicted_superseded = 0;  ///< kPredicted: a later pair's result had
    std::uint64_t missing = 0;
    std::uint64_t overslept_pairs = 0;    ///< slots of pairs that nobody decided in time
    std::uint64_t overslept_missing = 0;  ///< slots of the period likewise
    std::uint64_t after_due = 0;          ///< of those that left: later than t + L
    std::uint64_t without_state = 0;      ///< of those that left: nothing to predict from
    std::uint64_t outages = 0;            ///< times that missing_limit was reached
    std::uint64_t late_results = 0;
    std::uint64_t stale_results = 0;  ///< older than the state there is: of no use
    std::uint64_t late_notices = 0;
    std::uint64_t notices_out_of_order = 0;  ///< ordinal or time did not rise
    std::uint64_t from_future = 0;           ///< notices and results with a stamp later than their arrival
    std::uint64_t from_past = 0;             ///< notices older than a period over L
    std::uint64_t refused = 0;               ///< notices for which there was no room
  };

  /// Faults: kBadConfig.
  [[nodiscard]] static Result<OutputSchedule> create(const Config& config, const ClockMap& map) noexcept;

  /// The pairer has formed a pair. Ordinals rise.
  void notice(std::uint64_t ordinal, CaptureTime capture_time, MonotonicTime now) noexcept;

  /// The pipeline has done a pair. Where its payload is to be kept; none: it is of no use any more.
  [[nodiscard]] std::optional<std::size_t> result(std::uint64_t ordinal, CaptureTime capture_time,
                                                  MonotonicTime arrival) noexcept;

  /// When to call decide(): the next slot's due - lead. None: no slot is to come until a notice does.
  [[nodiscard]] std::optional<MonotonicTime> next_wake() const noexcept;

  /// The next slot that is to be prepared at this time; none: none yet. Drops what was overslept.
  [[nodiscard]] std::optional<Output> decide(MonotonicTime now) noexcept;

  /// No pair has come yet, or none for missing_limit slots: only status leaves.
  [[nodiscard]] bool status_only() const noexcept { return !anchored_ || missing_run_ >= config_.missing_limit; }

  /// Stamps came that the map cannot be right about. The owner measures it anew.
  [[nodiscard]] bool map_is_suspect() const noexcept { return map_is_suspect_; }
  void set_map(const ClockMap& map) noexcept;

  /// The pairs' rate has changed, from the next slot on. Faults: kBadConfig, nothing changed.
  [[nodiscard]] Result<void> set_period(std::chrono::nanoseconds period) noexcept;

  /// The source begins anew: ordinals, slots and state are forgotten, counters go on.
  void restart() noexcept;

  [[nodiscard]] const Counters& counters() const noexcept { return counters_; }
  [[nodiscard]] std::size_t in_flight() const noexcept { return pending_count_; }

 private:
  OutputSchedule(const Config& config, const ClockMap& map) noexcept : config_(config), map_(map) {}

  struct Slot {
    std::uint64_t ordinal = 0;  ///< 0: from the period
    MonotonicTime captured{};
  };
  /// A result whose payload the caller keeps.
  struct Kept {
    std::uint64_t ordinal = 0;  ///< 0: none
    CaptureTime capture_time{};
    MonotonicTime captured{};
  };

  [[nodiscard]] std::optional<Slot> next_slot() const noexcept;
  [[nodiscard]] bool is_pending(std::uint64_t ordinal) const noexcept;
  [[nodiscard]] std::size_t find_kept(std::uint64_t ordinal) const noexcept;
  [[nodiscard]] std::size_t room_for_result() const noexcept;
  [[nodiscard]] std::optional<State> state_of(std::size_t keep, MonotonicTime due) const noexcept;
  [[nodiscard]] bool is_told(const Slot& slot) const noexcept;
  [[nodiscard]] MonotonicTime captured_of(std::uint64_t ordinal) const noexcept;
  void drop_overslept(MonotonicTime now) noexcept;
  void take_phase(MonotonicTime captured, MonotonicTime now) noexcept;
  void consume(const Slot& slot) noexcept;
  [[nodiscard]] Output compose(const Slot& slot, MonotonicTime now) noexcept;

  Config config_;
  ClockMap map_;
  bool map_is_suspect_ = false;
  Counters counters_;

  std::array<Slot, kMaxInFlight> pending_{};  ///< of pairs, oldest first
  std::size_t pending_count_ = 0;
  std::uint64_t noticed_ = 0;  ///< newest ordinal noticed, refused ones too
  std::uint64_t decided_ = 0;  ///< newest ordinal whose slot has ended

  bool anchored_ = false;  ///< last_ means something
  MonotonicTime last_{};   ///< capture of the last slot that ended: the period counts from here
  bool last_was_missing_ = false;
  int missing_run_ = 0;

  std::array<Kept, kKeeps> kept_{};
  std::size_t newest_ = kKeeps;  ///< in kept_; kKeeps: no result yet
};

}  // namespace stereotrack::runtime
