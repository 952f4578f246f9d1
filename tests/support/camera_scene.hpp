#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <memory>
#include <thread>
#include <utility>
#include <vector>

#include "drivers/capture/stereo_cameras/stereo_cameras.hpp"
#include "tests/support/moving_scene.hpp"
#include "tests/support/scripted_camera.hpp"

namespace stereotrack::test {

/// MovingScene before two cameras that a thread exposes in real time; the test unplugs them and plugs them in.
/// Outlives the source over them.
class CameraScene {
 public:
  using Side = trigger::Side;

  CameraScene(const SceneFormat& format, std::chrono::nanoseconds period)
      : format_(format),
        period_(period),
        left_(info("left-device", format, period)),
        right_(info("right-device", format, period)) {}
  CameraScene(const CameraScene&) = delete;
  CameraScene& operator=(const CameraScene&) = delete;
  ~CameraScene() { stop(); }

  /// The source, and frames from now on, from that one of the scene on.
  [[nodiscard]] std::unique_ptr<capture::StereoCameras> open(int first) {
    auto source = make({});
    thread_ = std::thread([this, first] { expose(first); });
    return source;
  }
  /// The same with frames that are exposed when `pulses` ask for them, exactly kDelay after, however late threads are.
  [[nodiscard]] std::unique_ptr<capture::StereoCameras> open_triggered(int first,
                                                                       std::unique_ptr<trigger::Trigger> pulses) {
    auto relay = std::make_unique<Relay>();
    Relay& told = *relay;
    auto source = make(std::move(relay));
    pulses_ = std::move(pulses);
    thread_ = std::thread([this, first, &told] { answer(first, told); });
    return source;
  }
  /// Ends the thread that exposes: before the source, where it was opened triggered.
  void stop() {
    stop_.store(true);
    if (thread_.joinable()) thread_.join();
  }
  /// The next pulse finds the right camera asleep.
  void miss_one() { misses_.store(true); }

  /// The trigger's wire to that camera is off: it runs free, and exposes when no pulse asks for it.
  void unwire(Side side, bool is_off) { unwired_[static_cast<std::size_t>(side)].store(is_off); }

  void unplug(Side side) {
    sensor(side).refuse(sensor(side).info().name + ": is not there");
    sensor(side).lose();
  }
  void plug_in(Side side) { sensor(side).refuse(""); }
  void set_skew(std::chrono::nanoseconds skew) { skew_ns_.store(skew.count()); }
  /// Frames bear times that much later than when they are exposed.
  void set_ahead(std::chrono::nanoseconds ahead) { ahead_ns_.store(ahead.count()); }
  void set_right_exposure(std::chrono::nanoseconds exposure) { right_exposure_ns_.store(exposure.count()); }
  static constexpr std::chrono::nanoseconds kDelay = std::chrono::microseconds(300);
  static constexpr std::chrono::nanoseconds kLeftExposure = std::chrono::milliseconds(4);

  [[nodiscard]] SensorScript& sensor(Side side) { return side == Side::kLeft ? left_ : right_; }

 private:
  /// Pulses to the capture thread, and then their frames.
  class Relay final : public trigger::Trigger {
   public:
    void tell(const Pulse& pulse) { (void)queue_.push(pulse); }
    [[nodiscard]] int descriptor() const noexcept override { return -1; }
    [[nodiscard]] bool take(Pulse& pulse) noexcept override { return queue_.pop(pulse); }

   private:
    HandoverQueue<Pulse, 64> queue_;
  };

  [[nodiscard]] std::unique_ptr<capture::StereoCameras> make(std::unique_ptr<trigger::Trigger> trigger) {
    capture::StereoCameras::Config config;
    config.timeout = std::chrono::milliseconds(300);
    config.back_off_first = std::chrono::milliseconds(50);
    config.pulse_delay = kDelay;
    return std::make_unique<capture::StereoCameras>(
        [this](Side side) { return std::make_unique<ScriptedCamera>(sensor(side)); }, config, std::move(trigger));
  }

  static capture::CameraInfo info(const char* name, const SceneFormat& format, std::chrono::nanoseconds period) {
    return {.name = name,
            .model = "scripted",
            .width = MovingScene::kWidth,
            .height = MovingScene::kHeight,
            .format = format.format,
            .period = period,
            .buffers = 8,
            .counts_lost = true};
  }

  void expose(int first) {
    MovingScene scene(format_);
    const auto begin = std::chrono::steady_clock::now();
    for (int i = 1; !stop_.load(); ++i) {
      const auto moment = begin + period_ * i;
      std::this_thread::sleep_until(moment);
      show(scene, first, i, moment.time_since_epoch(), true);
    }
  }

  void answer(int first, Relay& told) {
    MovingScene scene(format_);
    trigger::Trigger::Pulse pulse;
    for (int i = 1; !stop_.load();) {
      if (!pulses_->take(pulse)) {
        std::this_thread::sleep_for(std::chrono::microseconds(500));
        continue;
      }
      told.tell(pulse);
      // A frame comes once its exposure is over: none whose time is still to come leaves on time ("camera_ahead").
      const auto begun = pulse.time.time_since_epoch() + kDelay;
      std::this_thread::sleep_until(std::chrono::steady_clock::time_point(begun + kLeftExposure));
      show(scene, first, i++, begun + kLeftExposure / 2, !misses_.exchange(false));
    }
  }

  /// The i-th exposure, from 1, whose middle is at `time`.
  void show(MovingScene& scene, int first, int i, std::chrono::nanoseconds time, bool with_right) {
    time += std::chrono::nanoseconds(ahead_ns_.load());
    const int frame = (first + i - 2) % MovingScene::kFrames + 1;
    const FramePair pair = scene.pair(frame, true);
    const auto number = static_cast<std::uint64_t>(i);
    const auto paint = [](const Picture& picture) {
      return [&picture](std::uint8_t* pixels, std::uint64_t) {
        std::copy_n(picture.data, picture_bytes(picture.format, picture.width, picture.height), pixels);
      };
    };
    const auto ahead = [&](Side side) {
      return unwired_[static_cast<std::size_t>(side)].load() ? -period_ / 2 : std::chrono::nanoseconds(0);
    };
    (void)left_.expose(
        {.number = number, .time = time + ahead(Side::kLeft), .sequence = number, .settings = {kLeftExposure, 1.0F}},
        paint(pair.left));
    if (!with_right) return;
    (void)right_.expose({.number = number,
                         .time = time + ahead(Side::kRight) + std::chrono::nanoseconds(skew_ns_.load()),
                         .sequence = number,
                         .settings = {std::chrono::nanoseconds(right_exposure_ns_.load()), 1.0F}},
                        paint(pair.right));
  }

  const SceneFormat& format_;
  std::chrono::nanoseconds period_;
  SensorScript left_;
  SensorScript right_;
  std::atomic<bool> stop_{false};
  std::atomic<std::int64_t> skew_ns_{0};
  std::atomic<std::int64_t> ahead_ns_{0};
  std::atomic<std::int64_t> right_exposure_ns_{kLeftExposure.count()};
  std::atomic<bool> misses_{false};
  std::array<std::atomic<bool>, 2> unwired_{};
  std::unique_ptr<trigger::Trigger> pulses_;
  std::thread thread_;
};

}  // namespace stereotrack::test
