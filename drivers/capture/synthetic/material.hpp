#pragma once

#include <cstdint>

#include "drivers/capture/synthetic/shape.hpp"
#include "drivers/capture/synthetic/vec.hpp"

namespace stereotrack::capture::synthetic {

/// What a surface looks like. `a`, `b`, `c` are the material's three colours, `scale` its period [m].
enum class Pattern {
  kPlain,       ///< a, with faint mottling
  kFabric,      ///< a, with weave and folds; b below the height `split`
  kStripes,     ///< rings of a and b along y, with a thin line of c
  kUpright,     ///< bands of a and b around y
  kChecks,      ///< squares of a and b
  kPatches,     ///< camouflage of a, b, c
  kSegments,    ///< beach ball: sectors of a, b, c around y, caps of a
  kFootball,    ///< a with spots of b
  kLogo,        ///< a with a disc of b, ring and bar of c on every face
  kHazard,      ///< slanted stripes of a and b
  kCardboard,   ///< a with a tape of b and a printed label of c
  kPlanks,      ///< boards of a with dark gaps, frame of b
  kPaving,      ///< slabs of a, joints of b, stains
  kAsphalt,     ///< a with grains, patches towards b
  kBrick,       ///< bricks between a and b, mortar c
  kConcrete,    ///< panels of a with joints, holes and streaks of b
  kCorrugated,  ///< sheet metal of a in folds, lines of b, rust c
  kShutter,     ///< slats of a
  kFoliage,     ///< leaves between a and b
  kFacade,      ///< wall of a with windows of b framed by c
  kPoster,      ///< print: field a, blocks of b and c, lines of text
  kGlass,       ///< panes of b in a frame of a
};

struct Material {
  Pattern pattern = Pattern::kPlain;
  Vec3 a{0.5, 0.5, 0.5};
  Vec3 b{0.2, 0.2, 0.2};
  Vec3 c{0.8, 0.8, 0.8};
  double scale = 0.1;      ///< [m]
  std::uint32_t seed = 1;  ///< of everything irregular in it
};

/// A display colour (0..255 each) as linear light.
[[nodiscard]] Vec3 rgb(int red, int green, int blue) noexcept;

/// Smooth noise in [-1, 1] with one feature a unit; `octaves` finer ones at half amplitude each.
[[nodiscard]] double fractal_noise(double u, double v, int octaves, std::uint32_t seed) noexcept;
[[nodiscard]] double fractal_noise(Vec3 p, int octaves, std::uint32_t seed) noexcept;

/// The reflectance of a surface point, 0..1 a channel. `local`: the point in the axes of the shape,
/// `normal`: its outward normal there. 30 to 300 ns.
[[nodiscard]] Vec3 reflectance(const Material& material, const Shape& shape, Vec3 local, Vec3 normal) noexcept;

}  // namespace stereotrack::capture::synthetic
