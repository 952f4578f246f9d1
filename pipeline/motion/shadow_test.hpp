#pragma once

#include <cstdint>

#include "pipeline/core/arena.hpp"
#include "pipeline/core/image_view.hpp"
#include "pipeline/core/result.hpp"

namespace stereotrack {

/// Shadow and light of the robust preset: foreground pixels that are the background, only lit differently.
///
/// Photometric evidence, per pixel. With r = Y / Y_background, the ratio of the lights:
///     0.05 <= r < 0.95                        darker, not black (shadow only; lights are left to stereo)
///     |C - 128 - r (C_background - 128)| <= chroma tolerance, C in {Cb, Cr}
///     mean over 5x5 of |Y - r5 Y_background| <= texture tolerance + noise,  r5 = sum Y / sum Y_background
/// the last says that the background's own texture is still there, only scaled.
///
/// Stereo evidence, where both disparities are known: the present disparity is the background's own within
/// disparity_px. Stereo knows better: a pixel whose disparity differs is object, whatever it looks like; a
/// pixel with the background's disparity and texture is shadow or light. Without disparity the photometric test
/// decides, if photometric_alone.
///
/// The decision is then a majority vote over 5x5 foreground pixels, so that no object is riddled.
/// In: planes of one size; empty cb, cr for grey; empty disparities for mono. O(foreground x 25).
/// One instance a thread.
class ShadowTest {
 public:
  struct Config {
    int darkest_percent = 5;        ///< smallest ratio of a shadow [%], 1..99
    int chroma_tolerance = 8;       ///< [grey levels], 0..255
    int texture_tolerance = 5;      ///< [grey levels], 0..255
    double disparity_px = 1.0;      ///< disparities this near are the same [px], 0..16
    bool photometric_alone = false; ///< remove on appearance alone where stereo says nothing
  };

  struct Input {
    ImageView<const std::uint8_t> y;
    ImageView<const std::uint8_t> cb;
    ImageView<const std::uint8_t> cr;
    ImageView<const std::uint8_t> y_background;
    ImageView<const std::uint8_t> cb_background;
    ImageView<const std::uint8_t> cr_background;
    ImageView<const std::uint16_t> disparity;             ///< 1/16 px, kNoDisparity where unknown
    ImageView<const std::uint16_t> disparity_background;  ///< the same of the background
  };

  /// Faults: kBadConfig, kBadSize, kOutOfMemory.
  [[nodiscard]] static Result<ShadowTest> create(const Config& config, int width, int height, Arena& arena) noexcept;

  /// Clears the pixels of `mask` (255 = foreground) that are shadow or light; returns how many.
  std::uint32_t run(const Input& in, ImageView<std::uint8_t> mask) noexcept;

 private:
  enum Evidence : std::uint8_t { kOutside = 0, kObject = 1, kShadow = 2 };
  [[nodiscard]] bool looks_shadowed(const Input& in, int x, int y) const noexcept;
  [[nodiscard]] Evidence judge(const Input& in, int x, int y) const noexcept;

  Config config_;
  ImageView<std::uint8_t> evidence_;
};

}  // namespace stereotrack
