#pragma once

#include <string>

namespace stereotrack::bench {

/// What the numbers were measured on.
struct Machine {
  std::string name;
  std::string cpu;
  int cores = 0;
  std::string kernel;
  std::string compiler;
  std::string build_type;
  std::string simd;  ///< the best target of ours that runs here
};
[[nodiscard]] Machine this_machine();

/// From OpenCV's own account of its build.
struct OpenCvBuild {
  std::string version;
  std::string build;  ///< instruction sets of the baseline and of those chosen at run time, threads, IPP
};
[[nodiscard]] OpenCvBuild opencv_build();

}  // namespace stereotrack::bench
