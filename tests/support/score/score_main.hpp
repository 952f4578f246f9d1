#pragma once

#include <CLI/CLI.hpp>
#include <exception>
#include <iostream>
#include <string>
#include <utility>
#include <vector>

namespace stereotrack::score {

/// Figures in the order in which they are told, as lines for people or one JSON object.
/// Values are JSON literals already: numbers, "null", or arrays of them.
using Figures = std::vector<std::pair<std::string, std::string>>;

inline void write(const Figures& figures, bool json, std::ostream& out) {
  std::size_t width = 0;
  for (const auto& figure : figures) width = std::max(width, figure.first.size());
  const char* before = "{\n";
  for (const auto& [name, value] : figures) {
    if (json) {
      out << before << "  \"" << name << "\": " << value;
      before = ",\n";
    } else {
      out << name << std::string(width + 2 - name.size(), ' ') << value << '\n';
    }
  }
  if (json) out << "\n}\n";
}

/// Parses, runs `tell` and writes its figures: exit code 0, 1 if it failed, 2 for bad usage.
template <class Tell>
int score_main(CLI::App& app, int argc, char** argv, Tell tell) {
  bool json = false;
  app.add_flag("--json", json, "One JSON object instead of lines");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  try {
    write(tell(), json, std::cout);
    return 0;
  } catch (const std::exception& error) {
    std::cerr << app.get_name() << ": " << error.what() << '\n';
    return 1;
  }
}

}  // namespace stereotrack::score
