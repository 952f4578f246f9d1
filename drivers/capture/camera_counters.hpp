#pragma once

#include <cstddef>
#include <cstdint>

#include "drivers/capture/camera.hpp"
#include "pipeline/core/counter.hpp"

namespace stereotrack::capture {

/// Camera::Counters as a driver keeps them: one writer, the capture thread; any thread reads.
class CameraCounters {
 public:
  /// Before the first: how many buffers there are.
  void begin(std::size_t buffers) noexcept { buffers_ = buffers; }
  /// One was taken. lost: frames between the last one and it; step: of the camera's clock.
  void frame(bool damaged, std::uint64_t lost, bool step) noexcept {
    frames_.add();
    damaged_.add(damaged ? 1 : 0);
    lost_.add(lost);
    late_.add(were_all_leased_ ? lost : 0);
    steps_.add(step ? 1 : 0);
    were_all_leased_ = ++leased_ == buffers_;
  }
  /// One that was taken has its buffer back.
  void give_back() noexcept { --leased_; }

  [[nodiscard]] Camera::Counters get() const noexcept {
    Camera::Counters now;
    now.frames = frames_.get();
    now.damaged = damaged_.get();
    now.lost = lost_.get();
    now.late = late_.get();
    now.steps = steps_.get();
    return now;
  }

 private:
  Counter frames_;
  Counter damaged_;
  Counter lost_;
  Counter late_;
  Counter steps_;
  // The writer's.
  std::size_t buffers_ = 0;
  std::size_t leased_ = 0;
  bool were_all_leased_ = false;  ///< with the last frame
};

}  // namespace stereotrack::capture
