#pragma once

#include <dlfcn.h>
#include <gtest/gtest.h>
#include <poll.h>

#include <chrono>
#include <cstdlib>
#include <ctime>
#include <filesystem>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "drivers/capture/libcamera/libcamera.hpp"
#include "tests/support/temp_dir.hpp"
#include "tests/unit/libcamera/script.h"

namespace stereotrack::test {

/// SCRIPTED_MODULES is where the build puts them: good.so, and those with something wrong.
[[nodiscard]] inline std::filesystem::path scripted_module(const std::string& name) {
  return std::filesystem::path(SCRIPTED_MODULES) / (name + ".so");
}

[[nodiscard]] inline std::chrono::nanoseconds monotonic_now() {
  timespec now{};
  (void)clock_gettime(CLOCK_MONOTONIC, &now);
  return std::chrono::seconds(now.tv_sec) + std::chrono::nanoseconds(now.tv_nsec);
}

/// A folder of modules that the loader looks at first, and the scripted one in it.
class Scripted : public ::testing::Test {
 protected:
  Scripted() {
    add("9.1", "good");
    setenv("STEREOTRACK_MODULE_PATH", folder_.path().c_str(), 1);
    // The loader's own handle of the same file.
    void* const handle = dlopen(scripted_module("good").c_str(), RTLD_NOW | RTLD_LOCAL);
    const auto entry = handle == nullptr ? nullptr : reinterpret_cast<ScriptEntry>(dlsym(handle, "the_script"));
    if (entry == nullptr) throw std::runtime_error("the scripted module is not there");
    script_ = entry();
    script_->reset();
  }
  ~Scripted() override { unsetenv("STEREOTRACK_MODULE_PATH"); }

  /// The module NAME as the one of a libcamera.
  std::filesystem::path add(const std::string& soversion, const std::string& name) {
    const auto path = folder_ / ("stereotrack-libcamera-" + soversion + ".so");
    std::filesystem::create_symlink(scripted_module(name), path);
    return path;
  }

  [[nodiscard]] static capture::libcamera::Settings settings(const std::string& device) {
    capture::libcamera::Settings wish;
    wish.device = device;
    wish.width = 640;
    wish.height = 480;
    wish.fps = 30;
    return wish;
  }
  [[nodiscard]] static std::string refusal(const capture::libcamera::Settings& wish) {
    try {
      (void)capture::libcamera::open(wish);
    } catch (const std::runtime_error& error) {
      return error.what();
    }
    return {};
  }
  [[nodiscard]] static bool is_readable(const capture::Camera& camera) {
    pollfd waits{camera.descriptor(), POLLIN, 0};
    return poll(&waits, 1, 0) == 1;
  }

  test::TempDir folder_;
  Script* script_ = nullptr;
};

}  // namespace stereotrack::test
