#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "config/load.hpp"

namespace stereotrack::config {

/// Values that are good each by itself and contradict each other.
struct Rule {
  std::string_view name;                        ///< for messages and tests
  std::vector<std::string_view> keys;           ///< that it looks at
  std::string (*broken)(const Configuration&);  ///< what is wrong and the way out; empty if the rule holds
};

[[nodiscard]] std::span<const Rule> rules();

/// Throws Error for the first rule broken. The line starts where the user set one of its keys and tells
/// where the others came from.
void check_rules(const Loaded& loaded);

/// Throws Error for the first key with unit m or m/... whose value is not 0 while a metre is not known:
/// unit_m [m per unit of T] is 0. Not part of load(), because some formats of calibration files say their
/// unit: call it when the calibration is read, with its unit or calibration.unit_m.
void check_metres(const Loaded& loaded, double unit_m);
void check_metres(std::span<const Key> keys, const Origins& origins, double unit_m);

}  // namespace stereotrack::config
