#pragma once

#include <string>
#include <vector>

#include "config/configuration.hpp"
#include "config/key.hpp"

namespace stereotrack::config {

/// Every key there is, bound to `configuration`, which must outlive the result and not move.
/// The one table: the parser, --set, the validator, the sample and to_text() all come from it.
[[nodiscard]] std::vector<Key> keys_of(Configuration& configuration);

/// The effective configuration as TOML, every key. load() of this text gives the same values.
[[nodiscard]] std::string to_text(const Configuration& configuration);

/// The content of config/stereotrack.sample.toml: every key with its default, range, unit and meaning.
/// After a change of the table: cmake --build build/release --target update_sample_config
[[nodiscard]] std::string sample_text();

}  // namespace stereotrack::config
