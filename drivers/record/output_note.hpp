#pragma once

#include <cstdint>

#include "drivers/record/format.hpp"
#include "drivers/telemetry/encoder.hpp"

namespace stereotrack::record {

/// What a recording keeps of a message. `kind`, `state_ordinal` and `ahead_ns` are the caller's to add. No heap.
[[nodiscard]] OutputNote note_of(const telemetry::Message& message, std::uint64_t sequence) noexcept;

/// The message of a note, without its tracks, unit and focal lengths, which are the replay's own.
[[nodiscard]] telemetry::Message message_of(const OutputNote& note) noexcept;

}  // namespace stereotrack::record
