#pragma once

#include <atomic>
#include <cstdint>

#include "drivers/capture/libcamera/module.h"
#include "pipeline/core/queue.hpp"

namespace stereotrack::libcamera_module {

/// What three threads pass on: frames from libcamera's thread to the capture thread, buffers from there to the thread
/// that queues them again.
///
///     libcamera's thread ──push──> take (capture thread) give_back ──> wait_returned (queueing thread) ──> libcamera
///
/// Two threads more than a driver of ours has, and why: libcamera tells of a frame on its own thread, and
/// Camera::queueRequest() allocates and sends a message under a lock, which the capture thread must not.
/// Wait-free for libcamera's and the capture thread, but for one system call, which does not wait. Knows nothing of
/// libcamera.
class Handover {
 public:
  /// Throws std::system_error.
  Handover();
  Handover(const Handover&) = delete;
  Handover& operator=(const Handover&) = delete;
  ~Handover();

  // ---- libcamera's thread

  void push(const LibcameraFrame& frame) noexcept;

  // ---- Any thread

  /// There will be no more frames; the first cause counts. `cause` is a literal.
  void lose(const char* cause) noexcept;
  /// Null: it goes on.
  [[nodiscard]] const char* loss() const noexcept { return loss_.load(std::memory_order_acquire); }
  /// wait_returned() ends.
  void end() noexcept;

  // ---- Capture thread

  /// Readable while take() would not answer kLibcameraNothing.
  [[nodiscard]] int descriptor() const noexcept { return ready_; }
  /// Frames that came before a loss come before it.
  [[nodiscard]] std::int32_t take(LibcameraFrame& frame) noexcept;
  void give_back(std::uint32_t buffer) noexcept;

  // ---- Queueing thread

  /// Waits. False: end() was called.
  [[nodiscard]] bool wait_returned(std::uint32_t& buffer) noexcept;

 private:
  // Each buffer is in one place at a time, so neither is ever full.
  static constexpr std::size_t kRoom = 2UL * kLibcameraMostBuffers;

  HandoverQueue<LibcameraFrame, kRoom> frames_;
  HandoverQueue<std::uint32_t, kRoom> returned_;
  std::atomic<const char*> loss_{nullptr};
  std::atomic<bool> ended_{false};
  int ready_ = -1;   ///< counts frames that wait, and one for a loss
  int wanted_ = -1;  ///< counts buffers that were returned, and one for the end
};

}  // namespace stereotrack::libcamera_module
