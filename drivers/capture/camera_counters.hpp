#pragma once

#include <cstdint>

#include "drivers/capture/camera.hpp"
#include "pipeline/core/counter.hpp"

namespace stereotrack::capture {

/// Camera::Counters as a driver keeps them: one writer, the capture thread; any thread reads.
class CameraCounters {
 public:
  /// One was taken. lost: frames between the last one and it; step: of the camera's clock.
  void frame(bool damaged, std::uint64_t lost, bool step) noexcept {
    frames_.add();
    damaged_.add(damaged ? 1 : 0);
    lost_.add(lost);
    steps_.add(step ? 1 : 0);
  }

  [[nodiscard]] Camera::Counters get() const noexcept {
    Camera::Counters now;
    now.frames = frames_.get();
    now.damaged = damaged_.get();
    now.lost = lost_.get();
    now.steps = steps_.get();
    return now;
  }

 private:
  Counter frames_;
  Counter damaged_;
  Counter lost_;
  Counter steps_;
};

}  // namespace stereotrack::capture
