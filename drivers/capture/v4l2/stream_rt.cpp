#include <linux/videodev2.h>

#include <algorithm>
#include <cerrno>
#include <ctime>

#include "drivers/capture/v4l2/stream.hpp"

namespace stereotrack::capture::v4l2 {
namespace {

using std::chrono::nanoseconds;

nanoseconds monotonic_now() noexcept {
  timespec now{};
  ::clock_gettime(CLOCK_MONOTONIC, &now);
  return std::chrono::seconds(now.tv_sec) + nanoseconds(now.tv_nsec);
}

// By the arithmetic of whole numbers modulo 2^64: a driver whose seconds are about to come round has stamps that do not
// fit into nanoseconds of 64 bits.
nanoseconds stamp_of(const timeval& time) noexcept {
  const auto count =
      static_cast<std::uint64_t>(time.tv_sec) * 1'000'000'000U + static_cast<std::uint64_t>(time.tv_usec) * 1000U;
  return nanoseconds(static_cast<std::int64_t>(count));
}

}  // namespace

int Stream::queue(std::uint32_t index) noexcept {
  v4l2_buffer buffer{};
  std::array<v4l2_plane, 2> planes{};
  buffer.type = parts_.layout.buffer_type();
  buffer.memory = buffers_.memory_type();
  buffer.index = index;
  if (parts_.layout.planes_interface) {
    buffer.m.planes = planes.data();
    buffer.length = static_cast<std::uint32_t>(parts_.layout.format->planes);
  }
  if (buffers_.are_imported()) {
    if (!parts_.layout.planes_interface) buffer.m.fd = buffers_.descriptor(index, 0);
    // 0 bytes: all that the dma-buf has.
    for (std::size_t i = 0; i < planes.size(); ++i) planes[i].m.fd = buffers_.descriptor(index, i);
  }
  return parts_.node.ask(VIDIOC_QBUF, buffer);
}

void Stream::give_back(std::uint32_t buffer) noexcept {
  if (lost_ || buffer >= buffers_.size()) return;
  buffers_.end_read(buffer);
  counters_.give_back();
  if (queue(buffer) != 0) refused_ |= 1U << buffer;
}

void Stream::queue_again() noexcept {
  for (std::uint32_t i = 0; i < buffers_.size() && refused_ >> i != 0; ++i) {
    if ((refused_ >> i & 1U) != 0 && queue(i) == 0) refused_ &= ~(1U << i);
  }
}

bool Stream::follow_events() noexcept {
  v4l2_event event{};
  const auto follow = [&](const Device& device) {
    // As many as can have gathered: an event of each control replaces its older one.
    for (int left = 16; left > 0 && device.ask(VIDIOC_DQEVENT, event) == 0; --left) {
      if (event.type == V4L2_EVENT_SOURCE_CHANGE) return false;
      if (event.type != V4L2_EVENT_CTRL || (event.u.ctrl.changes & V4L2_EVENT_CTRL_CH_VALUE) == 0) continue;
      const bool wide = event.u.ctrl.type == V4L2_CTRL_TYPE_INTEGER64;
      if (parts_.controls.changed(event.id, wide ? event.u.ctrl.value64 : event.u.ctrl.value)) {
        const auto when = std::chrono::seconds(event.timestamp.tv_sec) + nanoseconds(event.timestamp.tv_nsec);
        in_force_.change(parts_.controls.settings(), when);
      }
    }
    return true;
  };
  if (watches_sensor_ && !follow(parts_.sensor)) return false;
  return !watches_node_ || follow(parts_.node);
}

Camera::Take Stream::lose(const char* cause, int error) noexcept {
  loss_ = cause;
  loss_error_ = error;
  lost_ = true;
  return Take::kLost;
}

// Where in its buffer the driver has put the picture this time. False: not all of it is there.
bool Stream::place_picture(const v4l2_buffer& buffer) noexcept {
  const Layout& layout = parts_.layout;
  const std::span<const std::uint8_t> memory = buffers_.memory(buffer.index);
  std::size_t skipped = 0;
  std::size_t used = buffer.bytesused;
  if (layout.planes_interface) {
    used = 0;
    for (std::size_t i = 0; i < layout.format->planes; ++i) {
      const v4l2_plane& plane = buffer.m.planes[i];
      skipped += plane.data_offset;
      used += plane.bytesused - std::min(plane.bytesused, plane.data_offset);
    }
    // Two planes lie one after the other: there is no room for anything else between.
    if (skipped != 0 && layout.format->planes == 2) return false;
  }
  if (skipped + layout.bytes > memory.size()) return false;
  pictures_[buffer.index].data = memory.data() + skipped + layout.offset();
  return used == 0 || used >= layout.bytes;  // 0: the driver does not count
}

Camera::Take Stream::take(SensorFrame& frame) noexcept {
  if (lost_) return Take::kLost;
  if (refused_ != 0) queue_again();
  if (!follow_events()) return lose("its picture's size or rate has changed", EPIPE);

  v4l2_buffer buffer{};
  std::array<v4l2_plane, VIDEO_MAX_PLANES> planes{};
  buffer.type = parts_.layout.buffer_type();
  buffer.memory = buffers_.memory_type();
  if (parts_.layout.planes_interface) {
    buffer.m.planes = planes.data();
    buffer.length = static_cast<std::uint32_t>(planes.size());
  }
  const int error = parts_.node.ask(VIDIOC_DQBUF, buffer);
  if (error == EAGAIN) return Take::kNothing;
  const nanoseconds now = monotonic_now();
  if (error != 0) return lose(error == EIO ? "its stream has broken down" : "is gone", error);
  if (buffer.index >= buffers_.size()) return lose("its driver names a buffer that there is not", EPROTO);
  buffers_.begin_read(buffer.index);

  const SequenceCount::Frame counted = sequence_.next(buffer.sequence);
  const StampLine::Stamp stamp = stamps_.next(stamp_kind_.by_arrival ? now : stamp_of(buffer.timestamp), now);
  frame.settings = in_force_.of_frame(counted.sequence, stamp.time);
  const nanoseconds exposure = frame.settings.exposure ? *frame.settings.exposure : nanoseconds(0);
  frame.mid_exposure = CaptureTime(mid_exposure(stamp.time, stamp_kind_.at, exposure, stamp_kind_.readout));
  frame.arrived = MonotonicTime(now);
  frame.sequence = counted.sequence;
  frame.buffer = buffer.index;

  frame.damaged = (buffer.flags & V4L2_BUF_FLAG_ERROR) != 0 || !place_picture(buffer);

  counters_.frame(frame.damaged, counted.lost, stamp.step);
  return Take::kFrame;
}

}  // namespace stereotrack::capture::v4l2
