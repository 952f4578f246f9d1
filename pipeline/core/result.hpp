#pragma once

#include <cstdint>
#include <tl/expected.hpp>

namespace stereotrack {

/// Why a stage could not do its work. One byte, so that it travels in telemetry unchanged.
/// "No data" is not a fault: an empty result is a result.
enum class Fault : std::uint8_t {
  kOutOfMemory = 1,  ///< the arena could not give what a stage asked for at start
  kBadConfig,        ///< a stage's configuration contradicts itself or the picture size
  kBadSize,          ///< a picture's size differs from the one the stage was made for
  kBadFormat,        ///< a pixel format that the stage does not read
  kNotFinite,        ///< a NaN or an infinity reached a boundary
  kSingular,         ///< a matrix that must be inverted is not invertible
  kBadState,         ///< a block of state that is damaged, or of another version, size or configuration
};

/// One line for people. Never null.
[[nodiscard]] constexpr const char* to_string(Fault fault) noexcept {
  switch (fault) {
    case Fault::kOutOfMemory: return "out of memory at start";
    case Fault::kBadConfig: return "contradicting configuration";
    case Fault::kBadSize: return "picture of another size";
    case Fault::kBadFormat: return "pixel format not supported";
    case Fault::kNotFinite: return "value not finite";
    case Fault::kSingular: return "singular matrix";
    case Fault::kBadState: return "state damaged, or of another version or configuration";
  }
  return "unknown fault";
}

/// A value or a Fault. Look with has_value(), then take with *; .value() is banned: without
/// exceptions it is undefined behaviour on a fault.
template <class T>
using Result = tl::expected<T, Fault>;

[[nodiscard]] inline tl::unexpected<Fault> fail(Fault fault) noexcept { return tl::unexpected<Fault>(fault); }

}  // namespace stereotrack
