#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "pipeline/core/time.hpp"

namespace stereotrack::gpio {

/// Lines a program drives at most, all chips together.
inline constexpr std::size_t kMaxLines = 16;

/// Bit i: line i, in the order in which the lines were asked for. 1 = active, which is the high level unless the line
/// is active_low.
using LineBits = std::uint32_t;
static_assert(kMaxLines <= 32);

/// Where a line is, as the user writes it: CHIP:LINE.
///     CHIP   a path (/dev/gpiochip0), a name (gpiochip0), a label (pinctrl-bcm2711), or sim: no hardware, see
///            simulated_chip.hpp
///     LINE   its number on the chip, or its name there (GPIO17)
struct LineName {
  std::string chip;
  std::string line;  ///< all digits: a number
  friend bool operator==(const LineName&, const LineName&) = default;
};
/// Throws std::runtime_error with one line: what is wrong and how it is written. The last colon divides: labels such as
/// 1000.gpio:a may have their own.
[[nodiscard]] LineName parse_line_name(std::string_view text);

/// An output that is asked for.
struct LineSpec {
  LineName name;
  bool active_low = false;
  bool safe = false;  ///< active or not: driven from the request on, and again before the line is let go
  friend bool operator==(const LineSpec&, const LineSpec&) = default;
};

/// Outputs of one chip that were requested together, in the shape of libgpiod 2: what changes together leaves in one
/// system call. Levels, not states: polarity is OutputLines' business, since libgpiod 1 knows but one for all lines of
/// a request. The seam: simulated_chip.hpp, gpiod.hpp. One thread. The destructor lets the lines go as they are.
class LineRequest {
 public:
  LineRequest() = default;
  LineRequest(const LineRequest&) = delete;
  LineRequest& operator=(const LineRequest&) = delete;
  virtual ~LineRequest() = default;

  /// Drives all lines of the request; bit k is its line k, 1 = high. 0: done, else why not, an errno (ENODEV: the chip
  /// is gone). No heap, no lock, at most one system call.
  [[nodiscard]] virtual int set(LineBits high) noexcept = 0;
};

/// One line of a request: where it is on its chip, and the level that it shows from the first moment on.
struct WantedLine {
  LineName name;
  unsigned offset = 0;  ///< its number on the chip; of no meaning to the simulated chip
  bool high = false;
};

/// All outputs of the program, whatever their chips. Made by open_lines(); moves, but not while it is used.
/// One thread drives, one looks after chips that went (reopen()); metrics of any thread read.
///
/// **A chip that goes** (a USB cable is pulled) refuses with ENODEV for good: its lines are gone(). reopen() asks for
/// it anew, by the name that the user gave, as open_lines() did: with the safe states. The thread that drives takes the
/// new request over in its next set(), by exchanging a pointer, and drives what it was told; what it gives up is freed
/// by the next reopen(). A chip that refuses for another reason keeps its request and is tried again by each set().
class OutputLines {
 public:
  struct SetResult {
    LineBits changed = 0;  ///< lines that were driven to another value by this call
    LineBits failed = 0;   ///< lines whose chip refused; they are tried again by the next set()
  };
  /// What a line was last told, for metrics: consistent field by field.
  struct Reading {
    bool active = false;
    std::uint64_t transitions = 0;  ///< since the request
    MonotonicTime changed{};        ///< as told to set(); before the first transition: the clock's zero
    std::uint64_t failures = 0;     ///< calls of set() in which its chip refused
  };

  OutputLines();  ///< no lines: set() does nothing
  OutputLines(OutputLines&&) noexcept;
  OutputLines& operator=(OutputLines&&) noexcept;
  ~OutputLines();  ///< drives the safe states, then lets go

  /// Drives the lines. A chip none of whose lines change is left alone; the others get one system call each, in the
  /// order in which their first lines were asked for. No heap, no lock. `now` stands in Reading::changed and nowhere
  /// else: whoever wants to know how long setting takes reads the clock before and after.
  SetResult set(LineBits active, MonotonicTime now) noexcept;
  /// Drives all chips as they were told last: who is gone shows, though nothing changes.
  SetResult refresh(MonotonicTime now) noexcept;
  /// All lines to their safe states.
  SetResult set_safe(MonotonicTime now) noexcept;
  /// The same for ever, whatever set() asks for from now on, and whatever the lines are believed to show. For the
  /// handler of a fault, while another thread may be amid set(). False: a chip refused.
  [[nodiscard]] bool hold_safe() noexcept;

  /// Asks for chips that are gone, and frees what set() gave up. Lines that are there again, which the next set()
  /// drives; `why`, unless it is null, is told of the last chip that is not: one line. One thread, not the one that
  /// drives. Takes as long as open_lines(); throws nothing but std::bad_alloc.
  LineBits reopen(std::string* why = nullptr);

  [[nodiscard]] std::size_t size() const noexcept;
  [[nodiscard]] const LineName& name(std::size_t line) const noexcept;
  [[nodiscard]] Reading read(std::size_t line) const noexcept;  ///< any thread
  [[nodiscard]] LineBits failing() const noexcept;              ///< lines whose chip refused the last time. Any thread
  [[nodiscard]] LineBits gone() const noexcept;                 ///< of these, those that need reopen(). Any thread
  [[nodiscard]] std::uint64_t outages() const noexcept;         ///< times that a chip went. Any thread
  [[nodiscard]] int last_error() const noexcept;                ///< errno of the last refusal; 0: none. Any thread

 private:
  friend OutputLines open_lines(std::span<const LineSpec> specs, std::string_view consumer);
  struct State;
  std::unique_ptr<State> state_;
};

/// Requests the lines, one request a chip, and drives their safe states with it: no line ever shows another value.
/// `consumer` is what gpioinfo shows as the lines' user. Throws std::runtime_error with one line that names chip and
/// line and the way out (no such chip or line: which there are; busy: who holds it; no permission: which group; a build
/// without libgpiod), and for more than kMaxLines or a line named twice. All or none. Set-up only.
[[nodiscard]] OutputLines open_lines(std::span<const LineSpec> specs, std::string_view consumer);

/// What became of one line in set_lines_safe().
struct SafeOutcome {
  bool done = false;
  std::string text;  ///< one line for people that names chip and line: what was driven, or what failed and the way out
};

/// For the time after a crash: requests each line by itself, drives its safe state and lets it go. A line that fails
/// does not keep the others from theirs. One outcome a line, in their order. Throws nothing but std::bad_alloc.
[[nodiscard]] std::vector<SafeOutcome> set_lines_safe(std::span<const LineSpec> specs, std::string_view consumer);

[[nodiscard]] std::string to_string(const LineName& name);

}  // namespace stereotrack::gpio
