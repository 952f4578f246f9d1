#include "drivers/gpio/choice.hpp"

#include <algorithm>
#include <charconv>
#include <stdexcept>

namespace stereotrack::gpio {
namespace {

constexpr std::size_t kMostListed = 12;

[[noreturn]] void refuse(const LineName& name, const std::string& what) {
  throw std::runtime_error("GPIO line " + to_string(name) + ": " + what);
}

/// The first few, commas between.
std::string list_of(std::span<const std::string> items) {
  std::string list;
  for (std::size_t i = 0; i < std::min(items.size(), kMostListed); ++i) list += (i == 0 ? "" : ", ") + items[i];
  if (items.size() > kMostListed) list += " and " + std::to_string(items.size() - kMostListed) + " more";
  return list;
}

std::string candidates(std::span<const ChipFacts> chips) {
  if (chips.empty()) {
    return "this machine has no GPIO chip in /dev: load its driver, or write sim:NAME for a simulated line";
  }
  std::vector<std::string> items;
  for (const ChipFacts& chip : chips) {
    items.push_back(chip.name + " (label " + chip.label + ", " + std::to_string(chip.lines) + " lines)");
  }
  return "there are " + list_of(items);
}

}  // namespace

const ChipFacts& choose_chip(const LineName& name, std::span<const ChipFacts> chips) {
  for (const auto member : {&ChipFacts::path, &ChipFacts::name, &ChipFacts::label}) {
    const auto is_meant = [&](const ChipFacts& chip) { return chip.*member == name.chip; };
    const auto first = std::find_if(chips.begin(), chips.end(), is_meant);
    if (first == chips.end()) continue;
    const auto second = std::find_if(first + 1, chips.end(), is_meant);
    if (second == chips.end()) return *first;
    refuse(name, first->path + " and " + second->path + " both have this label: give the path");
  }
  refuse(name, "no such chip: " + candidates(chips));
}

unsigned choose_line(const LineName& name, const ChipFacts& chip, std::span<const LineFacts> lines) {
  unsigned offset = 0;
  const char* const end = name.line.data() + name.line.size();
  const auto [stopped, error] = std::from_chars(name.line.data(), end, offset);
  if (stopped == end && error != std::errc::invalid_argument) {
    if (error == std::errc{} && offset < lines.size()) return offset;
    refuse(name, "no such line: " + chip.path + " has " + std::to_string(lines.size()) + ", numbered from 0");
  }
  const auto is_meant = [&](const LineFacts& line) { return line.name == name.line; };
  const auto first = std::find_if(lines.begin(), lines.end(), is_meant);
  if (first == lines.end()) {
    std::vector<std::string> names;
    for (const LineFacts& line : lines) {
      if (!line.name.empty()) names.push_back(line.name);
    }
    refuse(name, "no such line: " + (names.empty() ? "the lines of " + chip.path + " have no names: give the number"
                                                   : chip.path + " has " + list_of(names) + ", or give the number"));
  }
  const auto second = std::find_if(first + 1, lines.end(), is_meant);
  if (second != lines.end()) {
    refuse(name, "lines " + std::to_string(first - lines.begin()) + " and " + std::to_string(second - lines.begin()) +
                     " of " + chip.path + " both have this name: give the number");
  }
  return static_cast<unsigned>(first - lines.begin());
}

}  // namespace stereotrack::gpio
