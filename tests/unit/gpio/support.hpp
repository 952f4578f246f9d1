#pragma once

#include <cstddef>
#include <exception>
#include <span>
#include <string>

#include "drivers/gpio/line.hpp"

namespace stereotrack::gpio {

/// What a call throws; empty: nothing.
template <class Call>
std::string refusal_of(const Call& call) {
  try {
    call();
  } catch (const std::exception& error) {
    return error.what();
  }
  return {};
}

inline std::string numbered(std::string name, std::size_t number) { return name.append(std::to_string(number)); }

inline std::string open_refusal(std::span<const LineSpec> specs) {
  return refusal_of([&] { static_cast<void>(open_lines(specs, "test")); });
}

}  // namespace stereotrack::gpio
