#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "drivers/capture/synthetic/random.hpp"
#include "drivers/capture/synthetic/shape.hpp"
#include "drivers/capture/synthetic/vec.hpp"

namespace stereotrack::capture::synthetic {

/// Wind that comes in gusts: waves of about 7.3, 3.7 and 1.9 s that travel with it at 4 m/s.
struct Wind {
  Vec3 towards{1, 0, 0};  ///< unit, level
  double phase = 0;       ///< [rad]

  /// How strong it is at a place: 0.05 (calm) to 1.05.
  [[nodiscard]] double strength(Vec3 place, double t_s) const noexcept;
};

/// A leaf, or a patch of cloth, as it hangs at one moment. `shape.material` has no meaning.
struct PosedLeaf {
  Shape shape;
  Vec3 upper;       ///< reflectance of the side of local +y
  Vec3 under;       ///< and of the other
  double open = 1;  ///< the part of the skylight that its neighbours leave to it
  double lit = 1;   ///< the same of the sun
};

/// All leaves at one moment, and what they shade.
struct PosedFoliage {
  std::vector<PosedLeaf> leaves;
  std::vector<std::size_t> clump_ends;  ///< leaves come in clumps: one past the last of each
  std::vector<Shape> shades;            ///< spheres whose shadow on the floor is about that of the leaves
};

/// Plants and a flag that wave in the wind: background that moves.
///
/// A plant is made of clumps, balls of some hundred leaves around a dark core. With the wind g at its place a clump
/// swings by
///     along  = give g (0.7 + 0.45 sin(2 pi rate t + p1)),   across = 0.4 give g sin(0.83 2 pi rate t + p2)
/// and each leaf in it trembles and turns about its own axis, so that it shows more or less of its upper, darker and
/// its paler under side: both its place and its colour change. A flag is strips of three colours through which a wave
/// runs from the pole outwards. pose() is a function of the time alone; about 0.3 us a leaf.
class Foliage {
 public:
  static constexpr std::size_t kMostLeaves = 30000;

  struct Plant {
    Vec3 center;
    Vec3 radii;  ///< of the ellipsoid that its clumps fill
    int clumps = 10;
    double clump_radius = 0.4;
    int leaves = 100;  ///< a clump
    Vec3 leaf_half{0.07, 0.008, 0.045};
    double give_m = 0.1;  ///< of its outer clumps; the inner ones move less
    Vec3 upper;
    Vec3 under;
  };
  struct Flag {
    Vec3 top;  ///< where its upper edge meets the pole
    double width = 1.1;
    double height = 0.7;
    std::array<Vec3, 3> colours;  ///< bands, from above
  };

  Foliage() = default;
  explicit Foliage(const Wind& wind) : wind_(wind) {}

  void plant(const Plant& plant, Vec3 to_sun, Random& random);
  void raise(const Flag& flag) { flag_ = flag; }

  void pose(double t_s, PosedFoliage& out) const;
  /// Centres of the clumps at rest.
  [[nodiscard]] std::vector<Vec3> clumps() const;

 private:
  struct Leaf {
    Vec3 offset;  ///< from the clump's centre
    Axes axes;
    Vec3 half;
    Vec3 upper;
    Vec3 under;
    double open = 1;
    double lit = 1;
    double follows = 1;  ///< the part of the clump's swing
    double rate_hz = 3;
    double phase = 0;
    double flutter = 0.5;  ///< [rad]
  };
  struct Clump {
    Vec3 center;
    double radius = 0;
    double give_m = 0;
    double rate_hz = 1;
    double along_phase = 0;
    double across_phase = 0;
    std::vector<Leaf> leaves;
    std::vector<Vec3> shades;  ///< from the centre
  };
  void pose_flag(double t_s, PosedFoliage& out) const;

  Wind wind_;
  std::vector<Clump> clumps_;
  std::optional<Flag> flag_;
};

}  // namespace stereotrack::capture::synthetic
