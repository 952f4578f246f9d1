#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "config/configuration.hpp"
#include "config/key.hpp"
#include "config/load.hpp"

namespace stereotrack::config {

inline constexpr std::size_t kMaxZones = 16;
inline constexpr std::size_t kMaxSignals = 16;
inline constexpr std::size_t kMaxInputs = 16;
inline constexpr std::size_t kMaxCorners = 16;  ///< of a zone in the picture

/// Why this is not CHIP:LINE; empty: it is. Whether there is such a line shows when it is asked for.
[[nodiscard]] std::string check_line(std::string_view text);

/// Keys of any line: the level at which it is active, and what holds one that nothing drives.
[[nodiscard]] Key active_key(std::string_view name, ActiveLevel& member, std::string_view doc);
[[nodiscard]] Key bias_key(std::string_view name, InputBias& member, std::string_view doc);

/// Largest size of an object that may be asked for.
inline constexpr double kLargestSize_m = 1000;

/// Why this is no zone's name; empty: it is, or there is none.
[[nodiscard]] std::string check_zone_or_none(std::string_view text);

/// [[zone]], [[signal]] and [[input]], for the table in schema.cpp.
[[nodiscard]] Key zones_key(std::vector<ZoneConfig>& zones);
[[nodiscard]] Key signals_key(std::vector<SignalConfig>& signals);
[[nodiscard]] Key inputs_key(std::vector<InputConfig>& inputs);

/// Throws Error for the first zone, signal or input that contradicts itself or another, at the key that says so: names
/// and lines given twice, a line that is both driven and read, a zone that is neither in space nor in the picture, a
/// zone that there is not, a condition without its limit, a pulse without width, a rule of a zone that leaves nothing
/// to track, a working volume that is no box. Part of load().
void check_signals(const Loaded& loaded);

}  // namespace stereotrack::config
