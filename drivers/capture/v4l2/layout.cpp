#include "drivers/capture/v4l2/layout.hpp"

#include <linux/videodev2.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numeric>

namespace stereotrack::capture::v4l2 {
namespace {

/// v4l2_format of either interface, with the fields that both have.
struct Format {
  v4l2_format raw{};

  explicit Format(bool planes) { raw.type = planes ? V4L2_BUF_TYPE_VIDEO_CAPTURE_MPLANE : V4L2_BUF_TYPE_VIDEO_CAPTURE; }
  [[nodiscard]] bool planes() const { return raw.type == V4L2_BUF_TYPE_VIDEO_CAPTURE_MPLANE; }
  [[nodiscard]] std::uint32_t fourcc() const { return planes() ? raw.fmt.pix_mp.pixelformat : raw.fmt.pix.pixelformat; }
  [[nodiscard]] int width() const { return static_cast<int>(planes() ? raw.fmt.pix_mp.width : raw.fmt.pix.width); }
  [[nodiscard]] int height() const { return static_cast<int>(planes() ? raw.fmt.pix_mp.height : raw.fmt.pix.height); }
  [[nodiscard]] std::uint32_t field() const { return planes() ? raw.fmt.pix_mp.field : raw.fmt.pix.field; }
  [[nodiscard]] std::size_t plane_count() const { return planes() ? raw.fmt.pix_mp.num_planes : 1; }
  [[nodiscard]] std::size_t stride(std::size_t plane) const {
    return planes() ? raw.fmt.pix_mp.plane_fmt[plane].bytesperline : raw.fmt.pix.bytesperline;
  }
  [[nodiscard]] std::size_t size(std::size_t plane) const {
    return planes() ? raw.fmt.pix_mp.plane_fmt[plane].sizeimage : raw.fmt.pix.sizeimage;
  }
  void want(std::uint32_t fourcc, int width, int height) {
    const auto type = raw.type;
    raw = {};
    raw.type = type;
    if (planes()) {
      raw.fmt.pix_mp.pixelformat = fourcc;
      raw.fmt.pix_mp.width = static_cast<std::uint32_t>(width);
      raw.fmt.pix_mp.height = static_cast<std::uint32_t>(height);
      raw.fmt.pix_mp.field = V4L2_FIELD_NONE;
    } else {
      raw.fmt.pix.pixelformat = fourcc;
      raw.fmt.pix.width = static_cast<std::uint32_t>(width);
      raw.fmt.pix.height = static_cast<std::uint32_t>(height);
      raw.fmt.pix.field = V4L2_FIELD_NONE;
    }
  }
  /// Of what the driver has answered: its colour space is needed to say more of it.
  void want_full_range() {
    if (planes()) {
      raw.fmt.pix_mp.flags |= V4L2_PIX_FMT_FLAG_SET_CSC;
      raw.fmt.pix_mp.quantization = V4L2_QUANTIZATION_FULL_RANGE;
    } else {
      raw.fmt.pix.priv = V4L2_PIX_FMT_PRIV_MAGIC;
      raw.fmt.pix.flags |= V4L2_PIX_FMT_FLAG_SET_CSC;
      raw.fmt.pix.quantization = V4L2_QUANTIZATION_FULL_RANGE;
    }
  }
};

std::string size_text(int width, int height) { return std::to_string(width) + "x" + std::to_string(height); }

std::string list_text(std::span<const OfferedFormat> offered) {
  std::string usable;
  std::string other;
  for (const OfferedFormat& format : offered) {
    const KnownFormat* const known = find_format(format.fourcc);
    std::string& list = known != nullptr ? usable : other;
    list += (list.empty() ? "" : ", ") + (known != nullptr ? std::string(known->name) : fourcc_text(format.fourcc));
  }
  if (usable.empty()) return "it offers none that can be used, only " + (other.empty() ? "nothing" : other);
  return "it offers " + usable;
}

std::string sizes_text(const Device& device, std::uint32_t fourcc) {
  constexpr std::size_t kMany = 12;
  std::string list;
  const std::vector<OfferedSize> sizes = list_sizes(device, fourcc);
  for (std::size_t i = 0; i < sizes.size() && i < kMany; ++i) {
    const OfferedSize& size = sizes[i];
    list += (list.empty() ? "" : ", ") + size_text(size.width, size.height);
    if (size.max_width != size.width || size.max_height != size.height) {
      list += " to " + size_text(size.max_width, size.max_height);
    }
  }
  if (sizes.size() > kMany) list += ", ...";
  return list.empty() ? std::string() : "; it offers " + list;
}

/// The part of the frame that the driver fills, where it tells.
void take_compose(const Device& device, Layout& layout) {
  layout.left = 0;
  layout.top = 0;
  layout.width = layout.frame_width;
  layout.height = layout.frame_height;
  v4l2_selection selection{};
  selection.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  selection.target = V4L2_SEL_TGT_COMPOSE;
  if (device.ask(VIDIOC_G_SELECTION, selection) != 0) return;
  const v4l2_rect& part = selection.r;
  const auto right = static_cast<std::int64_t>(part.left) + part.width;
  const auto bottom = static_cast<std::int64_t>(part.top) + part.height;
  if (part.left < 0 || part.top < 0 || part.width == 0 || part.height == 0 || right > layout.frame_width ||
      bottom > layout.frame_height) {
    return;
  }
  layout.left = part.left;
  layout.top = part.top;
  layout.width = static_cast<int>(part.width);
  layout.height = static_cast<int>(part.height);
}

/// What the driver made of a wish, as a layout; why it cannot be used, else empty.
std::string read_layout(const Device& device, const Format& made, const KnownFormat& known, Layout& layout) {
  if (made.fourcc() != known.fourcc) return "the driver makes " + fourcc_text(made.fourcc()) + " of it";
  layout.format = &known;
  layout.planes_interface = made.planes();
  layout.frame_width = made.width();
  layout.frame_height = made.height();
  layout.stride = made.stride(0);
  const PixelFormat format = known.format;
  if (made.field() != V4L2_FIELD_NONE && made.field() != V4L2_FIELD_ANY) {
    return "it delivers two half pictures in turn (interlaced), which show two moments: choose another input or mode";
  }
  take_compose(device, layout);
  const std::size_t row = picture_bytes(format, layout.frame_width, 1);
  if (layout.stride == 0) layout.stride = row;  // packed formats of some drivers
  const std::size_t rows = static_cast<std::size_t>(memory_rows(format, layout.frame_height));
  layout.bytes = layout.stride * (rows - 1) + row;
  layout.luma_bytes = layout.stride * static_cast<std::size_t>(layout.frame_height);
  if (layout.stride < row || made.plane_count() != known.planes) return "the driver's description of it makes no sense";

  std::size_t promised = 0;
  for (std::size_t plane = 0; plane < known.planes; ++plane) promised += made.size(plane);
  if (promised < layout.bytes) return "the driver's buffers are too small for it";

  if (known.planes == 2) {
    const auto page = static_cast<std::size_t>(::sysconf(_SC_PAGESIZE));
    if (made.stride(1) != layout.stride || layout.luma_bytes % page != 0 || made.size(0) < layout.luma_bytes) {
      return "its two planes cannot lie one after the other at " + size_text(layout.frame_width, layout.frame_height) +
             ": bytes a row times rows (" + std::to_string(layout.luma_bytes) + ") have to be a multiple of " +
             std::to_string(page) + "; choose another size, or nv12";
    }
  }
  const bool split = layout.height != layout.frame_height && format == PixelFormat::kNv12;
  if (split || !fits_format(format, layout.width, layout.height) || !fits_format(format, layout.left, layout.top)) {
    return "its picture of " + size_text(layout.width, layout.height) + " at " + std::to_string(layout.left) + "," +
           std::to_string(layout.top) + " of the frame cannot be cut out in that format: choose another format";
  }
  return {};
}

std::chrono::nanoseconds period_of(const v4l2_fract& fraction) {
  const double seconds = static_cast<double>(fraction.numerator) / static_cast<double>(fraction.denominator);
  return std::chrono::nanoseconds(std::llround(seconds * 1e9));
}

template <class Visit>
void each_interval(const Device& device, std::uint32_t fourcc, int width, int height, Visit visit) {
  constexpr std::uint32_t kMany = 256;
  v4l2_frmivalenum query{};
  for (std::uint32_t index = 0; index < kMany; ++index) {
    query = {};
    query.index = index;
    query.pixel_format = fourcc;
    query.width = static_cast<std::uint32_t>(width);
    query.height = static_cast<std::uint32_t>(height);
    if (device.ask(VIDIOC_ENUM_FRAMEINTERVALS, query) != 0) return;
    if (query.type == V4L2_FRMIVAL_TYPE_DISCRETE) {
      if (query.discrete.numerator != 0 && query.discrete.denominator != 0) visit(query.discrete);
      continue;
    }
    if (query.stepwise.min.numerator != 0 && query.stepwise.min.denominator != 0) visit(query.stepwise.min);
    if (query.stepwise.max.numerator != 0 && query.stepwise.max.denominator != 0) visit(query.stepwise.max);
    return;
  }
}

}  // namespace

std::uint32_t Layout::buffer_type() const noexcept {
  return planes_interface ? V4L2_BUF_TYPE_VIDEO_CAPTURE_MPLANE : V4L2_BUF_TYPE_VIDEO_CAPTURE;
}

std::size_t Layout::offset() const noexcept {
  return static_cast<std::size_t>(top) * stride + picture_bytes(format->format, left, 1);
}

Layout set_layout(const Device& device, bool planes_interface, const Settings& wanted, const std::string& name) {
  Format current(planes_interface);
  if (const int error = device.ask(VIDIOC_G_FMT, current.raw); error != 0) {
    refuse(name,
           std::string("has no format (") + error_text(error) + "): start what writes into it, or plug it in anew");
  }
  const bool any_size = wanted.width == 0 && wanted.height == 0;
  const int width = any_size ? current.width() : wanted.width;
  const int height = any_size ? current.height() : wanted.height;

  const std::vector<OfferedFormat> offered = list_formats(device, planes_interface);
  struct Candidate {
    const KnownFormat* known = nullptr;
    bool range_choice = false;
  };
  std::vector<Candidate> candidates;
  const auto consider = [&](const KnownFormat& known) {
    const auto found = std::find_if(offered.begin(), offered.end(),
                                    [&](const OfferedFormat& format) { return format.fourcc == known.fourcc; });
    if (found != offered.end()) candidates.push_back({&known, found->range_choice});
  };
  if (wanted.format == "auto") {
    for (const KnownFormat& known : known_formats()) consider(known);
  } else {
    const KnownFormat* const known = find_format(std::string_view(wanted.format));
    if (known == nullptr) refuse(name, "no format is called " + wanted.format + "; " + list_text(offered));
    consider(*known);
  }
  if (candidates.empty()) refuse(name, "has no format " + wanted.format + "; " + list_text(offered));

  std::string first_reason;
  for (const auto& [known, range_choice] : candidates) {
    Format made(planes_interface);
    made.want(known->fourcc, width, height);
    int error = device.ask(VIDIOC_S_FMT, made.raw);
    if (error == 0 && range_choice) {
      made.want_full_range();
      error = device.ask(VIDIOC_S_FMT, made.raw);
    }
    if (error == EBUSY) {
      refuse(name, "busy: another program streams from it (fuser -v /dev/video* tells which): stop that");
    }
    Layout layout;
    std::string reason = error != 0 ? std::string("the driver refuses it: ") + error_text(error)
                                    : read_layout(device, made, *known, layout);
    if (reason.empty() && (layout.width != width || layout.height != height) && !any_size) {
      reason = size_text(width, height) + " cannot be had, the driver makes it " +
               size_text(layout.width, layout.height) + sizes_text(device, known->fourcc);
    }
    if (reason.empty()) return layout;
    if (first_reason.empty()) first_reason = "format " + std::string(known->name) + ": " + reason;
  }
  refuse(name, first_reason);
}

std::optional<std::chrono::nanoseconds> set_period(const Device& device, const Layout& layout, double fps,
                                                   std::vector<std::string>& notes) {
  v4l2_streamparm rate{};
  rate.type = layout.buffer_type();
  if (device.ask(VIDIOC_G_PARM, rate) != 0) {
    if (fps > 0) notes.emplace_back("the driver has no control of the frame rate: it is taken to be as configured");
    return std::nullopt;
  }
  v4l2_captureparm& capture = rate.parm.capture;
  const bool can_set = (capture.capability & V4L2_CAP_TIMEPERFRAME) != 0;
  int error = 0;
  if (fps > 0 && can_set) {
    constexpr std::uint32_t kFine = 1000;
    const auto rounded = static_cast<std::uint32_t>(std::max(1L, std::lround(fps * kFine)));
    const std::uint32_t common = std::gcd(kFine, rounded);
    capture.timeperframe = {kFine / common, rounded / common};
    error = device.ask(VIDIOC_S_PARM, rate);
    if (error != 0) (void)device.ask(VIDIOC_G_PARM, rate);
  }
  if (capture.timeperframe.numerator == 0 || capture.timeperframe.denominator == 0) return std::nullopt;
  const std::chrono::nanoseconds period = period_of(capture.timeperframe);
  const double made = 1e9 / static_cast<double>(period.count());
  if (fps > 0 && (std::abs(made - fps) > 0.01 * fps || error != 0)) {
    char text[160];
    std::snprintf(text, sizeof text, "%.3g frames a second%s: the driver %s %.4g", fps,
                  error != 0 ? std::string(" are refused (").append(error_text(error)).append(")").c_str() : "",
                  error != 0 || !can_set ? "stays at" : "makes it", made);
    notes.emplace_back(text);
  }
  return period;
}

std::optional<std::chrono::nanoseconds> shortest_period(const Device& device, std::uint32_t fourcc, int width,
                                                        int height) {
  std::optional<std::chrono::nanoseconds> shortest;
  each_interval(device, fourcc, width, height, [&](const v4l2_fract& interval) {
    const std::chrono::nanoseconds period = period_of(interval);
    // A range may begin at next to nothing, which says nothing about the sensor.
    if (period < std::chrono::microseconds(100)) return;
    if (!shortest || period < *shortest) shortest = period;
  });
  return shortest;
}

std::vector<OfferedFormat> list_formats(const Device& device, bool planes_interface) {
  std::vector<OfferedFormat> formats;
  v4l2_fmtdesc query{};
  for (std::uint32_t index = 0;; ++index) {
    query = {};
    query.index = index;
    query.type = planes_interface ? V4L2_BUF_TYPE_VIDEO_CAPTURE_MPLANE : V4L2_BUF_TYPE_VIDEO_CAPTURE;
    if (device.ask(VIDIOC_ENUM_FMT, query) != 0) return formats;
    formats.push_back({query.pixelformat, (query.flags & V4L2_FMT_FLAG_CSC_QUANTIZATION) != 0});
  }
}

std::vector<OfferedSize> list_sizes(const Device& device, std::uint32_t fourcc) {
  std::vector<OfferedSize> sizes;
  v4l2_frmsizeenum query{};
  for (std::uint32_t index = 0;; ++index) {
    query = {};
    query.index = index;
    query.pixel_format = fourcc;
    if (device.ask(VIDIOC_ENUM_FRAMESIZES, query) != 0) return sizes;
    const auto px = [](std::uint32_t value) { return static_cast<int>(value); };
    if (query.type == V4L2_FRMSIZE_TYPE_DISCRETE) {
      const v4l2_frmsize_discrete& size = query.discrete;
      sizes.push_back({px(size.width), px(size.height), px(size.width), px(size.height)});
      continue;
    }
    const v4l2_frmsize_stepwise& range = query.stepwise;
    sizes.push_back({px(range.min_width), px(range.min_height), px(range.max_width), px(range.max_height)});
    return sizes;
  }
}

std::vector<double> list_rates(const Device& device, std::uint32_t fourcc, int width, int height) {
  std::vector<double> rates;
  each_interval(device, fourcc, width, height, [&](const v4l2_fract& interval) {
    rates.push_back(static_cast<double>(interval.denominator) / static_cast<double>(interval.numerator));
  });
  return rates;
}

}  // namespace stereotrack::capture::v4l2
