#include "drivers/capture/v4l2/stream.hpp"

#include <linux/videodev2.h>

#include <cerrno>
#include <string>
#include <utility>

namespace stereotrack::capture::v4l2 {
namespace {

/// Fills what parts.info says of the readout.
StampKind stamp_kind(std::uint32_t flags, Stream::Parts& parts, std::vector<std::string>& notes) {
  StampKind kind;
  kind.by_arrival = (flags & V4L2_BUF_FLAG_TIMESTAMP_MASK) != V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC;
  const bool at_start = (flags & V4L2_BUF_FLAG_TSTAMP_SRC_MASK) == V4L2_BUF_FLAG_TSTAMP_SRC_SOE;
  kind.at = !kind.by_arrival && at_start ? StampedAt::kStartOfExposure : StampedAt::kEndOfFrame;
  if (kind.by_arrival) {
    notes.emplace_back(
        "the driver does not promise stamps of the monotonic clock: frames are stamped as they are taken, late by the "
        "time that this takes");
  }
  if (kind.at == StampedAt::kStartOfExposure) return kind;
  parts.info.readout_is_guessed = !parts.readout;
  if (parts.info.readout_is_guessed && !parts.guesses_readout) {
    refuse(parts.info.name,
           "its stamps are the ends of frames, and its driver does not tell how long the sensor takes to read one out: "
           "set camera.readout_us, from the sensor's data sheet or by stereotrack doctor; it is at most some " +
               std::to_string(parts.most_readout.count() / 1000) + " us, the shortest time between frames");
  }
  kind.readout = parts.readout.value_or(parts.most_readout);
  parts.info.readout = kind.readout;
  return kind;
}

}  // namespace

Stream::Stream(Parts parts, std::vector<std::string>& notes)
    : parts_(std::move(parts)),
      buffers_(parts_.node, parts_.layout, parts_.buffers, parts_.memory, parts_.heap, parts_.info.name),
      stamp_kind_(stamp_kind(buffers_.flags(), parts_, notes)),
      in_force_(parts_.controls.settings(), parts_.control_delay_frames) {
  parts_.info.buffers = buffers_.size();
  counters_.begin(buffers_.size());
  const Layout& layout = parts_.layout;
  for (std::uint32_t i = 0; i < buffers_.size(); ++i) {
    pictures_[i] = {buffers_.memory(i).data() + layout.offset(), layout.width, layout.height,
                    static_cast<std::ptrdiff_t>(layout.stride), layout.format->format};
  }
  watch_events();
}

Stream::~Stream() {
  if (!streaming_) return;
  int type = static_cast<int>(parts_.layout.buffer_type());
  (void)parts_.node.ask(VIDIOC_STREAMOFF, type);
}

void Stream::watch_events() {
  const auto subscribe = [](const Device& device, std::uint32_t type, std::uint32_t id) {
    v4l2_event_subscription wish{};
    wish.type = type;
    wish.id = id;
    return device.ask(VIDIOC_SUBSCRIBE_EVENT, wish) == 0;
  };
  watches_node_ = subscribe(parts_.node, V4L2_EVENT_SOURCE_CHANGE, 0);
  const Device& controls = parts_.controls_on_sensor ? parts_.sensor : parts_.node;
  bool& watched = parts_.controls_on_sensor ? watches_sensor_ : watches_node_;
  for (const std::uint32_t id : parts_.controls.watched()) {
    if (subscribe(controls, V4L2_EVENT_CTRL, id)) watched = true;
  }
}

void Stream::start() {
  const auto fail = [&](const char* what, int error) {
    std::string way_out = "plug it in again, or load its driver anew";
    if (error == EPIPE) way_out = "set the formats of all its parts alike (media-ctl -p shows them)";
    if (error == ENOSPC) way_out = "choose a smaller size or rate, or give it a bus of its own";
    if (error == EBUSY) way_out = "stop the other program that uses it";
    refuse(parts_.info.name,
           std::string(what) + " (" + error_text(error) + ", errno " + std::to_string(error) + "): " + way_out);
  };
  for (std::uint32_t i = 0; i < buffers_.size(); ++i) {
    if (const int error = queue(i); error != 0) fail("does not take its buffers", error);
  }
  int type = static_cast<int>(parts_.layout.buffer_type());
  if (const int error = parts_.node.ask(VIDIOC_STREAMON, type); error != 0) fail("does not start to stream", error);
  streaming_ = true;
}

std::string Stream::failure() const {
  if (!lost_) return {};
  const bool gone = loss_error_ == ENODEV || loss_error_ == ENXIO || loss_error_ == EINVAL;
  return "camera " + parts_.info.name + " (" + parts_.info.model + "): " + loss_ + " (" + error_text(loss_error_) +
         ", errno " + std::to_string(loss_error_) + ") after " + std::to_string(counters_.get().frames) + " frames: " +
         (gone ? "check its plug and power, dmesg tells more" : "dmesg tells what its driver found; open it anew");
}

std::optional<PeriodRange> Stream::period_range() const noexcept {
  return parts_.paces ? std::optional(parts_.paces->range()) : std::nullopt;
}

std::optional<std::chrono::nanoseconds> Stream::set_period(std::chrono::nanoseconds wanted) noexcept {
  if (!parts_.paces) return std::nullopt;
  const RowPeriod& paces = *parts_.paces;
  if (write_control(parts_.pacer, paces.blank, paces.blank_of(wanted)) != 0) return std::nullopt;
  const auto made = read_control(parts_.pacer, paces.blank.id);
  return made ? std::optional(paces.period_of(*made)) : std::nullopt;
}

Camera::Counters Stream::counters() const noexcept { return counters_.get(); }

}  // namespace stereotrack::capture::v4l2
