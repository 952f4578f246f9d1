#pragma once

#include <stdexcept>

namespace stereotrack::config {

/// What the user said cannot be used. what() is one line: where (FILE:LINE:COLUMN or --set KEY=VALUE),
/// which key, what is wrong and the way out. A program that catches it exits with 2.
class Error : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

}  // namespace stereotrack::config
