#pragma once

#include <cstdint>

namespace stereotrack {

// Rows of gray() and chroma(). Each has its definition beside it, NAME_reference(), which every instruction set of
// pipeline/core/simd.hpp equals bit for bit. bgr: 3 width bytes. 0.05 to 0.1 ns a pixel. Any thread, no state.

/// Luma (3.1) of a row.
void luma_row(const std::uint8_t* bgr, int width, std::uint8_t* luma) noexcept;
void luma_row_reference(const std::uint8_t* bgr, int width, std::uint8_t* luma) noexcept;

/// Chroma (3.18, 3.19) of a row, given its luma.
void chroma_row(const std::uint8_t* bgr, const std::uint8_t* luma, int width, std::uint8_t* cb,
                std::uint8_t* cr) noexcept;
void chroma_row_reference(const std::uint8_t* bgr, const std::uint8_t* luma, int width, std::uint8_t* cb,
                          std::uint8_t* cr) noexcept;

}  // namespace stereotrack
