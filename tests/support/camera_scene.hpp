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
  ~CameraScene() {
    stop_.store(true);
    if (thread_.joinable()) thread_.join();
  }

  /// The source, and frames from now on, from that one of the scene on.
  [[nodiscard]] std::unique_ptr<capture::StereoCameras> open(int first) {
    capture::StereoCameras::Config config;
    config.timeout = std::chrono::milliseconds(300);
    config.back_off_first = std::chrono::milliseconds(50);
    auto source = std::make_unique<capture::StereoCameras>(
        [this](Side side) { return std::make_unique<ScriptedCamera>(sensor(side)); }, config);
    thread_ = std::thread([this, first] { expose(first); });
    return source;
  }

  void unplug(Side side) {
    sensor(side).refuse(sensor(side).info().name + ": is not there");
    sensor(side).lose();
  }
  void plug_in(Side side) { sensor(side).refuse(""); }
  void set_skew(std::chrono::nanoseconds skew) { skew_ns_.store(skew.count()); }
  void set_right_exposure(std::chrono::nanoseconds exposure) { right_exposure_ns_.store(exposure.count()); }
  static constexpr std::chrono::nanoseconds kLeftExposure = std::chrono::milliseconds(4);

  [[nodiscard]] SensorScript& sensor(Side side) { return side == Side::kLeft ? left_ : right_; }

 private:
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
      const int frame = (first + i - 2) % MovingScene::kFrames + 1;
      const FramePair pair = scene.pair(frame, true);
      const std::chrono::nanoseconds time = moment.time_since_epoch();
      const auto number = static_cast<std::uint64_t>(i);
      const auto show = [](const Picture& picture) {
        return [&picture](std::uint8_t* pixels, std::uint64_t) {
          std::copy_n(picture.data, picture_bytes(picture.format, picture.width, picture.height), pixels);
        };
      };
      (void)left_.expose({.number = number, .time = time, .sequence = number, .settings = {kLeftExposure, 1.0F}},
                         show(pair.left));
      (void)right_.expose({.number = number,
                           .time = time + std::chrono::nanoseconds(skew_ns_.load()),
                           .sequence = number,
                           .settings = {std::chrono::nanoseconds(right_exposure_ns_.load()), 1.0F}},
                          show(pair.right));
    }
  }

  const SceneFormat& format_;
  std::chrono::nanoseconds period_;
  SensorScript left_;
  SensorScript right_;
  std::atomic<bool> stop_{false};
  std::atomic<std::int64_t> skew_ns_{0};
  std::atomic<std::int64_t> right_exposure_ns_{kLeftExposure.count()};
  std::thread thread_;
};

}  // namespace stereotrack::test
