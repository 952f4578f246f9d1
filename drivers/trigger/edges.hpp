#pragma once

#include <array>
#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "drivers/gpio/input_lines.hpp"
#include "drivers/trigger/trigger.hpp"
#include "pipeline/core/counter.hpp"

namespace stereotrack::trigger {

/// Somebody else's pulses, seen on an input line: the trigger that drives the cameras, wired to a line of ours, too.
/// The kernel stamps each edge with CLOCK_MONOTONIC in its interrupt (gpio/input_lines.hpp: from Linux 5.7 on).
///
/// Numbers: the line's own sequence where the interface has one (libgpiod 2, the simulated chip), so edges that the
/// kernel had to drop are a gap; libgpiod 1 has none, there a lost edge is not seen and its frames are strays.
///
/// **A chip that goes** gives no more edges; frames then pair without (StereoCameras says so). tend() asks for it anew
/// and hands the new request over by one atomic exchange; numbers go on.
class EdgeTrigger final : public Trigger {
 public:
  /// Requests the line; spec.edges is kRising or kFalling. Throws std::runtime_error, one line, as gpio::open_inputs().
  EdgeTrigger(const gpio::InputSpec& spec, std::string_view consumer);
  ~EdgeTrigger() override;

  [[nodiscard]] int descriptor() const noexcept override { return epoll_; }
  [[nodiscard]] bool take(Pulse& pulse) noexcept override;
  void tend(MonotonicTime now, std::vector<Note>& notes) override;
  [[nodiscard]] std::uint64_t lost() const noexcept override { return lost_.get(); }

 private:
  static constexpr std::size_t kBatch = 16;

  void adopt() noexcept;
  void lose(int error) noexcept;
  /// Lets the request's descriptors be waited for. Throws.
  void watch(const gpio::InputRequest& request) const;

  gpio::InputSpec spec_;
  std::string consumer_;
  int epoll_ = -1;

  // ---- Capture thread
  std::unique_ptr<gpio::InputRequest> request_;  ///< null: the chip is gone
  std::array<gpio::EdgeEvent, kBatch> events_{};
  std::size_t count_ = 0;
  std::size_t next_ = 0;
  std::uint32_t sequence_ = 0;  ///< of the last edge of this request
  std::uint64_t number_ = 0;
  Counter lost_;
  Counter taken_;

  // ---- Handed over: release where it is put, acquire where it is taken
  std::atomic<gpio::InputRequest*> incoming_{nullptr};
  std::atomic<gpio::InputRequest*> retired_{nullptr};
  std::atomic<int> error_{0};              ///< errno of the chip that went
  std::atomic<bool> probe_wanted_{false};  ///< some kernels wake nobody when a chip goes

  // ---- Service thread
  bool is_wanted_ = false;
  MonotonicTime lost_at_{};
  MonotonicTime next_try_{};
  MonotonicTime next_probe_{};
  std::uint64_t taken_before_ = 0;
  std::chrono::nanoseconds back_off_{0};
  std::string last_refusal_;
};

}  // namespace stereotrack::trigger
