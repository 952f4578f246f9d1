#pragma once

#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "drivers/gpio/choice.hpp"
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

/// A chip and what it says of its lines, for people.
struct ChipListing {
  ChipFacts chip;                ///< its path alone where there is a problem
  std::vector<LineFacts> lines;  ///< by offset
  std::string problem;           ///< why it could not be asked, with the way out; empty: it could
};
/// All GPIO chips in /dev, by number, and those that could not be asked; in a build without libgpiod none. Requests
/// nothing: no line changes.
[[nodiscard]] std::vector<ChipListing> list_chips();

/// The interface of libgpiod that this build speaks: "1", "2", "none".
[[nodiscard]] std::string_view interface() noexcept;

}  // namespace stereotrack::gpio::gpiod
