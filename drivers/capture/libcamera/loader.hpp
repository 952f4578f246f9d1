#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "drivers/capture/libcamera/module.h"

namespace stereotrack::capture::libcamera {

/// "stereotrack-libcamera-0.5.so".
inline constexpr const char* kModulePrefix = "stereotrack-libcamera-";

/// Where modules may be: see libcamera.hpp. In the order in which they are looked at; need not exist.
[[nodiscard]] std::vector<std::filesystem::path> module_folders();

/// Modules in these folders: folder by folder, in each the newest libcamera first, by the numbers in their names.
[[nodiscard]] std::vector<std::filesystem::path> find_modules(const std::vector<std::filesystem::path>& folders);

/// A module that fits, and why others do not.
struct Loaded {
  const LibcameraModule* module = nullptr;  ///< null: none
  std::filesystem::path path;
  std::vector<std::string> problems;  ///< of those that were tried before, or that there is none: one line each
};

/// Tries them in turn. A module that fits stays loaded until the process ends: libcamera is not made to be unloaded.
[[nodiscard]] Loaded load_module(const std::vector<std::filesystem::path>& folders);

/// libcamera, as this process sees it: one manager, shared by all who have it open. One thread at a time.
class Session {
 public:
  /// The one that is open, or a new one. Null: no module, or it does not start; `problems` says why, one line each.
  [[nodiscard]] static std::shared_ptr<Session> get(std::vector<std::string>& problems);
  Session(const Session&) = delete;
  Session& operator=(const Session&) = delete;
  ~Session();

  [[nodiscard]] const LibcameraModule& module() const noexcept { return *loaded_.module; }
  [[nodiscard]] LibcameraManager* manager() const noexcept { return manager_; }
  /// "libcamera v0.0.3, /usr/local/lib/stereotrack/stereotrack-libcamera-0.0.3.so".
  [[nodiscard]] std::string module_text() const;
  /// The last that libcamera complained of while it looked for cameras; empty: of nothing.
  [[nodiscard]] std::string complaint() const;
  /// Why other modules were not taken.
  [[nodiscard]] const std::vector<std::string>& problems() const noexcept { return loaded_.problems; }

  /// Cameras that there are now; their places are the numbers that the module knows them by.
  [[nodiscard]] std::vector<LibcameraFacts> cameras() const;
  [[nodiscard]] std::vector<LibcameraFormat> formats(std::uint32_t camera) const;

 private:
  explicit Session(Loaded loaded) : loaded_(std::move(loaded)) {}

  Loaded loaded_;
  LibcameraManager* manager_ = nullptr;
};

}  // namespace stereotrack::capture::libcamera
