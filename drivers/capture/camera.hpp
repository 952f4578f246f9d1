#pragma once

#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>

#include "pipeline/core/time.hpp"
#include "pipeline/frame.hpp"

namespace stereotrack::capture {

/// What is wanted of one sensor, whoever drives it. What is not said stays as its driver has it.
struct CameraSettings {
  std::string device;                 ///< its name, as its driver knows it
  int width = 0;                      ///< [px]; 0 with height 0: as the driver has it
  int height = 0;                     ///< [px]
  std::string format = "auto";        ///< a name of the driver's format_names(); auto: grey, where there is none the
                                      ///< cheapest to read
  double fps = 0;                     ///< 0: as the driver has it
  int buffers = 8;                    ///< wanted; it may become others. FramePool's slots and two, at least
  std::optional<double> exposure_us;  ///< automatic exposure is switched off with it
  std::optional<double> gain;         ///< 1 = none; automatic gain is switched off with it
  std::optional<double> readout_us;   ///< from the end of the exposure to the end of the frame; each driver says when
                                      ///< it wants to know
};

/// Of settings in microseconds, to the nearest nanosecond.
[[nodiscard]] inline std::chrono::nanoseconds from_us(double us) noexcept {
  return std::chrono::nanoseconds(std::llround(us * 1000));
}

/// What one sensor delivers, known once it is open.
struct CameraInfo {
  std::string name;   ///< as the user wrote it, for messages
  std::string model;  ///< what the driver calls it, and where it is plugged in
  int width = 0;      ///< [px]
  int height = 0;     ///< [px]
  PixelFormat format = PixelFormat::kGrey8;
  std::chrono::nanoseconds period{0};  ///< nominal time between frames, as the driver keeps it
  std::size_t buffers = 0;             ///< that the driver and we pass to and fro
  bool counts_lost = false;            ///< SensorFrame::sequence counts frames that were lost, too
  /// From the end of an exposure to the end of its frame, where times are told from the latter; else empty.
  std::optional<std::chrono::nanoseconds> readout = {};
  bool readout_is_guessed = false;  ///< nobody tells it
};

/// What a frame was exposed with, as far as the driver tells.
struct SensorSettings {
  std::optional<std::chrono::nanoseconds> exposure;
  std::optional<float> gain;  ///< 1 = none
};

/// One frame in one buffer of the driver.
struct SensorFrame {
  CaptureTime mid_exposure{};  ///< middle of the exposure, on the camera's clock: Camera::clock_map()
  MonotonicTime arrived{};     ///< when it was taken
  std::uint64_t sequence = 0;  ///< the sensor's own count, its wrap-around undone
  std::uint32_t buffer = 0;
  bool damaged = false;     ///< the driver says that its pixels are not to be trusted; give it back
  SensorSettings settings;  ///< in force when it was exposed
};

/// The times between frames that a sensor can be set to while it streams.
struct PeriodRange {
  std::chrono::nanoseconds least{0};
  std::chrono::nanoseconds most{0};
  std::chrono::nanoseconds quantum{0};  ///< they lie so far apart; > 0
};

/// One sensor's stream, whoever delivers it. Its buffers are the driver's: a frame that was taken stays where the
/// driver put it until give_back() names its buffer, in any order.
///
/// A factory opens it, sets format and controls and throws std::runtime_error with one line naming the device and the
/// way out. start(), failure() and the destructor belong to the thread that may wait and allocate, and so does what
/// stands below "Service thread"; what stands below "Capture thread" to that thread alone, from start() to its end. A
/// camera that is gone never comes back: another is opened.
class Camera {
 public:
  enum class Take : std::uint8_t {
    kFrame,    ///< `frame` is ours now
    kNothing,  ///< none waits
    kLost,     ///< the stream is over, for a reason: failure(). Unplugged, or the driver's fault
  };

  struct Counters {
    std::uint64_t frames = 0;   ///< taken
    std::uint64_t damaged = 0;  ///< of these
    std::uint64_t lost = 0;     ///< gaps in the sequence
    std::uint64_t late = 0;     ///< of the lost: all buffers were leased, so that the driver had none to fill
    std::uint64_t steps = 0;    ///< of its clock, which no wrap-around explains: times go on from arrivals
  };

  Camera() = default;
  Camera(const Camera&) = delete;
  Camera& operator=(const Camera&) = delete;
  virtual ~Camera() = default;

  [[nodiscard]] virtual const CameraInfo& info() const noexcept = 0;

  /// Queues all buffers and begins to stream. Throws std::runtime_error, one line.
  virtual void start() = 0;

  /// After take() has said kLost, and handed over from the thread that heard it: one line naming the device, the cause
  /// and the way out. Else empty.
  [[nodiscard]] virtual std::string failure() const = 0;

  // ---- Service thread, while the capture thread takes frames; may wait for the device

  /// What set_period() can do. Empty: nothing, or not as it is set up now.
  [[nodiscard]] virtual std::optional<PeriodRange> period_range() const noexcept { return std::nullopt; }

  /// The time between frames, from some frame of the next few on. What the driver says that it made of it; empty: it
  /// refuses, and all is as before. Exposure stays as it is where it has room in the period.
  virtual std::optional<std::chrono::nanoseconds> set_period(std::chrono::nanoseconds wanted) noexcept {
    (void)wanted;
    return std::nullopt;
  }

  // ---- Capture thread; no lock, no heap

  /// Readable, for poll(2), when take() will not answer kNothing.
  [[nodiscard]] virtual int descriptor() const noexcept = 0;

  /// The oldest frame that waits. Does not wait itself.
  [[nodiscard]] virtual Take take(SensorFrame& frame) noexcept = 0;

  /// The driver may fill the buffer again.
  virtual void give_back(std::uint32_t buffer) noexcept = 0;

  /// What the buffer of a frame that was taken shows.
  [[nodiscard]] virtual Picture picture(std::uint32_t buffer) const noexcept = 0;

  // ---- Any thread

  /// Where its capture times lie on the monotonic clock.
  [[nodiscard]] virtual ClockMap clock_map() const noexcept = 0;
  [[nodiscard]] virtual Counters counters() const noexcept = 0;
};

}  // namespace stereotrack::capture
