#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "drivers/gpio/line.hpp"
#include "pipeline/core/bounded_vector.hpp"
#include "pipeline/core/result.hpp"
#include "pipeline/core/time.hpp"
#include "pipeline/track/track_report.hpp"
#include "pipeline/track/zone.hpp"

namespace stereotrack::signals {

inline constexpr std::size_t kMaxSignals = gpio::kMaxLines;
inline constexpr std::size_t kMaxZones = 16;

/// What a signal tells.
enum class Condition : std::uint8_t {
  kConfirmed,         ///< there is a target
  kInZone,            ///< there is one in the zone
  kDistanceBelow,     ///< one is nearer than limit_m: |position|, from the left camera's centre
  kTimeToReachBelow,  ///< one arrives in less than limit_s: |position| / closing speed along the line of sight
  kHeartbeat,         ///< the system is healthy: the line toggles
  kDeadlineMissed,    ///< the output that leaves now has no result of its own
};

/// One line's rule.
struct Signal {
  enum class Mode : std::uint8_t {
    kLevel,  ///< active as long as the condition holds
    kPulse,  ///< active for `pulse` from when the condition begins to hold
  };

  Condition when = Condition::kConfirmed;
  std::optional<std::size_t> zone;    ///< in Config::zones; kInZone needs one, the other target conditions may have
                                      ///< one: then only targets in it count
  double limit_m = 0;                 ///< kDistanceBelow
  double limit_s = 0;                 ///< kTimeToReachBelow
  Mode mode = Mode::kLevel;           ///< kHeartbeat: kLevel
  std::chrono::nanoseconds pulse{0};  ///< kPulse: > 0
  std::chrono::nanoseconds hold{0};   ///< a condition that held counts as holding for at least so long
  std::chrono::nanoseconds half_period{0};  ///< kHeartbeat: > 0, from edge to edge
  bool safe = false;                        ///< the line's state when nothing is known, at start and at stop
};

/// Which lines are active, as logic. No thread, no clock, no I/O, no heap: the time is told, and the lines are bits.
///
/// The publisher's loop, besides the schedule's:
///
///     at an output:  lines.set(rules.decide(inputs, due), ...)           inputs as predicted to `due`
///     between:       sleep no longer than next_change(); then  lines.set(rules.advance(now), ...)
///     at stop:       lines.set_safe(...)
///
/// Who counts as a target: confirmed, and coasting: its state is predicted like any, and track.coast_s bounds for how
/// long. Tentative: never.
///
/// What cannot be known is never guessed. A rule about targets takes its safe state while Inputs::tracks_known is
/// false, one that needs depth (distance, time to reach, zone in space) also while Inputs::depth_known is. Every rule
/// does when no decide() came for stale_after. A single target without depth, and a value that is not finite, fulfils
/// nothing.
///
/// In time (c the condition at each decide()):
///     held    c, or less than `hold` ago that it began to hold. A line goes active at once and stays for `hold` at
///             least; flicker shorter than that makes one activation, one pulse.
///     level   the line is `held`
///     pulse   the line is active for exactly `pulse` from each beginning of `held`; a beginning that comes while the
///             line is still active adds nothing. A second target while a first fulfils the condition does not begin
///             it.
///     heartbeat   healthy: active at once, then the other state every half_period, from the instant that was due, so
///             that lateness does not add up; after more than a half period slept over, from now. Else: its safe state.
/// The safe state comes at once, hold and pulse or not. When all is known again, what holds begins anew.
///
/// One thread. O(signals x (targets + zone corners)).
class SignalRules {
 public:
  struct Config {
    FixedVector<Zone, kMaxZones> zones;
    FixedVector<Signal, kMaxSignals> signals;  ///< signal i is bit i
    double unit_m = 0;                         ///< metres in one unit of the tracks; 0: not known
    std::chrono::nanoseconds stale_after{0};   ///< > 0
  };

  /// What is true at the instant for which decide() is called.
  struct Inputs {
    std::span<const TrackReport> tracks;  ///< predicted to that instant
    bool tracks_known = false;            ///< they come from a state young enough to be believed
    bool depth_known = false;             ///< both views are at work
    bool deadline_missed = false;
    bool healthy = false;
  };

  /// Faults: kBadConfig (metres without a unit, a zone that is not there, a limit, pulse, half_period or stale_after
  /// that is not > 0, a pulsed heartbeat, hold < 0), kNotFinite.
  [[nodiscard]] static Result<SignalRules> create(const Config& config) noexcept;

  /// The lines at an output. A time before that of the last call is taken
  /// for that of the last call.
  [[nodiscard]] gpio::LineBits decide(const Inputs& inputs, MonotonicTime now) noexcept;

  /// The lines between outputs: ends what ends, lets the heart beat, ages what nobody renews.
  [[nodiscard]] gpio::LineBits advance(MonotonicTime now) noexcept;

  /// When advance() will next have something to change; none: only decide() can.
  [[nodiscard]] std::optional<MonotonicTime> next_change() const noexcept;

  [[nodiscard]] gpio::LineBits lines() const noexcept { return lines_; }  ///< as last decided; at first the safe states
  [[nodiscard]] gpio::LineBits safe_lines() const noexcept { return safe_; }
  [[nodiscard]] std::size_t size() const noexcept { return config_.signals.size(); }

 private:
  /// One signal in time.
  struct Course {
    bool known = false;
    bool holds = false;          ///< the condition, at the last decide()
    bool active = false;         ///< pulse or heartbeat
    MonotonicTime held_until{};  ///< end of the hold
    MonotonicTime next{};        ///< end of the pulse, next edge of the heartbeat

    void follow(const Signal& signal, bool condition, MonotonicTime now) noexcept;
    void pass(const Signal& signal, MonotonicTime now) noexcept;
    [[nodiscard]] bool is_held(MonotonicTime now) const noexcept;
    [[nodiscard]] bool is_timed(const Signal& signal) const noexcept;
  };

  explicit SignalRules(const Config& config) noexcept;

  [[nodiscard]] bool needs_depth(const Signal& signal) const noexcept;
  [[nodiscard]] bool is_known(const Signal& signal, const Inputs& inputs) const noexcept;
  [[nodiscard]] bool fulfils(const Signal& signal, const TrackReport& target) const noexcept;
  [[nodiscard]] bool holds(const Signal& signal, const Inputs& inputs) const noexcept;
  [[nodiscard]] gpio::LineBits compose() noexcept;

  Config config_;
  gpio::LineBits safe_ = 0;
  gpio::LineBits lines_ = 0;
  bool fresh_ = false;       ///< a decide() came, less than stale_after ago
  MonotonicTime decided_{};  ///< when
  MonotonicTime now_{MonotonicTime::duration::min()};
  std::array<Course, kMaxSignals> courses_{};
};

}  // namespace stereotrack::signals
