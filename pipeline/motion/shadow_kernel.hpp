#pragma once

#include <cstdint>

#include "pipeline/core/image_view.hpp"

namespace stereotrack {

// The two halves of ShadowTest that look at 25 pixels each. Each function has its definition beside it,
// NAME_reference(), which every instruction set of pipeline/core/simd.hpp equals bit for bit. Any thread, no state.

/// What a pixel's 5x5 neighbourhood says, as bits; the wide ones with tolerances kWideSlack times as wide. All need the
/// background's own texture, scaled by the ratio r of the lights; kSameLook needs a shadow's ratio and chroma besides.
enum ShadowLook : std::uint8_t { kTexture = 1, kSameLook = 2, kTextureWide = 4, kSameLookWide = 8 };
inline constexpr int kWideSlack = 3;

struct LookPlanes {
  ImageView<const std::uint8_t> y;
  ImageView<const std::uint8_t> cb;  ///< empty: grey
  ImageView<const std::uint8_t> cr;
  ImageView<const std::uint8_t> y_background;
  ImageView<const std::uint8_t> cb_background;
  ImageView<const std::uint8_t> cr_background;
};
struct LookTolerances {
  int darkest_percent = 40;  ///< 1..99
  int chroma = 8;            ///< [grey levels], 0..255
  int texture = 5;           ///< [grey levels], 0..255
};

/// ShadowLook bits of pixels [from, to) of row v, written to looks[from] ...; looks has the picture's width, and after
/// `to` it may change. 5 to 30 ns a pixel.
void look_row(const LookPlanes& in, const LookTolerances& tolerances, int v, int from, int to,
              std::uint8_t* looks) noexcept;
void look_row_reference(const LookPlanes& in, const LookTolerances& tolerances, int v, int from, int to,
                        std::uint8_t* looks) noexcept;

/// Clears the set pixels of row v of the mask whose 5x5 neighbourhood of verdicts has a sum above 0; returns how many.
/// verdicts: 1 background, -1 object, 0 neither, within at least 2 rows and kVerdictFrame columns of zeros.
inline constexpr int kVerdictFrame = 64;
int clear_outvoted(ImageView<const std::int8_t> verdicts, int v, std::uint8_t* mask) noexcept;
int clear_outvoted_reference(ImageView<const std::int8_t> verdicts, int v, std::uint8_t* mask) noexcept;

}  // namespace stereotrack
