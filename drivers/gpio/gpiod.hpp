#pragma once

#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "drivers/gpio/input_lines.hpp"
#include "drivers/gpio/line.hpp"

namespace stereotrack::gpio::gpiod {

/// A line of a chip in /dev, found.
struct Found {
  std::string path;     ///< of the chip, without links: one path a chip
  unsigned offset = 0;  ///< of the line on it
};

/// Looks the line up. Throws std::runtime_error with one line: no such chip or line and which there are, no permission,
/// not a GPIO chip; in a build without libgpiod always.
[[nodiscard]] Found find(const LineName& name);

/// Lines of the one chip at `path`. Throws std::runtime_error: busy and who holds the line, no permission, not an
/// output.
[[nodiscard]] std::unique_ptr<LineRequest> request(const std::string& path, std::span<const WantedLine> lines,
                                                   std::string_view consumer);

/// The same for inputs with their edges.
[[nodiscard]] std::unique_ptr<InputRequest> request_inputs(const std::string& path, std::span<const WantedInput> lines,
                                                           std::string_view consumer);

/// The interface of libgpiod that this build speaks: "1", "2", "none".
[[nodiscard]] std::string_view interface() noexcept;

}  // namespace stereotrack::gpio::gpiod
