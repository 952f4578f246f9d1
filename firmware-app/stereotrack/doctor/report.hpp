#pragma once

#include <string>
#include <vector>

#include "firmware-app/stereotrack/doctor/judge.hpp"

namespace stereotrack::doctor {

/// One screen: at most so many lines of so many columns, whatever was found. Where there is more, lines that are OK are
/// drawn together first; then it says how many are left out, and where they are.
inline constexpr int kScreenLines = 40;
inline constexpr int kScreenColumns = 100;  ///< commands are never broken, and are kept short enough
[[nodiscard]] std::string report(const Findings& findings, const std::vector<Item>& items);

/// All of it as one JSON object, keys as docs/DOCTOR.md names them.
[[nodiscard]] std::string json(const Findings& findings, const std::vector<Item>& items);

}  // namespace stereotrack::doctor
