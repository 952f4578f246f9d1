#pragma once

#include <array>
#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>

#include "drivers/capture/camera.hpp"
#include "drivers/capture/camera_counters.hpp"
#include "drivers/capture/libcamera/clock_finder.hpp"
#include "drivers/capture/libcamera/loader.hpp"
#include "drivers/capture/libcamera/module.h"
#include "drivers/capture/sequence_count.hpp"

namespace stereotrack::capture::libcamera {

/// Closes a stream of its module.
struct StreamCloser {
  const LibcameraModule* module = nullptr;
  void operator()(LibcameraStream* stream) const { module->close(stream); }
};

/// Camera over one stream of a module. Made by open().
class Stream final : public Camera {
 public:
  struct Parts {
    std::shared_ptr<Session> session;
    std::unique_ptr<LibcameraStream, StreamCloser> stream;  ///< goes before its session
    LibcameraSetup setup{};
    CameraInfo info;
    std::chrono::nanoseconds readout{0};
    std::chrono::nanoseconds boottime_ahead{0};
  };
  /// Throws std::runtime_error, one line: its buffers do not hold what its setup says.
  explicit Stream(Parts parts);
  ~Stream() override = default;

  [[nodiscard]] const CameraInfo& info() const noexcept override { return parts_.info; }
  void start() override;
  [[nodiscard]] std::string failure() const override;

  [[nodiscard]] int descriptor() const noexcept override { return parts_.setup.descriptor; }
  [[nodiscard]] Take take(SensorFrame& frame) noexcept override;
  void give_back(std::uint32_t buffer) noexcept override;
  [[nodiscard]] Picture picture(std::uint32_t buffer) const noexcept override { return pictures_[buffer]; }

  [[nodiscard]] ClockMap clock_map() const noexcept override {
    return {CaptureTime(), MonotonicTime(std::chrono::nanoseconds(offset_ns_.load(std::memory_order_relaxed)))};
  }
  [[nodiscard]] Counters counters() const noexcept override;

  /// Capture thread: whose clock its stamps are of.
  [[nodiscard]] ClockFinder::Clock clock() const noexcept { return finder_.clock(); }

 private:
  Take lose(const char* cause) noexcept;
  void place_pictures();

  Parts parts_;
  const LibcameraModule* module_;
  std::array<Picture, kLibcameraMostBuffers> pictures_{};
  std::uint64_t bytes_ = 0;  ///< of a picture, from its first to its last

  // Capture thread's; failure() reads them after it was handed over.
  ClockFinder finder_;
  SequenceCount sequence_;
  const char* loss_ = nullptr;

  std::atomic<std::int64_t> offset_ns_{0};
  CameraCounters counters_;
};

/// Throws std::runtime_error: "camera NAME: WHAT".
[[noreturn]] void refuse(const std::string& name, const std::string& what);

}  // namespace stereotrack::capture::libcamera
