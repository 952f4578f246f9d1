#pragma once

#include <filesystem>
#include <iosfwd>

#include "config/load.hpp"

namespace stereotrack {

/// `stereotrack disparity LEFT RIGHT --out FILE.png [--config FILE] [--set key=value]...`
struct DisparityArguments {
  std::filesystem::path left;   ///< rectified, any format that OpenCV reads; colour becomes grey
  std::filesystem::path right;  ///< of the same size
  std::filesystem::path out;    ///< PNG, 16 bits: disparity x 256, 0 = none
};

/// Dense disparity of one rectified pair over [0, disparity.max] by disparity.method, whatever
/// disparity.mode says. 0 means none, so a true disparity of 0 is written as 1 (1/256 px).
/// FILE appears whole or not at all: it is written under a temporary name beside it and renamed.
/// Writes one line to `messages` (density, rejected by reason) and answers the exit code, 0.
/// Throws config::Error if disparity.max does not fit into the file (over 255 px); std::runtime_error, one
/// line, if a picture cannot be read, the sizes differ or the file cannot be written.
int run_disparity(const DisparityArguments& arguments, const config::Loaded& loaded, std::ostream& messages);

}  // namespace stereotrack
