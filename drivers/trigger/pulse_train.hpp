#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>

#include "drivers/gpio/line.hpp"
#include "drivers/trigger/trigger.hpp"
#include "pipeline/core/counter.hpp"
#include "pipeline/core/queue.hpp"
#include "pipeline/core/result.hpp"
#include "pipeline/core/time.hpp"

namespace stereotrack::trigger {

/// Pulses on an output line, on a grid:
///
///     pulse k is due at  g_k = g_1 + (k - 1) x period      g_1: one period after the first step
///     it rises at        r_k in [g_k, g_k + late]          as early as step() is called
///     it falls at        r_k + width, or as soon after that as step() is called
///
/// A pulse that step() comes too late for is skipped, counted, and never made up for: two rises are never nearer to
/// each other than period - late. After a fall the line rests for min(width, (period - width) / 2) before it rises
/// again, so that a width that was slept over does not melt two pulses into one.
///
/// A line that refuses (its chip is gone) gives no pulse: counted as failed, and told to nobody. It is asked again with
/// the next pulse; while it refuses to fall, pulses are skipped.
///
/// What it tells is the moment right before the line was set: early by what setting takes, microseconds on a chip of
/// the processor, a millisecond on one behind I2C. Numbers count the pulses that were given.
///
///     trigger thread                                     capture thread           service thread
///     while (...) sleep until step(now)                  trigger()->take()        lines(): chips that went, metrics
///     end(now)
///
/// Pure logic but for the line: no clock, no thread. step(), end(): no heap, no lock, one system call at most for each
/// edge.
class PulseTrain {
 public:
  static constexpr std::size_t kUntold = 64;  ///< pulses that the capture thread may be behind; more are lost to it

  struct Config {
    std::chrono::nanoseconds period{0};  ///< > 0
    std::chrono::nanoseconds width{0};   ///< > 0; width + late < period
    std::chrono::nanoseconds late{0};    ///< >= 0
    bool falls = false;                  ///< the falling edge begins an exposure: its moment is told
  };

  /// Each has one writer, the thread that steps, and any number of readers.
  struct Counters {
    Counter given;
    Counter skipped;  ///< slept over, or the line had not fallen
    Counter failed;   ///< times that the line refused
  };

  /// `lines`: one line, which is safe when it is inactive. Faults: kBadConfig.
  [[nodiscard]] static Result<std::unique_ptr<PulseTrain>> create(const Config& config, gpio::OutputLines lines);
  PulseTrain(const PulseTrain&) = delete;
  PulseTrain& operator=(const PulseTrain&) = delete;
  ~PulseTrain();  ///< drives the line inactive, then lets go

  /// What was told, for who takes frames. Once; may outlive the train.
  [[nodiscard]] std::unique_ptr<Trigger> trigger();

  // ---- Trigger thread

  /// What is due is done. When to call it again; sooner does no harm.
  [[nodiscard]] MonotonicTime step(MonotonicTime now) noexcept;

  /// The line falls; the next step() begins another grid.
  void end(MonotonicTime now) noexcept;

  /// Whether the last step() raised the line, and when that was due: what oversleeping and setting are measured from.
  [[nodiscard]] bool rose() const noexcept { return rose_; }
  [[nodiscard]] MonotonicTime due() const noexcept { return due_; }
  /// The line is active: what step() waits for is the fall, which need not be punctual.
  [[nodiscard]] bool is_active() const noexcept { return active_; }

  // ---- Any thread
  [[nodiscard]] const Counters& counters() const noexcept { return counters_; }
  [[nodiscard]] const Config& config() const noexcept { return config_; }
  /// Each function of it by the thread that it says.
  [[nodiscard]] gpio::OutputLines& lines() noexcept { return lines_; }
  [[nodiscard]] const gpio::OutputLines& lines() const noexcept { return lines_; }

 private:
  using Untold = HandoverQueue<Trigger::Pulse, kUntold>;
  class Told;

  PulseTrain(const Config& config, gpio::OutputLines lines);
  void rise(MonotonicTime now) noexcept;
  void fall(MonotonicTime now) noexcept;
  void tell(MonotonicTime time) noexcept;

  Config config_;
  gpio::OutputLines lines_;
  std::shared_ptr<Untold> untold_;
  Counters counters_;
  bool begun_ = false;
  bool active_ = false;
  bool given_ = false;  ///< this pulse: the line took the rise
  bool rose_ = false;
  MonotonicTime next_{};     ///< of the grid: the next pulse that is neither given nor skipped
  MonotonicTime due_{};      ///< of the grid: the last pulse that was given
  MonotonicTime fall_at_{};  ///< while active_
  MonotonicTime rested_{};   ///< no rise before
};

}  // namespace stereotrack::trigger
