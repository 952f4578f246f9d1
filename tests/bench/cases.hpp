#pragma once

#include <map>
#include <string>

#include "tests/bench/report.hpp"

namespace stereotrack::bench {

struct Plan {
  int frames = 200;   ///< timed calls of each contestant; a third of them at 1280x800 when quick
  int warm_up = 100;  ///< untimed ones before, in which backgrounds are learnt
  bool quick = false;
  /// By contestant, counted by another run of this program: taken where the CPU gave no count.
  std::map<std::string, double> instructions;
  std::string counted_on;  ///< its best SIMD target
};

/// What a contestant of a contest took, with instructions that were counted elsewhere.
[[nodiscard]] Side side_of(const Measured& measured, const Plan& plan);

/// Results of ours against the naive ones, on every pixel and with every SIMD target. Answers what was found equal.
/// Throws std::runtime_error that names the first difference.
[[nodiscard]] std::vector<std::string> check_matchers();

/// The matchers alone, on a rectified pair of synthetic:eleven, 640x480 with 64 disparities.
void measure_matchers(const Plan& plan, const InstructionCounter& counter, Report& report);

/// Whole pipelines on frames of synthetic:eleven at three sizes, and on 1 and 64 moving squares.
void measure_pipelines(const Plan& plan, const InstructionCounter& counter, Report& report);

}  // namespace stereotrack::bench
