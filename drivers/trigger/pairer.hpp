#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "pipeline/core/bounded_vector.hpp"
#include "pipeline/core/result.hpp"
#include "pipeline/core/time.hpp"

namespace stereotrack::trigger {

enum class Side : std::uint8_t { kLeft, kRight };

/// One sensor's frame, before it has a partner. Its pixels are the driver's.
struct SideFrame {
  CaptureTime mid_exposure{};  ///< middle of the exposure; both sensors are stamped by one clock
  std::uint64_t sequence = 0;  ///< the sensor's own count, frames that were lost counted; see Config::sequenced
  std::uint32_t buffer = 0;    ///< the driver's name for it, handed back as it is
};

enum class Verdict : std::uint8_t {
  kPaired,
  kNoPartner,   ///< the other side has gone on without it, there was no room to wait, or the wait was given up
  kLate,        ///< its partner was given up before it came
  kOutOfOrder,  ///< older than what its own side has delivered
  kDuplicate,   ///< the time, or the sequence, of its own side's last frame
  kClockStep,   ///< it waited when the clock went back
  kDisagreed,   ///< fits by time, not by sequence: or nothing is known of the sequences yet
};

/// A frame, or two, whose matter is settled: a pair to process, or buffers to requeue.
struct Settled {
  Verdict verdict = Verdict::kNoPartner;
  /// From 1: pairs, and frames that had no partner or disagreed, in the order of their times: a pair's ordinal counts
  /// those that were missing before it. 0: a frame that had no place of its own (late, out of order, duplicate, step).
  std::uint64_t ordinal = 0;
  std::optional<SideFrame> left;
  std::optional<SideFrame> right;

  /// Of a pair.
  [[nodiscard]] std::chrono::nanoseconds skew() const noexcept {
    return left && right ? right->mid_exposure - left->mid_exposure : std::chrono::nanoseconds(0);
  }
};

/// Forms pairs of what two sensors deliver, each in its own order, the two in any interleaving.
///
///     pair:  |t_right - t_left| <= tolerance x period     and, of several, the closest
///
/// As each side is in order, a frame whose time the other side has passed will never find its partner, so only one side
/// ever waits. A left is not paired with a wrong right as long as skew and jitter together stay under
/// (1 - tolerance) x period: a neighbour is then out of reach, whatever is lost.
///
/// When the clock steps, stamps of before and after do not compare:
/// * forward by S: frames from before are S plus at least a period away, so nothing wrong fits; it looks like a gap;
/// * back by more than kStepPeriods: seen; what waits is handed back and both sides start anew (seen twice if a frame
///   from before it comes later from the other side);
/// * back by less: frames are out of order until the stamps have caught up;
/// * back by whole periods just when the other side loses frames: a right from before can carry the time of a left from
///   after. Times cannot tell; sequences can. With `sequenced`, left and right must keep the difference of
///   their sequences, too. What fits by time and not by sequence is handed back with all that waits, until kRelearn
///   such fits in a row agree on a new difference (a sensor was restarted, or it does not count what it loses). That is
///   one more than a step of kStepPeriods can feign. The first difference is learnt in the same way from kLearn fits,
///   so a run hands back its first kLearn - 1 pairs.
///
/// Pure logic: no clock, no thread, no memory but its own (kMaxWaiting frames). O(kMaxWaiting) a frame.
class Pairer {
 public:
  static constexpr std::size_t kMaxWaiting = 8;
  static constexpr int kStepPeriods = 4;
  static constexpr int kLearn = 3;
  static constexpr int kRelearn = kStepPeriods + 2;

  struct Config {
    std::chrono::nanoseconds period{0};  ///< nominal time between pairs, > 0
    double tolerance = 0.25;             ///< of the period, above 0 and at most 0.5
    bool sequenced = false;              ///< SideFrame::sequence means something
  };
  using Outcome = FixedVector<Settled, kMaxWaiting + 1>;

  /// Since the start.
  struct Counters {
    std::uint64_t paired = 0;
    std::uint64_t missing_left = 0;   ///< rights without a left
    std::uint64_t missing_right = 0;  ///< lefts without a right
    std::uint64_t late = 0;
    std::uint64_t out_of_order = 0;
    std::uint64_t duplicate = 0;
    std::uint64_t disagreed = 0;     ///< fits by time that the sequences refused
    std::uint64_t clock_steps = 0;   ///< back; the other side may see it, too
    std::uint64_t waiting_high = 0;  ///< most frames that waited at once
  };

  /// Faults: kBadConfig.
  [[nodiscard]] static Result<Pairer> create(const Config& config) noexcept;

  /// A frame has come. What that settles, in the order of the times; valid until the next call. Each frame that comes
  /// in goes out exactly once, in this call or a later one.
  [[nodiscard]] const Outcome& push(Side side, const SideFrame& frame) noexcept;

  /// Gives up on frames from before `time`: for a caller that sees one side silent. Partners that still come are late.
  [[nodiscard]] const Outcome& give_up_before(CaptureTime time) noexcept;

  /// Hands back all that waits, and forgets times and sequences: sensors stop or start anew. Counters and ordinals go
  /// on.
  [[nodiscard]] const Outcome& restart() noexcept;

  /// The sensors' rate has changed, from the next frame on. Faults: kBadConfig, nothing changed.
  [[nodiscard]] Result<void> set_period(std::chrono::nanoseconds period) noexcept;

  /// Another sensor may count otherwise. With restart(), before its first frame.
  void set_sequenced(bool sequenced) noexcept { config_.sequenced = sequenced; }

  [[nodiscard]] const Counters& counters() const noexcept { return counters_; }
  [[nodiscard]] std::size_t waiting() const noexcept { return waiting_count_; }

 private:
  explicit Pairer(const Config& config) noexcept;

  struct Last {
    CaptureTime time{};
    std::uint64_t sequence = 0;
  };

  void settle(Verdict verdict, Side side, const SideFrame& frame) noexcept;
  void settle_fit(const SideFrame& left, const SideFrame& right) noexcept;
  void settle_oldest(Verdict verdict) noexcept;
  void hand_back_waiting(Verdict verdict) noexcept;
  [[nodiscard]] bool is_in_order(Side side, const SideFrame& frame) noexcept;
  [[nodiscard]] bool sequences_agree(const SideFrame& left, const SideFrame& right) noexcept;
  void wait(Side side, const SideFrame& frame) noexcept;

  Config config_;
  std::chrono::nanoseconds tolerance_{0};
  Counters counters_;
  std::uint64_t ordinal_ = 0;
  Outcome outcome_;

  std::array<std::optional<Last>, 2> last_;           ///< by side: newest frame that came
  std::array<std::optional<CaptureTime>, 2> closed_;  ///< by side: newest partner that was given up waiting for it

  Side waiting_side_ = Side::kLeft;
  std::array<SideFrame, kMaxWaiting> waiting_{};  ///< oldest first
  std::size_t waiting_count_ = 0;

  std::optional<std::int64_t> difference_;  ///< of the sequences, left - right
  std::int64_t candidate_ = 0;
  int agreed_ = 0;  ///< fits in a row that had candidate_
};

}  // namespace stereotrack::trigger
