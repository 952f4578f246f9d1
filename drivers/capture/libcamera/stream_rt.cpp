#include <chrono>

#include "drivers/capture/libcamera/stream.hpp"

namespace stereotrack::capture::libcamera {

using std::chrono::nanoseconds;

Camera::Take Stream::lose(const char* cause) noexcept {
  loss_ = cause;
  return Take::kLost;
}

void Stream::give_back(std::uint32_t buffer) noexcept {
  if (loss_ != nullptr || buffer >= parts_.info.buffers) return;
  counters_.give_back();
  module_->give_back(parts_.stream.get(), buffer);
}

Camera::Take Stream::take(SensorFrame& frame) noexcept {
  if (loss_ != nullptr) return Take::kLost;
  LibcameraFrame told;
  switch (module_->take(parts_.stream.get(), &told)) {
    case kLibcameraNothing: return Take::kNothing;
    case kLibcameraTaken: break;
    default: return lose(module_->loss(parts_.stream.get()));
  }
  if (told.buffer >= parts_.info.buffers) return lose("has a buffer that there is not: build its module anew");

  frame.settings = {};
  // What the camera was told stays in force where libcamera does not tell.
  if (parts_.setup.exposure > 0) frame.settings.exposure = nanoseconds(parts_.setup.exposure);
  if (parts_.setup.gain > 0) frame.settings.gain = parts_.setup.gain;
  if ((told.known & kLibcameraKnowsExposure) != 0) frame.settings.exposure = nanoseconds(told.exposure);
  if ((told.known & kLibcameraKnowsGain) != 0) frame.settings.gain = told.gain;

  const nanoseconds exposure = frame.settings.exposure ? *frame.settings.exposure : nanoseconds(0);
  const nanoseconds before = parts_.readout + exposure;  // from the start of the exposure to the end of the frame
  nanoseconds start(told.completed_time);
  if ((told.known & kLibcameraKnowsStart) != 0) {
    start = nanoseconds(told.sensor_time);
  } else if ((told.known & kLibcameraKnowsStamp) != 0) {
    start = nanoseconds(told.buffer_time) - before;
  } else {
    start -= before;
  }
  const bool step = finder_.frame(start, nanoseconds(told.completed_time), exposure);
  offset_ns_.store(finder_.offset().count(), std::memory_order_relaxed);

  const SequenceCount::Frame counted = sequence_.next(told.sequence);
  frame.mid_exposure = CaptureTime(start + exposure / 2);
  frame.arrived = MonotonicTime(nanoseconds(told.completed_time));
  frame.sequence = counted.sequence;
  frame.buffer = told.buffer;
  frame.damaged = told.is_damaged != 0 || (told.bytes != 0 && told.bytes < bytes_);

  counters_.frame(frame.damaged, counted.lost, step);
  return Take::kFrame;
}

Camera::Counters Stream::counters() const noexcept { return counters_.get(); }

}  // namespace stereotrack::capture::libcamera
