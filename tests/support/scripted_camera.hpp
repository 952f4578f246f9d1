#pragma once

#include <poll.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <cstring>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "drivers/capture/camera.hpp"

namespace stereotrack::test {

/// The sensor's end of a camera: whoever holds it exposes frames, breaks things and sees what became of the buffers.
/// Outlives the camera; any thread.
class SensorScript {
 public:
  explicit SensorScript(capture::CameraInfo info) : info_(std::move(info)) {}

  /// What is written into a buffer; of a picture in memory, rows close together.
  using Paint = std::function<void(std::uint8_t* pixels, std::uint64_t number)>;

  struct Exposure {
    std::uint64_t number = 0;  ///< written into each pixel, where nothing else is painted
    std::chrono::nanoseconds time{0};
    std::uint64_t sequence = 0;
    bool damaged = false;
    capture::SensorSettings settings{};
  };

  /// False: no buffer was free, or no camera is open: the frame is lost.
  bool expose(const Exposure& exposure, const Paint& paint = {}) {
    const std::lock_guard lock(mutex_);
    if (descriptor_ < 0 || is_lost_) return false;
    const auto free = std::find(states_.begin(), states_.end(), State::kDriver);
    if (free == states_.end()) {
      ++late_;
      return false;
    }
    const auto buffer = static_cast<std::uint32_t>(free - states_.begin());
    *free = State::kFilled;
    if (paint) {
      paint(pixels_[buffer].data(), exposure.number);
    } else {
      fill(buffer, exposure.number);
    }
    queue_.at(queued_++) = {exposure, buffer};
    ring();
    return true;
  }

  void lose() {
    const std::lock_guard lock(mutex_);
    if (descriptor_ < 0) return;
    is_lost_ = true;
    ring();
  }

  void set_map(std::chrono::nanoseconds offset) { offset_ns_.store(offset.count()); }
  void set_info(const capture::CameraInfo& info) {
    const std::lock_guard lock(mutex_);
    info_ = info;
  }
  [[nodiscard]] capture::CameraInfo info() const {
    const std::lock_guard lock(mutex_);
    return info_;
  }
  /// Why it cannot be opened; empty: it can.
  void refuse(std::string why) {
    const std::lock_guard lock(mutex_);
    refusal_ = std::move(why);
  }

  /// Why it opens and does not begin to stream; empty: it does.
  void refuse_start(std::string why) {
    const std::lock_guard lock(mutex_);
    start_refusal_ = std::move(why);
  }

  /// Its period can be set while it streams, to multiples of the quantum.
  void allow_periods(const capture::PeriodRange& range) {
    const std::lock_guard lock(mutex_);
    periods_ = range;
  }
  /// The driver answers as ever and the sensor stays as it was.
  void ignore_periods(bool ignore) {
    const std::lock_guard lock(mutex_);
    ignores_periods_ = ignore;
  }
  /// That the sensor keeps now; as opened, that of its info.
  [[nodiscard]] std::chrono::nanoseconds period() const {
    const std::lock_guard lock(mutex_);
    return period_;
  }
  [[nodiscard]] int periods_set() const { return periods_set_.load(); }

  [[nodiscard]] bool is_open() const {
    const std::lock_guard lock(mutex_);
    return descriptor_ >= 0;
  }
  /// Buffers that are taken and not given back.
  [[nodiscard]] std::size_t held() const {
    const std::lock_guard lock(mutex_);
    return static_cast<std::size_t>(std::count(states_.begin(), states_.end(), State::kTaken));
  }
  [[nodiscard]] std::size_t free() const {
    const std::lock_guard lock(mutex_);
    return static_cast<std::size_t>(std::count(states_.begin(), states_.end(), State::kDriver));
  }
  /// Buffers that were given back and had not been taken.
  [[nodiscard]] int given_back_wrongly() const { return wrong_.load(); }
  /// Buffers that were still taken when their camera was closed; a lease might have read them.
  [[nodiscard]] int lost_in_closing() const { return lost_in_closing_.load(); }
  [[nodiscard]] int opened() const { return opened_.load(); }

 private:
  friend class ScriptedCamera;
  enum class State : std::uint8_t { kDriver, kFilled, kTaken };
  struct Queued {
    Exposure exposure;
    std::uint32_t buffer = 0;
  };

  void fill(std::uint32_t buffer, std::uint64_t number) {
    for (std::size_t i = 0; i + 8 <= pixels_[buffer].size(); i += 8) std::memcpy(&pixels_[buffer][i], &number, 8);
  }
  void ring() const {
    const std::uint64_t one = 1;
    (void)!write(descriptor_, &one, sizeof one);
  }

  mutable std::mutex mutex_;
  capture::CameraInfo info_;
  std::string refusal_;
  std::string start_refusal_;
  int descriptor_ = -1;
  bool is_lost_ = false;
  std::optional<capture::PeriodRange> periods_;
  bool ignores_periods_ = false;
  std::chrono::nanoseconds period_{0};
  std::atomic<int> periods_set_{0};
  std::uint64_t late_ = 0;
  std::vector<State> states_;
  std::vector<std::vector<std::uint8_t>> pixels_;
  std::array<Queued, 64> queue_{};
  std::size_t queued_ = 0;
  std::atomic<std::int64_t> offset_ns_{0};
  std::atomic<int> wrong_{0};
  std::atomic<int> lost_in_closing_{0};
  std::atomic<int> opened_{0};
};

/// A camera whose frames come from a script, through a real descriptor, in memory of its own. What it gets back it
/// overwrites at once, as a driver might.
class ScriptedCamera final : public capture::Camera {
 public:
  static constexpr std::uint64_t kOverwritten = 0xdead'dead'dead'deadU;

  /// Throws std::runtime_error where the script refuses.
  explicit ScriptedCamera(SensorScript& script) : script_(script) {
    const std::lock_guard lock(script_.mutex_);
    if (!script_.refusal_.empty()) throw std::runtime_error(script_.refusal_);
    if (script_.descriptor_ >= 0) throw std::runtime_error(script_.info_.name + ": busy");
    info_ = script_.info_;
    failure_ = info_.name + ": unplugged: check its cable";
    script_.states_.assign(info_.buffers, SensorScript::State::kFilled);  // nothing is queued before start()
    script_.pixels_.assign(info_.buffers,
                           std::vector<std::uint8_t>(picture_bytes(info_.format, info_.width, info_.height)));
    script_.queued_ = 0;
    script_.is_lost_ = false;
    script_.period_ = info_.period;
    script_.late_ = 0;
    script_.descriptor_ = eventfd(0, EFD_SEMAPHORE | EFD_NONBLOCK | EFD_CLOEXEC);
    script_.opened_.fetch_add(1);
    descriptor_ = script_.descriptor_;
  }
  ScriptedCamera(const ScriptedCamera&) = delete;
  ScriptedCamera& operator=(const ScriptedCamera&) = delete;
  ~ScriptedCamera() override {
    const std::lock_guard lock(script_.mutex_);
    script_.lost_in_closing_.fetch_add(
        static_cast<int>(std::count(script_.states_.begin(), script_.states_.end(), SensorScript::State::kTaken)));
    // Gone is gone: who reads them now is found by the sanitizer.
    script_.pixels_.clear();
    script_.states_.clear();
    (void)close(script_.descriptor_);
    script_.descriptor_ = -1;
  }

  [[nodiscard]] const capture::CameraInfo& info() const noexcept override { return info_; }
  void start() override {
    const std::lock_guard lock(script_.mutex_);
    if (!script_.start_refusal_.empty()) throw std::runtime_error(script_.start_refusal_);
    std::fill(script_.states_.begin(), script_.states_.end(), SensorScript::State::kDriver);
  }
  [[nodiscard]] int descriptor() const noexcept override { return descriptor_; }

  [[nodiscard]] Take take(capture::SensorFrame& frame) noexcept override {
    const std::lock_guard lock(script_.mutex_);
    if (script_.queued_ == 0) return script_.is_lost_ ? Take::kLost : Take::kNothing;
    std::uint64_t one = 0;
    (void)!read(descriptor_, &one, sizeof one);
    const SensorScript::Queued queued = script_.queue_.front();
    std::copy(script_.queue_.begin() + 1, script_.queue_.begin() + static_cast<std::ptrdiff_t>(script_.queued_),
              script_.queue_.begin());
    --script_.queued_;
    script_.states_[queued.buffer] = SensorScript::State::kTaken;
    frame.mid_exposure = CaptureTime(queued.exposure.time);
    frame.sequence = queued.exposure.sequence;
    frame.buffer = queued.buffer;
    frame.damaged = queued.exposure.damaged;
    frame.settings = queued.exposure.settings;
    frames_.fetch_add(1);
    if (frame.damaged) damaged_.fetch_add(1);
    return Take::kFrame;
  }

  void give_back(std::uint32_t buffer) noexcept override {
    const std::lock_guard lock(script_.mutex_);
    if (buffer >= script_.states_.size() || script_.states_[buffer] != SensorScript::State::kTaken) {
      script_.wrong_.fetch_add(1);
      return;
    }
    script_.fill(buffer, kOverwritten);
    script_.states_[buffer] = SensorScript::State::kDriver;
  }

  [[nodiscard]] Picture picture(std::uint32_t buffer) const noexcept override {
    return {script_.pixels_[buffer].data(), info_.width, info_.height,
            static_cast<std::ptrdiff_t>(row_bytes(info_.format, info_.width)), info_.format};
  }
  [[nodiscard]] std::string failure() const override { return failure_; }
  [[nodiscard]] std::optional<capture::PeriodRange> period_range() const noexcept override {
    const std::lock_guard lock(script_.mutex_);
    return script_.periods_;
  }
  std::optional<std::chrono::nanoseconds> set_period(std::chrono::nanoseconds wanted) noexcept override {
    const std::lock_guard lock(script_.mutex_);
    if (!script_.periods_) return std::nullopt;
    const capture::PeriodRange& range = *script_.periods_;
    const std::chrono::nanoseconds within = std::clamp(wanted, range.least, range.most);
    const std::chrono::nanoseconds made = within / range.quantum * range.quantum;
    if (!script_.ignores_periods_) script_.period_ = made;
    script_.periods_set_.fetch_add(1);
    return made;
  }
  [[nodiscard]] ClockMap clock_map() const noexcept override {
    return {CaptureTime(), MonotonicTime(std::chrono::nanoseconds(script_.offset_ns_.load()))};
  }
  [[nodiscard]] Counters counters() const noexcept override {
    return {.frames = frames_.load(), .damaged = damaged_.load()};
  }

 private:
  SensorScript& script_;
  capture::CameraInfo info_;
  std::string failure_;
  int descriptor_ = -1;
  std::atomic<std::uint64_t> frames_{0};
  std::atomic<std::uint64_t> damaged_{0};
};

}  // namespace stereotrack::test
