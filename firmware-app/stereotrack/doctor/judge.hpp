#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "firmware-app/stereotrack/doctor/findings.hpp"

namespace stereotrack::doctor {

enum class Verdict : std::uint8_t {
  kOk,
  kNote,     ///< it works, with a limit
  kProblem,  ///< it cannot run
};
[[nodiscard]] const char* to_string(Verdict verdict) noexcept;

/// One thing that was looked at.
struct Item {
  std::string topic;  ///< kernel, cpu, ...: stable, several items may have the same
  Verdict verdict = Verdict::kOk;
  std::string text;     ///< what is
  std::string way_out;  ///< what to do; empty where nothing is to be done
  std::string command;  ///< what to type, as it is; empty: nothing
};

/// What follows from what was found, in the order of the report. Pure.
[[nodiscard]] std::vector<Item> judge(const Findings& findings);

/// The worst of them. As exit code: 0 ready, 1 works with limits, 2 cannot run.
[[nodiscard]] Verdict worst_of(const std::vector<Item>& items) noexcept;
[[nodiscard]] int exit_code(Verdict verdict) noexcept;

}  // namespace stereotrack::doctor
