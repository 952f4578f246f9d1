#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>

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
  Put put(const FramePair& pair) noexcept {
    // The notice first: a result without one would have to wait for it.
    (void)notices_.push({pair.ordinal, pair.capture_time, pair.skew});
    bell_.ring();
    const FramePool::Claimed claimed = pool_.claim();
    if (claimed.pair == nullptr) return {};
    *claimed.pair = pair;
    pool_.publish();
    return {true, claimed.slot};
  }

  /// As FramePool::take_back().
  [[nodiscard]] bool take_back(std::uint32_t& slot) noexcept { return pool_.take_back(slot); }

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
};

}  // namespace stereotrack::capture
