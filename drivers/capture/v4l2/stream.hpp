#pragma once

#include <linux/videodev2.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "drivers/capture/camera.hpp"
#include "drivers/capture/camera_counters.hpp"
#include "drivers/capture/sequence_count.hpp"
#include "drivers/capture/v4l2/controls.hpp"
#include "drivers/capture/v4l2/device.hpp"
#include "drivers/capture/v4l2/layout.hpp"
#include "drivers/capture/v4l2/settings_in_force.hpp"
#include "drivers/capture/v4l2/stamps.hpp"

namespace stereotrack::capture::v4l2 {

/// What its frames' stamps are.
struct StampKind {
  bool by_arrival = false;  ///< the driver promises no clock: the moment at which the frame was taken stands for it
  StampedAt at = StampedAt::kEndOfFrame;
  std::chrono::nanoseconds readout{0};
};

/// The buffers of one device: asked for, or taken from a heap, mapped, and given back with their owner.
class Buffers {
 public:
  static constexpr std::size_t kMost = 32;
  static constexpr std::size_t kFewest = 3;

  /// Throws std::runtime_error, one line.
  Buffers(const Device& device, const Layout& layout, std::size_t wanted, Memory memory, const std::string& heap,
          const std::string& name);
  Buffers(const Buffers&) = delete;
  Buffers& operator=(const Buffers&) = delete;
  ~Buffers();

  [[nodiscard]] std::size_t size() const noexcept { return count_; }
  /// A whole frame, planes one after the other.
  [[nodiscard]] std::span<const std::uint8_t> memory(std::uint32_t buffer) const noexcept;
  /// V4L2_BUF_FLAG_* that the driver gave the first one: they tell its clock.
  [[nodiscard]] std::uint32_t flags() const noexcept { return flags_; }

  /// For QBUF and DQBUF: V4L2_MEMORY_MMAP or V4L2_MEMORY_DMABUF; with the latter, the descriptor of each plane.
  [[nodiscard]] std::uint32_t memory_type() const noexcept;
  [[nodiscard]] bool are_imported() const noexcept { return memory_ == Memory::kImported; }
  [[nodiscard]] int descriptor(std::uint32_t buffer, std::size_t plane) const noexcept {
    return buffers_[buffer].shared[plane];
  }

  /// Around each lease, where they are dma-bufs: the processor's caches and the device's agree. No heap.
  void begin_read(std::uint32_t buffer) const noexcept;
  void end_read(std::uint32_t buffer) const noexcept;

 private:
  struct Buffer {
    std::uint8_t* memory = nullptr;
    std::size_t bytes = 0;
    std::array<int, 2> shared{-1, -1};  ///< its dma-bufs
  };
  void request(std::size_t wanted, const std::string& name);
  void map(std::uint32_t index, const std::string& name);
  [[nodiscard]] int share(std::uint32_t index, std::size_t plane, std::size_t bytes, const std::string& name) const;
  void release() noexcept;
  void sync(std::uint32_t buffer, std::uint64_t flags) const noexcept;

  const Device& device_;
  Layout layout_;
  Memory memory_;
  std::string heap_;
  std::array<Buffer, kMost> buffers_{};
  std::size_t count_ = 0;
  std::uint32_t flags_ = 0;
};

/// Camera over one video node. Made by open().
class Stream final : public Camera {
 public:
  struct Parts {
    Device node;
    Device sensor;  ///< its sub-device; not open where it has none
    CameraInfo info;
    Layout layout;
    Device pacer;                    ///< the sensor again, for who sets its period
    std::optional<RowPeriod> paces;  ///< with `pacer`
    SensorControls controls;
    bool controls_on_sensor = false;
    int control_delay_frames = 1;
    std::size_t buffers = 0;
    Memory memory = Memory::kMapped;
    std::string heap;
    std::optional<std::chrono::nanoseconds> readout;  ///< configured, or told by the driver
    std::chrono::nanoseconds most_readout{0};         ///< the shortest period: sensors are as fast as they can be read
    bool guesses_readout = false;                     ///< that is taken where the former is required and missing
  };
  /// `notes` gets what is to be told about its stamps. Throws std::runtime_error, one line.
  Stream(Parts parts, std::vector<std::string>& notes);
  ~Stream() override;

  [[nodiscard]] const CameraInfo& info() const noexcept override { return parts_.info; }
  void start() override;

  [[nodiscard]] std::optional<PeriodRange> period_range() const noexcept override;
  std::optional<std::chrono::nanoseconds> set_period(std::chrono::nanoseconds wanted) noexcept override;

  [[nodiscard]] int descriptor() const noexcept override { return parts_.node.descriptor(); }
  [[nodiscard]] Take take(SensorFrame& frame) noexcept override;
  void give_back(std::uint32_t buffer) noexcept override;
  [[nodiscard]] Picture picture(std::uint32_t buffer) const noexcept override { return pictures_[buffer]; }
  [[nodiscard]] std::string failure() const override;

  [[nodiscard]] ClockMap clock_map() const noexcept override { return {}; }
  [[nodiscard]] Counters counters() const noexcept override;

  /// All of a buffer: what picture() shows lies within.
  [[nodiscard]] std::span<const std::uint8_t> memory(std::uint32_t buffer) const noexcept {
    return buffers_.memory(buffer);
  }

 private:
  /// A driver's refusal of a buffer may pass: it is tried again.
  [[nodiscard]] int queue(std::uint32_t buffer) noexcept;
  void queue_again() noexcept;
  [[nodiscard]] bool follow_events() noexcept;
  [[nodiscard]] bool place_picture(const v4l2_buffer& buffer) noexcept;
  [[nodiscard]] Take lose(const char* cause, int error) noexcept;
  void watch_events();

  Parts parts_;
  Buffers buffers_;
  StampKind stamp_kind_;
  std::array<Picture, Buffers::kMost> pictures_{};
  SequenceCount sequence_;
  StampLine stamps_;
  SettingsInForce in_force_;
  std::uint32_t refused_ = 0;  ///< bit i: the driver would not take buffer i back
  bool watches_node_ = false;
  bool watches_sensor_ = false;
  bool streaming_ = false;
  bool lost_ = false;
  const char* loss_ = "";  ///< why
  int loss_error_ = 0;

  CameraCounters counters_;
};

}  // namespace stereotrack::capture::v4l2
