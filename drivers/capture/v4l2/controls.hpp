#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "drivers/capture/camera.hpp"
#include "drivers/capture/v4l2/device.hpp"
#include "drivers/capture/v4l2/v4l2.hpp"

namespace stereotrack::capture::v4l2 {

/// One control of a device, as the driver describes it.
struct Control {
  std::uint32_t id = 0;
  std::string name;
  std::uint32_t type = 0;   ///< V4L2_CTRL_TYPE_*
  std::uint32_t flags = 0;  ///< V4L2_CTRL_FLAG_*
  std::int64_t minimum = 0;
  std::int64_t maximum = 0;
  std::int64_t step = 1;
  std::int64_t standard = 0;
};

/// All that have a number for a value: no strings, arrays, buttons or headings.
[[nodiscard]] std::vector<Control> list_controls(const Device& device);
[[nodiscard]] std::optional<Control> find_control(const Device& device, std::uint32_t id);
[[nodiscard]] std::optional<std::int64_t> read_control(const Device& device, std::uint32_t id);
/// 0, or errno.
[[nodiscard]] int write_control(const Device& device, const Control& control, std::int64_t value);

/// The nearest value that the control can have.
[[nodiscard]] std::int64_t nearest_value(const Control& control, double wanted) noexcept;

/// What a gain control's numbers mean. No driver says; sensors' data sheets do.
struct GainScale {
  enum class Kind : std::uint8_t {
    kUnknown,  ///< of the driver's own making
    kLinear,   ///< gain = code / one
    kInverse,  ///< gain = one / (one - code)
    kDecibel,  ///< gain = 10^(code one / 20)
  };
  Kind kind = Kind::kUnknown;
  double one = 1;

  [[nodiscard]] std::optional<float> gain_of(std::int64_t code) const noexcept;
  [[nodiscard]] double code_of(double gain) const noexcept;
};
/// By the sensor's name where its scale is a known odd one. Else the value that the driver starts with is taken for no
/// gain and the scale for linear, which most are; kUnknown where that value is 0 or less.
[[nodiscard]] GainScale gain_scale(std::string_view sensor, const Control& control) noexcept;

/// How the sensor is read out, where its controls tell: HBLANK, VBLANK [px, rows] and PIXEL_RATE [px/s].
struct LineTiming {
  std::chrono::duration<double, std::micro> line{0};  ///< 0: not told
  int rows = 0;                                       ///< that are read out
  [[nodiscard]] bool known() const noexcept { return line.count() > 0; }
};
[[nodiscard]] LineTiming line_timing(const Device& sensor, int width, int height);

/// Periods by the rows that a sensor does not read out, V4L2_CID_VBLANK: period = (rows + blank) line. Sensors take
/// that between two frames while they stream, where their interval is refused or begins the stream anew.
struct RowPeriod {
  Control blank;
  LineTiming timing;  ///< known

  /// Rows that come nearest to the period, within the control's range.
  [[nodiscard]] std::int64_t blank_of(std::chrono::nanoseconds period) const noexcept;
  [[nodiscard]] std::chrono::nanoseconds period_of(std::int64_t blank_rows) const noexcept;
  [[nodiscard]] PeriodRange range() const noexcept;
};
/// Empty: the sensor does not tell how it is read out, or its blank rows cannot be set, or not now.
[[nodiscard]] std::optional<RowPeriod> row_period(const Device& sensor, const LineTiming& timing);

/// The controls of one sensor that frames depend on. Made by set_controls().
class SensorControls {
 public:
  /// What the driver says is set; an automatic one is not known.
  [[nodiscard]] const SensorSettings& settings() const noexcept { return settings_; }
  /// Another program has changed a control. False: none that matters. No heap.
  bool changed(std::uint32_t id, std::int64_t value) noexcept;
  /// Ids to be told of, 0: none.
  [[nodiscard]] std::span<const std::uint32_t> watched() const noexcept { return watched_; }
  /// Which of the devices has them.
  [[nodiscard]] std::size_t device() const noexcept { return device_; }

 private:
  friend SensorControls set_controls(const Settings&, std::span<const Device* const>, std::string_view,
                                     const LineTiming&, std::vector<std::string>&);
  void refresh() noexcept;

  std::uint32_t exposure_id_ = 0;
  std::uint32_t gain_id_ = 0;
  double exposure_unit_us_ = 0;
  GainScale gain_scale_;
  std::optional<std::int64_t> exposure_;
  std::optional<std::int64_t> gain_;
  std::optional<std::int64_t> auto_exposure_;
  std::optional<std::int64_t> auto_gain_;
  SensorSettings settings_;
  std::vector<std::uint32_t> watched_;
  std::size_t device_ = 0;
};

/// Sets exposure, gain and black level as wanted, automatic ones off, and reads them back. `devices`: the sensor's
/// sub-device, if there is one, and the video node; the first that has a control is asked. What is lacking, refused, or
/// off by more than a hundredth comes as one line each in `notes`, without the camera's name.
[[nodiscard]] SensorControls set_controls(const Settings& wanted, std::span<const Device* const> devices,
                                          std::string_view sensor, const LineTiming& timing,
                                          std::vector<std::string>& notes);

}  // namespace stereotrack::capture::v4l2
