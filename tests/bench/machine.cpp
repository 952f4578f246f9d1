#include "tests/bench/machine.hpp"

#include <sys/utsname.h>

#include <fstream>
#include <opencv2/core/utility.hpp>
#include <sstream>
#include <thread>

#include "pipeline/core/simd.hpp"

namespace stereotrack::bench {

namespace {

std::string trimmed(const std::string& text) {
  const std::size_t first = text.find_first_not_of(" \t");
  return first == std::string::npos ? "" : text.substr(first, text.find_last_not_of(" \t") + 1 - first);
}

// The text behind the first line that begins with `key`, up to `end` of line.
std::string value_of(std::istream& lines, const std::string& key) {
  for (std::string line; std::getline(lines, line);) {
    const std::size_t colon = line.find(':');
    if (colon != std::string::npos && trimmed(line.substr(0, colon)) == key) return trimmed(line.substr(colon + 1));
  }
  return "";
}

std::string value_in_build_information(const std::string& key) {
  std::istringstream lines(cv::getBuildInformation());
  const std::string value = value_of(lines, key);
  return value.empty() ? "none" : value;
}

}  // namespace

Machine this_machine() {
  Machine machine;
  utsname system{};
  if (uname(&system) == 0) {
    machine.name = system.nodename;
    machine.kernel = std::string(system.sysname) + " " + system.release + " " + system.machine;
  }
  std::ifstream cpuinfo("/proc/cpuinfo");
  machine.cpu = value_of(cpuinfo, "model name");
  if (machine.cpu.empty()) {
    // ARM kernels give numbers there; boards have their name in the device tree.
    std::ifstream model("/proc/device-tree/model");
    std::getline(model, machine.cpu, '\0');
  }
  if (machine.cpu.empty()) machine.cpu = system.machine;
  machine.cores = static_cast<int>(std::thread::hardware_concurrency());
#if defined(__clang__)
  machine.compiler = __VERSION__;
#else
  machine.compiler = std::string("GCC ") + __VERSION__;
#endif
  machine.build_type = STEREOTRACK_BUILD_TYPE;
  machine.simd = to_string(simd_targets().back());
  return machine;
}

OpenCvBuild opencv_build() {
  return {cv::getVersionString(), "baseline " + value_in_build_information("Baseline") + "; dispatched " +
                                      value_in_build_information("Dispatched code generation") + "; parallel " +
                                      value_in_build_information("Parallel framework") + ", one thread; IPP " +
                                      value_in_build_information("Intel IPP")};
}

}  // namespace stereotrack::bench
