#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace stereotrack::config {

/// A file of config/presets, compiled in: an installed program needs no search path.
struct Preset {
  std::string_view name;  ///< file name without .toml
  std::string_view text;  ///< its content
};

/// All of them, by name.
[[nodiscard]] std::span<const Preset> presets();

[[nodiscard]] std::vector<std::string> preset_names();

}  // namespace stereotrack::config
