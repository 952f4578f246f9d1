#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "drivers/capture/synthetic/scene.hpp"

namespace stereotrack::capture::synthetic {

inline constexpr std::size_t kSamples = 4;  ///< rays a pixel for what moves
inline constexpr float kSkyDepth = 1e6F;    ///< [m]

/// Where a pixel's four rays go: a rotated grid, every row and column of a 4 x 4 grid once.
inline constexpr std::array<Offset, kSamples> kOffsets{
    {{-0.125, -0.375}, {0.375, -0.125}, {-0.375, 0.125}, {0.125, 0.375}}};

/// A direction into the sun's disc for ray `sample` of kOffsets, unit.
[[nodiscard]] Vec3 into_sun(const Light& light, std::size_t sample) noexcept;

/// Skylight on a surface with this normal, nothing in the way.
[[nodiscard]] inline Vec3 skylight(const Light& light, Vec3 normal) noexcept {
  return mix(light.bounce, light.sky, 0.5 + 0.5 * normal.y);
}

/// What stands still, per pixel of a camera. Light is kept in parts, so that a shadow or a cloud only weighs them.
struct StillPicture {
  std::vector<float> sky_light;     ///< 3: reflected skylight
  std::vector<float> sun_light;     ///< 3: reflected sunlight
  std::vector<float> lamp_light;    ///< 3: reflected light of the lamp; empty without one
  std::vector<float> normal;        ///< 3: world
  std::vector<float> center_depth;  ///< at the pixel's centre [m]; kSkyDepth where nothing is
  std::vector<float> depth;         ///< kSamples

  void resize(const Scene& scene, const PinholeCamera& camera);
};

/// Casts it with 13 rays a pixel, or with 5. Two threads; the same numbers as one.
enum class StillRays { kThirteen, kFive };
void cast_still(const Scene& scene, const PinholeCamera& camera, StillRays rays, StillPicture& out);

/// What stands still as a camera sees it that turns a little, as on a swaying mast.
///
/// Cast once at rest, on a grid of half pixels with a margin, and read from there for each turned camera: where its ray
/// meets the scene follows from the depth that the camera at rest sees there, so that a camera that moves by some
/// millimetres as it turns is drawn as it must be but for what newly comes into view (under 0.1 px).
///     light = mean over a pixel (2 x 2 of the grid), linear between its places;   depth, normal: nearest (1/4 px)
/// read() costs about 25 ms at 640 x 480; memory 270 bytes a pixel.
class TurnableStill {
 public:
  TurnableStill(const Scene& scene, const PinholeCamera& rest);

  /// `turned`: like the camera at rest, with its axes turned by less than about 1/100 [rad].
  void read(const PinholeCamera& turned, StillPicture& out) const noexcept;

 private:
  PinholeCamera rest_;
  PinholeCamera fine_;         ///< two pixels a pixel, and the margin
  std::size_t floats_ = 6;     ///< a place: sky, sun, and lamp if there is one
  std::vector<float> light_;   ///< at the corners of fine pixels: mean of the four around
  std::vector<float> normal_;  ///< 3
  std::vector<float> depth_;
};

}  // namespace stereotrack::capture::synthetic
