#pragma once

#include <array>
#include <cstdint>

namespace stereotrack {

/// A grey level for each grey level.
using GreyTable = std::array<std::uint8_t, 256>;

/// pixels[x] = table[pixels[x]]. The reference is the definition, which every instruction set of
/// pipeline/core/simd.hpp equals bit for bit. About 0.1 ns a pixel. Any thread, no state.
void map_row(const GreyTable& table, int width, std::uint8_t* pixels) noexcept;
void map_row_reference(const GreyTable& table, int width, std::uint8_t* pixels) noexcept;

}  // namespace stereotrack
