#include "drivers/capture/v4l2/controls.hpp"

#include <linux/videodev2.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace stereotrack::capture::v4l2 {
namespace {

// What a person would write: at most three digits behind the point.
std::string number(double value) {
  char text[48];
  std::snprintf(text, sizeof text, "%.3f", value);
  std::string out = text;
  while (out.back() == '0') out.pop_back();
  if (out.back() == '.') out.pop_back();
  return out;
}

bool has_number(const v4l2_query_ext_ctrl& control) {
  const bool one = control.nr_of_dims == 0 && (control.flags & (V4L2_CTRL_FLAG_DISABLED)) == 0;
  switch (control.type) {
    case V4L2_CTRL_TYPE_INTEGER:
    case V4L2_CTRL_TYPE_BOOLEAN:
    case V4L2_CTRL_TYPE_MENU:
    case V4L2_CTRL_TYPE_INTEGER64:
    case V4L2_CTRL_TYPE_BITMASK:
    case V4L2_CTRL_TYPE_INTEGER_MENU: return one;
    default: return false;
  }
}

Control described(const v4l2_query_ext_ctrl& control) {
  return {control.id,
          control.name,
          control.type,
          control.flags,
          control.minimum,
          control.maximum,
          std::max<std::int64_t>(1, static_cast<std::int64_t>(control.step)),
          control.default_value};
}

/// A control on the first device that has it.
struct Placed {
  std::size_t device = 0;
  Control control;
};

std::optional<Placed> place(std::span<const Device* const> devices, std::uint32_t id) {
  for (std::size_t i = 0; i < devices.size(); ++i) {
    if (auto control = find_control(*devices[i], id)) return Placed{i, std::move(*control)};
  }
  return std::nullopt;
}

/// Switches an automatic control off, where there is one. What was set at last; empty: there is none.
std::optional<std::int64_t> set_automatic(std::span<const Device* const> devices, std::uint32_t id, bool want_off,
                                          std::int64_t off, const char* what, std::vector<std::string>& notes) {
  const auto found = place(devices, id);
  if (!found) return std::nullopt;
  const Device& device = *devices[found->device];
  if (want_off) {
    const int error = write_control(device, found->control, off);
    const auto made = read_control(device, id);
    if (error != 0 || made != off) {
      notes.push_back(std::string("automatic ") + what + " stays on: the driver refuses to switch it off (" +
                      error_text(error) + ")");
    }
  }
  return read_control(device, id);
}

/// Writes and reads back. `unit` is one count in the user's unit.
std::optional<std::int64_t> set_number(const Device& device, const Control& control, double wanted, double unit,
                                       const char* what, const char* unit_name, std::vector<std::string>& notes) {
  const int error = write_control(device, control, nearest_value(control, wanted / unit));
  const auto made = read_control(device, control.id);
  const auto said = [&](std::int64_t count) { return number(static_cast<double>(count) * unit) + unit_name; };
  if (error != 0) {
    notes.push_back(std::string(what) + " " + number(wanted) + unit_name + " is refused (" + error_text(error) + ")" +
                    (made ? ": it stays at " + said(*made) : std::string()));
  } else if (!made) {
    notes.push_back(std::string(what) + " " + number(wanted) + unit_name + " is set, but cannot be read back");
  } else if (std::abs(static_cast<double>(*made) * unit - wanted) > 0.01 * std::abs(wanted)) {
    notes.push_back(std::string(what) + " " + number(wanted) + unit_name + ": the driver made it " + said(*made) +
                    ", its range is " + said(control.minimum) + " to " + said(control.maximum));
  }
  return made;
}

}  // namespace

std::vector<Control> list_controls(const Device& device) {
  std::vector<Control> controls;
  v4l2_query_ext_ctrl query{};
  query.id = V4L2_CTRL_FLAG_NEXT_CTRL;
  while (device.ask(VIDIOC_QUERY_EXT_CTRL, query) == 0) {
    if (has_number(query)) controls.push_back(described(query));
    query.id |= V4L2_CTRL_FLAG_NEXT_CTRL;
  }
  return controls;
}

std::optional<Control> find_control(const Device& device, std::uint32_t id) {
  v4l2_query_ext_ctrl query{};
  query.id = id;
  if (device.ask(VIDIOC_QUERY_EXT_CTRL, query) != 0 || !has_number(query)) return std::nullopt;
  return described(query);
}

std::optional<std::int64_t> read_control(const Device& device, std::uint32_t id) {
  const auto control = find_control(device, id);
  if (!control || (control->flags & V4L2_CTRL_FLAG_WRITE_ONLY) != 0) return std::nullopt;
  v4l2_ext_control value{};
  value.id = id;
  v4l2_ext_controls values{};
  values.which = V4L2_CTRL_WHICH_CUR_VAL;
  values.count = 1;
  values.controls = &value;
  if (device.ask(VIDIOC_G_EXT_CTRLS, values) != 0) return std::nullopt;
  return control->type == V4L2_CTRL_TYPE_INTEGER64 ? value.value64 : value.value;
}

int write_control(const Device& device, const Control& control, std::int64_t number) {
  v4l2_ext_control value{};
  value.id = control.id;
  if (control.type == V4L2_CTRL_TYPE_INTEGER64) {
    value.value64 = number;
  } else {
    value.value = static_cast<std::int32_t>(number);
  }
  v4l2_ext_controls values{};
  values.which = V4L2_CTRL_WHICH_CUR_VAL;
  values.count = 1;
  values.controls = &value;
  return device.ask(VIDIOC_S_EXT_CTRLS, values);
}

std::int64_t nearest_value(const Control& control, double wanted) noexcept {
  const auto low = static_cast<double>(control.minimum);
  const auto high = static_cast<double>(control.maximum);
  const double within = std::clamp(wanted, low, high);
  const auto steps = static_cast<std::int64_t>(std::llround((within - low) / static_cast<double>(control.step)));
  const std::int64_t value = control.minimum + steps * control.step;
  return value > control.maximum ? value - control.step : value;
}

std::optional<float> GainScale::gain_of(std::int64_t code) const noexcept {
  const auto value = static_cast<double>(code);
  switch (kind) {
    case Kind::kLinear: return static_cast<float>(value / one);
    case Kind::kInverse: return value < one ? std::optional(static_cast<float>(one / (one - value))) : std::nullopt;
    case Kind::kDecibel: return static_cast<float>(std::pow(10.0, value * one / 20));
    case Kind::kUnknown: break;
  }
  return std::nullopt;
}

double GainScale::code_of(double gain) const noexcept {
  switch (kind) {
    case Kind::kLinear: return gain * one;
    case Kind::kInverse: return one - one / gain;
    case Kind::kDecibel: return 20 * std::log10(gain) / one;
    case Kind::kUnknown: break;
  }
  return gain;
}

GainScale gain_scale(std::string_view sensor, const Control& control) noexcept {
  struct Odd {
    std::string_view sensor;
    GainScale scale;
  };
  // From the sensors' data sheets.
  constexpr Odd kOdd[] = {
      {"imx219", {GainScale::Kind::kInverse, 256}}, {"imx477", {GainScale::Kind::kInverse, 1024}},
      {"imx290", {GainScale::Kind::kDecibel, 0.3}}, {"imx327", {GainScale::Kind::kDecibel, 0.3}},
      {"imx462", {GainScale::Kind::kDecibel, 0.3}}, {"imx296", {GainScale::Kind::kDecibel, 0.1}},
  };
  for (const Odd& odd : kOdd) {
    if (sensor.starts_with(odd.sensor)) return odd.scale;
  }
  if (control.standard <= 0) return {};
  return {GainScale::Kind::kLinear, static_cast<double>(control.standard)};
}

LineTiming line_timing(const Device& sensor, int width, int height) {
  const auto rate = read_control(sensor, V4L2_CID_PIXEL_RATE);
  const auto blank = read_control(sensor, V4L2_CID_HBLANK);
  if (!rate || !blank || *rate <= 0 || *blank < 0) return {};
  return {
      std::chrono::duration<double, std::micro>(1e6 * static_cast<double>(width + *blank) / static_cast<double>(*rate)),
      height};
}

std::int64_t RowPeriod::blank_of(std::chrono::nanoseconds period) const noexcept {
  return nearest_value(blank, std::chrono::duration<double, std::micro>(period) / timing.line - timing.rows);
}

std::chrono::nanoseconds RowPeriod::period_of(std::int64_t blank_rows) const noexcept {
  return std::chrono::nanoseconds(
      std::llround(1e3 * timing.line.count() * static_cast<double>(timing.rows + blank_rows)));
}

PeriodRange RowPeriod::range() const noexcept {
  const auto step = static_cast<double>(std::max<std::int64_t>(blank.step, 1));
  return {period_of(blank.minimum), period_of(blank.maximum),
          std::chrono::nanoseconds(std::max(1LL, std::llround(1e3 * timing.line.count() * step)))};
}

std::optional<RowPeriod> row_period(const Device& sensor, const LineTiming& timing) {
  if (!timing.known()) return std::nullopt;
  const auto blank = find_control(sensor, V4L2_CID_VBLANK);
  constexpr std::uint32_t kFixed = V4L2_CTRL_FLAG_READ_ONLY | V4L2_CTRL_FLAG_GRABBED | V4L2_CTRL_FLAG_DISABLED;
  if (!blank || (blank->flags & kFixed) != 0 || blank->minimum >= blank->maximum) return std::nullopt;
  return RowPeriod{*blank, timing};
}

bool SensorControls::changed(std::uint32_t id, std::int64_t value) noexcept {
  if (id == 0) return false;
  if (id == exposure_id_) {
    exposure_ = value;
  } else if (id == gain_id_) {
    gain_ = value;
  } else if (id == V4L2_CID_EXPOSURE_AUTO) {
    auto_exposure_ = value;
  } else if (id == V4L2_CID_AUTOGAIN) {
    auto_gain_ = value;
  } else {
    return false;
  }
  refresh();
  return true;
}

void SensorControls::refresh() noexcept {
  const bool exposure_by_itself =
      auto_exposure_ && *auto_exposure_ != V4L2_EXPOSURE_MANUAL && *auto_exposure_ != V4L2_EXPOSURE_SHUTTER_PRIORITY;
  settings_ = {};
  if (exposure_ && !exposure_by_itself) {
    settings_.exposure =
        std::chrono::nanoseconds(std::llround(static_cast<double>(*exposure_) * exposure_unit_us_ * 1000));
  }
  if (gain_ && !(auto_gain_ && *auto_gain_ != 0)) settings_.gain = gain_scale_.gain_of(*gain_);
}

SensorControls set_controls(const Settings& wanted, std::span<const Device* const> devices, std::string_view sensor,
                            const LineTiming& timing, std::vector<std::string>& notes) {
  SensorControls controls;

  // Automatic ones first: while they are on, drivers refuse or ignore the others.
  controls.auto_exposure_ = set_automatic(devices, V4L2_CID_EXPOSURE_AUTO, wanted.exposure_us.has_value(),
                                          V4L2_EXPOSURE_MANUAL, "exposure", notes);
  controls.auto_gain_ = set_automatic(devices, V4L2_CID_AUTOGAIN, wanted.gain.has_value(), 0, "gain", notes);
  // Some let the exposure slow the frame rate down.
  const bool steady = wanted.fps > 0 || wanted.exposure_us.has_value();
  (void)set_automatic(devices, V4L2_CID_EXPOSURE_AUTO_PRIORITY, steady, 0, "frame rate", notes);

  auto exposure = place(devices, V4L2_CID_EXPOSURE_ABSOLUTE);
  controls.exposure_unit_us_ = 100;
  if (!exposure && timing.known()) {
    exposure = place(devices, V4L2_CID_EXPOSURE);
    controls.exposure_unit_us_ = timing.line.count();
  }
  if (exposure) {
    const Device& device = *devices[exposure->device];
    controls.device_ = exposure->device;
    controls.exposure_id_ = exposure->control.id;
    controls.exposure_ = wanted.exposure_us ? set_number(device, exposure->control, *wanted.exposure_us,
                                                         controls.exposure_unit_us_, "exposure", " us", notes)
                                            : read_control(device, exposure->control.id);
  } else if (place(devices, V4L2_CID_EXPOSURE)) {
    notes.emplace_back(
        "its exposure is in rows, and the driver does not tell how long a row takes: exposure is left alone, and half "
        "of "
        "it is missing in capture times");
  } else {
    notes.emplace_back(
        "the driver has no control of the exposure: it cannot be set, and half of it is missing in capture times");
  }

  auto gain = place(devices, V4L2_CID_ANALOGUE_GAIN);
  if (!gain) gain = place(devices, V4L2_CID_GAIN);
  if (gain) {
    const Device& device = *devices[gain->device];
    if (!exposure) controls.device_ = gain->device;
    controls.gain_id_ = gain->control.id;
    controls.gain_scale_ = gain_scale(sensor, gain->control);
    if (wanted.gain) {
      const double code = controls.gain_scale_.code_of(*wanted.gain);
      const int error = write_control(device, gain->control, nearest_value(gain->control, code));
      controls.gain_ = read_control(device, gain->control.id);
      const float made = controls.gain_ ? controls.gain_scale_.gain_of(*controls.gain_).value_or(0) : 0;
      const std::string asked = "gain " + number(*wanted.gain);
      const std::string range = std::to_string(gain->control.minimum) + " to " + std::to_string(gain->control.maximum);
      if (error != 0) {
        notes.push_back(asked + " is refused (" + error_text(error) + ")");
      } else if (controls.gain_scale_.kind == GainScale::Kind::kUnknown) {
        notes.push_back(asked + ": what the driver's numbers mean is not known: it was given as the number " +
                        (controls.gain_ ? std::to_string(*controls.gain_) : std::string("?")) + " of " + range);
      } else if (std::abs(made - *wanted.gain) > 0.01 * *wanted.gain) {
        notes.push_back(asked + ": the driver made it " + number(made) + ", number " +
                        (controls.gain_ ? std::to_string(*controls.gain_) : std::string("?")) + " of " + range);
      }
    } else {
      controls.gain_ = read_control(device, gain->control.id);
    }
  } else if (wanted.gain) {
    notes.emplace_back("the driver has no control of the gain: it cannot be set");
  }

  if (wanted.black_level) {
    if (const auto black = place(devices, V4L2_CID_BLACK_LEVEL)) {
      (void)set_number(*devices[black->device], black->control, *wanted.black_level, 1, "black level", "", notes);
    } else {
      notes.emplace_back("the driver has no control of the black level: it cannot be set");
    }
  }

  for (const std::uint32_t id : {controls.exposure_id_, controls.gain_id_}) {
    if (id != 0) controls.watched_.push_back(id);
  }
  if (controls.auto_exposure_) controls.watched_.push_back(V4L2_CID_EXPOSURE_AUTO);
  if (controls.auto_gain_) controls.watched_.push_back(V4L2_CID_AUTOGAIN);
  controls.refresh();
  return controls;
}

}  // namespace stereotrack::capture::v4l2
