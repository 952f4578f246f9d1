#pragma once

#include <span>
#include <string>

#include "drivers/gpio/line.hpp"

namespace stereotrack::gpio {

/// What a chip says of itself.
struct ChipFacts {
  std::string path;   ///< /dev/gpiochip0
  std::string name;   ///< gpiochip0
  std::string label;  ///< pinctrl-bcm2711
  unsigned lines = 0;
};

/// What it says of a line.
struct LineFacts {
  std::string name;      ///< empty: none
  bool used = false;     ///< by the kernel or a program
  std::string consumer;  ///< who uses it; empty: not told
};

/// Which of `chips` the user means: by path, by name, by label, in this order. Throws std::runtime_error with one line:
/// there is none, and which there are; or two have this label.
[[nodiscard]] const ChipFacts& choose_chip(const LineName& name, std::span<const ChipFacts> chips);

/// Which of its lines: a number is an offset, anything else a name. Throws std::runtime_error with one line: there is
/// none, and which there are; or two have this name.
[[nodiscard]] unsigned choose_line(const LineName& name, const ChipFacts& chip, std::span<const LineFacts> lines);

}  // namespace stereotrack::gpio
