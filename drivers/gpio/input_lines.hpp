#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "drivers/gpio/line.hpp"
#include "pipeline/core/time.hpp"

namespace stereotrack::gpio {

/// A change of a line's state, as logic: a line that is active_low rises when its level falls.
enum class Edge : std::uint8_t {
  kRising,   ///< it became active
  kFalling,  ///< it became inactive
};

/// Which of them are told.
enum class Edges : std::uint8_t { kRising, kFalling, kBoth };

/// What holds the level of a line that nothing drives.
enum class Bias : std::uint8_t {
  kAsIs,  ///< as the board set it up
  kNone,  ///< nothing does
  kPullUp,
  kPullDown,
};

/// An input that is asked for.
struct InputSpec {
  LineName name;
  bool active_low = false;
  Bias bias = Bias::kAsIs;
  Edges edges = Edges::kRising;
  std::chrono::microseconds debounce{0};  ///< a level counts once it was still for so long; > 0 needs libgpiod 2
  friend bool operator==(const InputSpec&, const InputSpec&) = default;
};

/// One edge that came.
struct EdgeEvent {
  std::size_t line = 0;  ///< in the order in which the lines were asked for
  Edge edge = Edge::kRising;
  /// When, on CLOCK_MONOTONIC: the kernel's stamp, taken in the interrupt's handler or, with a chip that sleeps (I2C,
  /// USB), in its thread. A simulated line's: as told to drive(), or when what was written to its FIFO was read.
  MonotonicTime time{};
  std::uint32_t sequence = 0;  ///< of the line's edges since it was requested, from 1; 0: the interface has none
  std::uint32_t lost = 0;      ///< of this line, right before this one; see InputLines
};

/// Inputs of one chip. What InputLines needs of libgpiod 1, libgpiod 2 and the simulated chip: the seam of
/// simulated_chip.hpp and gpiod.hpp. One thread. The destructor lets the lines go.
class InputRequest {
 public:
  struct ReadResult {
    std::size_t events = 0;
    int error = 0;  ///< errno of a chip that is gone or cannot be read; events that came before it are valid
  };

  InputRequest() = default;
  InputRequest(const InputRequest&) = delete;
  InputRequest& operator=(const InputRequest&) = delete;
  virtual ~InputRequest() = default;

  /// Readable while there is something to read().
  [[nodiscard]] virtual std::span<const int> descriptors() const noexcept = 0;
  /// Takes edges that came, as many as there are and fit; EdgeEvent::line is the line in this request, lost is left
  /// alone. Does not wait. No heap.
  [[nodiscard]] virtual ReadResult read(std::span<EdgeEvent> events) noexcept = 0;
  /// Asks the chip whether it is still there: 0, else an errno. No heap, one system call or two.
  [[nodiscard]] virtual int probe() noexcept = 0;
};

/// One line of a request.
struct WantedInput {
  InputSpec spec;
  unsigned offset = 0;  ///< its number on the chip; of no meaning to the simulated chip
};

/// All inputs of the program, whatever their chips. Made by open_inputs(); moves, but not while it is used.
///
///     poll(descriptor());  while ((n = read(events)) > 0) ...        as edges come
///     probe()                                                       about once a second: some kernels wake nobody
///     while (gone() != 0)  reopen()                                  now and then, by a thread that may wait
///
/// **Clock.** CLOCK_MONOTONIC. Kernels before 5.7 stamp with CLOCK_REALTIME where libgpiod 1 asks; it does not say so
/// and such a stamp jumps with the clock: open_inputs() refuses there.
///
/// **Lost edges.** The kernel keeps some edges until they are read (libgpiod 1: 16 a line, then it drops the newest; 2:
/// 64 a line, then it drops the oldest). With libgpiod 2 and the simulated chip sequence numbers show how many were
/// lost. libgpiod 1 has none: only with Edges::kBoth something shows, two edges of one kind in a row, counted as one.
///
/// **A chip that goes** (a USB cable is pulled): its lines are gone() and give no edges, those of other chips go on.
/// reopen() asks for the chip anew, by the name that the user gave; counts go on, sequences begin anew.
///
/// One thread, all of it. read() and probe(): no heap, no lock but the simulated chip's, no wait; when a chip goes, its
/// memory is freed there.
class InputLines {
 public:
  struct Reading {
    std::uint64_t events = 0;  ///< that were read
    std::uint64_t lost = 0;    ///< that were not, as far as that shows
    MonotonicTime last{};      ///< of the last event; before the first: the clock's zero
  };

  InputLines();  ///< no lines: descriptor() is -1, which poll() passes over
  InputLines(InputLines&&) noexcept;
  InputLines& operator=(InputLines&&) noexcept;
  ~InputLines();

  /// Of an epoll: readable while there is something to read, or a chip went.
  [[nodiscard]] int descriptor() const noexcept;

  /// Takes edges that came, as many as there are and fit: of one line in their order, of several in any. 0: no more.
  [[nodiscard]] std::size_t read(std::span<EdgeEvent> events) noexcept;

  /// Asks each chip whether it is there.
  void probe() noexcept;

  [[nodiscard]] LineBits gone() const noexcept;           ///< lines whose chip is, as read() and probe() found
  [[nodiscard]] std::uint64_t outages() const noexcept;   ///< times that a chip went
  [[nodiscard]] const std::string& why() const noexcept;  ///< of the last chip that went or did not come back: one line
  /// Asks for chips that are gone. Lines that came back; why() says why others did not. Takes as long as open_inputs();
  /// throws nothing but std::bad_alloc.
  LineBits reopen();

  [[nodiscard]] std::size_t size() const noexcept;
  [[nodiscard]] const LineName& name(std::size_t line) const noexcept;
  [[nodiscard]] Reading reading(std::size_t line) const noexcept;

 private:
  friend InputLines open_inputs(std::span<const InputSpec> specs, std::string_view consumer);
  struct State;
  std::unique_ptr<State> state_;
};

/// One line alone, for a thread that may neither lock nor free memory when its chip goes: the chip's own request, where
/// InputLines would look after it. Throws as open_inputs().
[[nodiscard]] std::unique_ptr<InputRequest> request_input(const InputSpec& spec, std::string_view consumer);

/// What this build and this kernel cannot do of what is asked for, whether the chips are there or not. Throws
/// std::runtime_error with one line: more than kMaxLines, a line named twice, debounce with libgpiod 1, a kernel before
/// 5.7 with it.
void check_inputs(std::span<const InputSpec> specs);

/// check_inputs(), then requests the lines. Throws std::runtime_error with one line that names chip and line and the
/// way out, as open_lines() does. All or none. Set-up only.
[[nodiscard]] InputLines open_inputs(std::span<const InputSpec> specs, std::string_view consumer);

/// Whether a kernel of this release ("6.1.0-18-arm64") stamps the edges that libgpiod 1 reads with CLOCK_MONOTONIC:
/// from 5.7 on (commit f8850206e160, "gpio: Switch timestamps to ktime_get_ns()").
[[nodiscard]] bool stamps_are_monotonic(std::string_view kernel_release) noexcept;

}  // namespace stereotrack::gpio
