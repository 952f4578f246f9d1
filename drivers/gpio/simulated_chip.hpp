#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "drivers/gpio/line.hpp"

namespace stereotrack::gpio::simulated_chip {

inline constexpr std::string_view kChip = "sim";  ///< its name in CHIP:LINE

/// The chip `sim`: any line name exists on it, nothing is wired to it. For a PC, and for tests, which read here what a
/// meter at the pin would. One a process, as a board's chip is one a board; a line in use is busy for others.
/// Levels may be read by any thread at any time; they stay after a line was let go. Readers share a lock that set()
/// does not take.
inline constexpr std::size_t kLines = 64;  ///< names that a process may use, let go or not

/// Level of the pin: true = high. None: no request ever named this line.
[[nodiscard]] std::optional<bool> level(std::string_view line);
/// Level changes at the pin since it was first requested.
[[nodiscard]] std::uint64_t edges(std::string_view line);
/// True: set() of a request that holds this line is refused with ENODEV, as if the chip were gone.
void set_gone(std::string_view line, bool gone);

/// Throws std::runtime_error: busy, or kLines are used up.
[[nodiscard]] std::unique_ptr<LineRequest> request(std::span<const WantedLine> lines, std::string_view consumer);

}  // namespace stereotrack::gpio::simulated_chip
