#pragma once

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <cstdint>
#include <cstring>
#include <memory>
#include <string>
#include <vector>

#include "drivers/capture/stereo_cameras/stereo_cameras.hpp"
#include "tests/support/scripted_camera.hpp"

namespace stereotrack::test {

inline constexpr std::chrono::nanoseconds kFramePeriod = std::chrono::milliseconds(40);

/// Simulated time of the source under test.
inline std::atomic<std::int64_t> simulated_ns{0};
inline MonotonicTime simulated_now() noexcept { return MonotonicTime(std::chrono::nanoseconds(simulated_ns.load())); }

[[nodiscard]] inline capture::CameraInfo camera_info(const char* name, bool counts_lost, std::size_t buffers = 8) {
  return {.name = name,
          .model = "scripted",
          .width = 16,
          .height = 4,
          .format = PixelFormat::kGrey8,
          .period = kFramePeriod,
          .buffers = buffers,
          .counts_lost = counts_lost};
}

/// Pulses of a script, for who asks whenever a frame comes.
class ScriptedTrigger final : public trigger::Trigger {
 public:
  void give(std::uint64_t number, std::chrono::nanoseconds time) { waiting_.push_back({number, MonotonicTime(time)}); }
  [[nodiscard]] int descriptor() const noexcept override { return -1; }
  [[nodiscard]] bool take(Pulse& pulse) noexcept override {
    if (told_ == waiting_.size()) return false;
    pulse = waiting_[told_++];
    return true;
  }

 private:
  std::vector<Pulse> waiting_;
  std::size_t told_ = 0;
};

/// The number that the picture's pixels bear; 0 and a failure: they do not agree.
[[nodiscard]] inline std::uint64_t number_of(const Picture& picture) {
  std::uint64_t first = 0;
  std::memcpy(&first, picture.data, 8);
  for (int y = 0; y < picture.height; ++y) {
    for (int x = 0; x + 8 <= picture.width; x += 8) {
      std::uint64_t here = 0;
      std::memcpy(&here, picture.row(y) + x, 8);
      if (here == first) continue;
      ADD_FAILURE() << "a picture of two exposures, " << first << " and " << here;
      return 0;
    }
  }
  return first;
}

/// Two sensors, the source over them, and what stands behind it in the daemon.
struct CameraRig {
  explicit CameraRig(const capture::StereoCameras::Config& wanted, bool counts_lost = false, std::size_t slots = 4,
                     std::size_t buffers = 8)
      : left(camera_info("left-device", counts_lost, buffers)),
        right(camera_info("right-device", counts_lost, buffers)),
        pool(slots),
        outlet(pool, notices, bell),
        config(wanted) {}

  void open() {
    cameras = std::make_unique<capture::StereoCameras>(
        [this](trigger::Side side) { return std::make_unique<ScriptedCamera>(sensor(side)); }, config);
  }
  /// The trigger belongs to the source.
  ScriptedTrigger& open_with_trigger() {
    auto trigger = std::make_unique<ScriptedTrigger>();
    ScriptedTrigger& pulses = *trigger;
    cameras = std::make_unique<capture::StereoCameras>(
        [this](trigger::Side side) { return std::make_unique<ScriptedCamera>(sensor(side)); }, config,
        std::move(trigger));
    return pulses;
  }
  SensorScript& sensor(trigger::Side side) { return side == trigger::Side::kLeft ? left : right; }

  /// A step that waits for nothing.
  void step() { (void)cameras->step(outlet, config.now != nullptr ? config.now() : MonotonicTime()); }

  /// Both expose number n, whole; the right one `skew` later.
  void expose_both(std::uint64_t n, std::chrono::nanoseconds skew = {}) {
    const std::chrono::nanoseconds time = kFramePeriod * static_cast<std::int64_t>(n);
    (void)left.expose({.number = n, .time = time, .sequence = n});
    (void)right.expose({.number = n, .time = time + skew, .sequence = n});
  }

  void advance(std::chrono::nanoseconds by) { simulated_ns.fetch_add(by.count()); }

  /// What the service would log.
  std::vector<capture::SourceNote> tend() {
    std::vector<capture::SourceNote> notes;
    cameras->tend(notes);
    return notes;
  }

  SensorScript left;
  SensorScript right;
  capture::FramePool pool;
  capture::PairOutlet::Notices notices;
  capture::Doorbell bell;
  capture::PairOutlet outlet;
  capture::StereoCameras::Config config;
  std::unique_ptr<capture::StereoCameras> cameras;
};

}  // namespace stereotrack::test
