#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "drivers/capture/camera.hpp"
#include "drivers/capture/doorbell.hpp"
#include "drivers/capture/frame_pool.hpp"
#include "drivers/capture/frame_source.hpp"
#include "pipeline/core/queue.hpp"
#include "pipeline/core/time.hpp"

namespace stereotrack::capture {

/// What the publisher is told of a pair before the pipeline has seen it.
struct PairNotice {
  std::uint64_t ordinal = 0;
  CaptureTime capture_time{};
  std::optional<std::chrono::nanoseconds> skew;  ///< FramePair::skew
  SensorSettings left{};                         ///< what it was exposed with, as far as the driver tells
  SensorSettings right{};                        ///< likewise; nothing of a pair in mono
};

/// A line of a source for the log: of a change of its state, once.
struct SourceNote {
  enum class Weight : std::uint8_t { kNotice, kWarning, kError };
  Weight weight = Weight::kNotice;
  const char* cause = "";   ///< STEREOTRACK_CAUSE
  const char* camera = "";  ///< "left", "right"; empty: both, or none
  std::string text;
};

/// One camera of a source, since the start, whichever device it was.
struct CameraFigures {
  bool silent = false;       ///< now: it gives no frames, or is gone
  std::uint64_t frames = 0;  ///< Camera::Counters, the four
  std::uint64_t damaged = 0;
  std::uint64_t lost = 0;
  std::uint64_t late = 0;
  std::uint64_t losses = 0;         ///< times that it was gone, or silent alone
  std::uint64_t reopened = 0;       ///< times that another was opened in its place
  std::uint64_t open_failures = 0;  ///< times that none could be
  std::uint64_t missed = 0;         ///< trigger::PulseMatcher::Counters, these three
  std::uint64_t doubled = 0;
  std::uint64_t stray = 0;
  bool astray = false;            ///< now: frames come, and answer no pulse of the trigger
  std::uint64_t strayings = 0;    ///< times that it was astray alone
  std::uint64_t back_off_ms = 0;  ///< now: between two attempts; 0: none is wanted
};

/// Whether the right camera's rate follows the left one's.
enum class Steering : std::uint8_t {
  kOff,          ///< nobody wants it, or one of the two is not there
  kCannot,       ///< its driver cannot
  kMeasuring,    ///< the drift is not known yet
  kApproaching,  ///< it does, and they are not together yet
  kLocked,
  kGivenUp,  ///< its driver takes what is asked and does not do it, or refuses
};

/// What a source of cameras counts; a film counts nothing.
struct SourceFigures {
  bool of_cameras = false;
  std::array<CameraFigures, 2> cameras;  ///< left, right
  std::uint64_t paired = 0;              ///< trigger::Pairer::Counters, these nine
  std::uint64_t missing_left = 0;
  std::uint64_t missing_right = 0;
  std::uint64_t late = 0;
  std::uint64_t out_of_order = 0;
  std::uint64_t duplicate = 0;
  std::uint64_t disagreed = 0;
  std::uint64_t clock_steps = 0;
  std::uint64_t waiting_high = 0;
  bool has_trigger = false;                       ///< pulses are told
  bool trigger_silent = false;                    ///< now: frames come, and no pulses
  bool trigger_unanswered = false;                ///< now: frames come, and neither camera's answer a pulse
  std::uint64_t pulses = 0;                       ///< number of the last one
  std::uint64_t pulses_lost = 0;                  ///< known to have been, and not told
  std::uint64_t mono_pairs = 0;                   ///< put with an empty right picture
  std::uint64_t notes_lost = 0;                   ///< changes of state that the log lacks
  std::optional<std::chrono::nanoseconds> phase;  ///< by how much the right exposes later, within half a period
  std::optional<double> drift;                    ///< of the phase [s/s]
  Steering steering = Steering::kOff;             ///< now
  std::optional<std::chrono::nanoseconds> steered_period;  ///< that the right camera is set to now
};

/// Where a live source puts its pairs. The capture thread's side of the pool and of the notices.
class PairOutlet {
 public:
  static constexpr std::size_t kNotices = 64;
  using Notices = HandoverQueue<PairNotice, kNotices>;

  /// `bell` wakes the publisher. All must outlive the outlet.
  PairOutlet(FramePool& pool, Notices& notices, Doorbell& bell) noexcept
      : pool_(pool), notices_(notices), bell_(bell) {}

  /// The publisher is told of the pair, then it waits for the frame loop. Its pixels stay untouched until the slot's
  /// number comes back from take_back(), or from a later put(). False: the frame loop holds all slots, the pair was
  /// dropped and is counted by the pool; its slot in time leaves as predicted.
  struct Put {
    bool waits = false;
    std::uint32_t slot = 0;  ///< that holds the pair now: what it named before is the source's again
  };
  Put put(const FramePair& pair, const SensorSettings& left = {}, const SensorSettings& right = {}) noexcept {
    // The notice first: a result without one would have to wait for it.
    (void)notices_.push({pair.ordinal, pair.capture_time, pair.skew, left, right});
    bell_.ring();
    const FramePool::Claimed claimed = pool_.claim();
    if (claimed.pair == nullptr) return {};
    *claimed.pair = pair;
    pool_.publish();
    return {true, claimed.slot};
  }

  /// As FramePool::take_back().
  [[nodiscard]] bool take_back(std::uint32_t& slot) noexcept { return pool_.take_back(slot); }

  /// Most pairs that are out at once.
  [[nodiscard]] std::size_t slots() const noexcept { return pool_.slots(); }

 private:
  FramePool& pool_;
  Notices& notices_;
  Doorbell& bell_;
};

/// Pairs as time goes by: cameras, or a film. Made and started by the main thread, where it may throw
/// std::runtime_error with one line naming the device and the way out; step() belongs to the capture thread.
class LiveSource {
 public:
  enum class Step : std::uint8_t {
    kGoing,
    kEnded,   ///< there will be no more pairs, as was asked for
    kFailed,  ///< there will be none, for a reason: failure()
  };

  LiveSource() = default;
  LiveSource(const LiveSource&) = delete;
  LiveSource& operator=(const LiveSource&) = delete;
  virtual ~LiveSource() = default;

  [[nodiscard]] virtual const SourceInfo& info() const noexcept = 0;

  /// Waits for frames until `until` at the latest and puts the pairs that they make. Sleeps only in the kernel, for the
  /// device or the moment; takes no lock and no heap.
  [[nodiscard]] virtual Step step(PairOutlet& outlet, MonotonicTime until) noexcept = 0;

  /// Where capture times lie on the monotonic clock, measured now. Any thread.
  [[nodiscard]] virtual ClockMap clock_map() const noexcept = 0;

  /// After kFailed: one line naming the device and the way out.
  [[nodiscard]] virtual const std::string& failure() const noexcept = 0;

  /// Service thread, about every 0.1 s while the capture thread runs: what waits or takes memory, such as opening a
  /// device anew. May take the time that one device needs for that; throws nothing. Adds to `notes` what the log is to
  /// say.
  virtual void tend(std::vector<SourceNote>& notes) { (void)notes; }

  /// Any thread. Each figure is right by itself.
  [[nodiscard]] virtual SourceFigures figures() const noexcept { return {}; }
};

}  // namespace stereotrack::capture
