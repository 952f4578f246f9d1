#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "drivers/gpio/input_lines.hpp"
#include "drivers/gpio/line.hpp"

namespace stereotrack::gpio::simulated_chip {

inline constexpr std::string_view kChip = "sim";  ///< its name in CHIP:LINE

/// The chip `sim`: any line name exists on it, nothing is wired to it. For a PC, and for tests, which read here what a
/// meter at the pin would, and drive what a switch would. One a process, as a board's chip is one a board; a line in
/// use is busy for others. Levels may be read by any thread at any time; they stay after a line was let go. Who reads
/// levels or has inputs shares a lock that set() does not take.
///
/// An input is driven by drive(), or from outside of the process, where its name is a path: requesting sim:/tmp/door
/// makes a FIFO there (mode 0600), and letting it go removes it.
///     echo 1 > /tmp/door         high; 0: low; other letters mean nothing
/// A FIFO that is moved or deleted is a chip that is gone, and it is back where there is a folder for it. An input that
/// nobody has driven yet is high if its bias is kPullUp, else low. It debounces nothing.
inline constexpr std::size_t kLines = 64;      ///< names that a process may use, let go or not
inline constexpr std::size_t kKeptEdges = 16;  ///< of an input until they are read; of more, the oldest are lost

/// Level of the pin: true = high. None: no request ever named this line.
[[nodiscard]] std::optional<bool> level(std::string_view line);
/// Level changes at the pin since it was first requested.
[[nodiscard]] std::uint64_t edges(std::string_view line);

/// Drives the pin from outside, `at` this moment. False: no request ever named this line.
bool drive(std::string_view line, bool high, MonotonicTime at);

/// True: the chip goes, as far as requests are concerned that hold this line: they are refused with ENODEV from now on,
/// and so are new ones until it is back (false).
void set_gone(std::string_view line, bool gone);
/// set() of a request that holds this line is refused with this errno; 0: no more.
void set_refusing(std::string_view line, int error);

/// Throws std::runtime_error: busy, gone, or kLines are used up.
[[nodiscard]] std::unique_ptr<LineRequest> request(std::span<const WantedLine> lines, std::string_view consumer);

/// Throws std::runtime_error, besides: a FIFO that cannot be made.
[[nodiscard]] std::unique_ptr<InputRequest> request_inputs(std::span<const WantedInput> lines,
                                                           std::string_view consumer);

}  // namespace stereotrack::gpio::simulated_chip
