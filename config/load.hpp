#pragma once

#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "config/configuration.hpp"
#include "config/error.hpp"
#include "config/key.hpp"

namespace stereotrack::config {

/// Something the user said: a TOML text with a name for messages, or one --set KEY=VALUE.
struct Layer {
  enum class Form : unsigned char { kToml, kOverride };
  Form form = Form::kToml;
  std::string name;  ///< kToml: the file's name
  std::string text;  ///< kToml: its content; kOverride: KEY=VALUE
};

/// Reads the file now. Throws Error if it cannot, or if it is over 1 MiB: no configuration is.
[[nodiscard]] Layer file_layer(const std::string& path);
[[nodiscard]] Layer text_layer(std::string name, std::string toml);

/// VALUE is TOML. Texts may stand without quotes, a list of texts without brackets, commas between:
/// disparity.mode=dense, telemetry.destinations=10.0.0.1:9000,10.0.0.2:9000.
[[nodiscard]] Layer override_layer(std::string key_and_value);

/// Where each key was last set: FILE:LINE:COLUMN or --set KEY=VALUE. A key not in it has its default.
using Origins = std::map<std::string, std::string, std::less<>>;

struct Loaded {
  Configuration configuration;
  Origins origins;
};

/// For what shows only later, when the calibration or the source is known: one line naming where the key
/// was set. `what` says what is wrong and the way out.
[[nodiscard]] Error error_at(const Origins& origins, std::string_view key, std::string_view what);

/// Preset, then the layers in their order: later ones win. Then the rules of rules.hpp.
/// The preset is the last `preset` key among the layers, "robust" without one; it comes first wherever
/// it is named. Every layer must be right by itself, also where a later one replaces its value.
/// Throws Error for the first thing wrong of the first layer that is: unknown key, wrong type, out of range, not
/// finite, given twice, not TOML, contradiction. Set-up only.
[[nodiscard]] Loaded load(std::span<const Layer> layers);

/// One layer onto the members that `keys` are bound to; load() is made of this. Throws Error.
void apply(const Layer& layer, std::span<const Key> keys, Origins& origins);

}  // namespace stereotrack::config
