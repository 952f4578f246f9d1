#pragma once

#include <filesystem>
#include <iosfwd>

namespace stereotrack {

/// `stereotrack eval --truth FILE --tracks FILE [--json]`
struct EvalArguments {
  std::filesystem::path truth;   ///< MOT columns; confidence 0 = not scored
  std::filesystem::path tracks;  ///< MOT columns; may hold no row
  bool json = false;             ///< one JSON object instead of the table
};

/// Writes the scores of the tracks to `out` and answers the exit code, 0. Throws std::runtime_error,
/// one line, if a file cannot be read or `out` cannot be written.
int run_eval(const EvalArguments& arguments, std::ostream& out);

}  // namespace stereotrack
