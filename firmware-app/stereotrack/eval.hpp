#pragma once

#include <cstdint>
#include <filesystem>
#include <iosfwd>

namespace stereotrack {

/// `stereotrack eval --truth FILE --tracks FILE [--fps N] [--frames N] [--focal-baseline N] [--json]`
struct EvalArguments {
  std::filesystem::path truth;   ///< MOT columns; confidence 0 = not scored
  std::filesystem::path tracks;  ///< MOT columns; may hold no row
  bool json = false;             ///< one JSON object instead of the table
  double fps = 30;               ///< for what goes by time: velocities, false tracks a minute
  std::int64_t frames = 0;       ///< of the sequence; 0: up to the last that a file names
  double focal_baseline = 0;     ///< f b [px times the files' unit]; 0: errors are not compared with the geometry's
};

/// Writes the scores of the tracks to `out` and answers the exit code, 0. Throws std::runtime_error,
/// one line, if a file cannot be read or `out` cannot be written.
int run_eval(const EvalArguments& arguments, std::ostream& out);

}  // namespace stereotrack
