#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <type_traits>

#include "pipeline/core/checksum.hpp"
#include "pipeline/core/result.hpp"

namespace stereotrack {

/// Moves on with whatever a stage adds to, takes from or reorders in its visit_state().
inline constexpr std::uint32_t kStateVersion = 1;

/// A block of state: this header, then the bytes of pipeline/core/state.hpp, all little-endian.
struct StateHeader {
  std::array<char, 8> magic{'s', 't', 'r', 's', 't', 'a', 't', 'e'};
  std::uint32_t version = kStateVersion;
  std::uint32_t reserved = 0;
  std::uint64_t fingerprint = 0;  ///< of the configuration that gives the state its form
  std::uint64_t bytes = 0;        ///< of the block, this header included
  std::uint64_t sum = 0;          ///< checksum() of all bytes behind the header; 0 before seal_state()
};
static_assert(sizeof(StateHeader) == 40 && std::is_trivially_copyable_v<StateHeader>);
static_assert(std::endian::native == std::endian::little);

/// Writes the checksum of a block whose bytes are all there. Any thread. Fault: kBadState, no block.
[[nodiscard]] inline Result<void> seal_state(std::span<std::byte> block) noexcept {
  StateHeader header;
  if (block.size() < sizeof header) return fail(Fault::kBadState);
  std::memcpy(&header, block.data(), sizeof header);
  if (header.magic != StateHeader().magic || header.bytes != block.size()) return fail(Fault::kBadState);
  header.sum = checksum(block.subspan(sizeof header));
  std::memcpy(block.data(), &header, sizeof header);
  return {};
}

/// The state's bytes, if the block is whole, of this version and of that configuration. Fault: kBadState.
[[nodiscard]] inline Result<std::span<const std::byte>> open_state(std::span<const std::byte> block,
                                                                   std::uint64_t fingerprint) noexcept {
  StateHeader header;
  if (block.size() < sizeof header) return fail(Fault::kBadState);
  std::memcpy(&header, block.data(), sizeof header);
  const std::span<const std::byte> body = block.subspan(sizeof header);
  if (header.magic != StateHeader().magic || header.version != kStateVersion || header.fingerprint != fingerprint ||
      header.bytes != block.size() || header.sum != checksum(body)) {
    return fail(Fault::kBadState);
  }
  return body;
}

}  // namespace stereotrack
