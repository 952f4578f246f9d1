#pragma once

#include <iosfwd>
#include <string>

namespace stereotrack {

/// `stereotrack info FILE.strec`
struct InfoArguments {
  std::string recording;
};

/// Reads all of a recording and tells `out` what is in it: whose run it was and why it was written, pictures, frames,
/// gaps and damage, targets, what was late, and whether a replay gives the run's bytes. Answers the exit code: 0, or 1
/// where the file was cut or holds damaged frames. Throws std::runtime_error, one line, if it cannot be read.
int run_info(const InfoArguments& arguments, std::ostream& out);

}  // namespace stereotrack
