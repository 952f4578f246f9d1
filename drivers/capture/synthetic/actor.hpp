#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "drivers/capture/synthetic/path.hpp"
#include "drivers/capture/synthetic/shape.hpp"

namespace stereotrack::capture::synthetic {

/// What can move through a scene.
enum class ActorKind {
  kBall,          ///< rolls on the floor
  kBouncingBall,  ///< thrown: parabolas, each bounce weaker
  kCrate,         ///< a box that turns about the vertical as it glides
  kRobot,         ///< an upright cylinder with a dome, glides and turns
  kCart,          ///< a low trolley with a load, a handle and wheels that roll
  kWalker,        ///< a person: swinging legs and arms, feet on the floor
  kDog,           ///< four legs
  kDrone,         ///< flies: body, arms, rotors
};

/// One moving object: what it is, how big, what it wears and the way it takes.
struct Actor {
  std::uint32_t id = 0;
  ActorKind kind = ActorKind::kBall;
  Path path;
  Vec3 size{1, 1, 1};  ///< ball: radius; crate, cart: half width, height, half length; others: height, in x [m]
  std::array<int, 5> materials{};  ///< what is which: see actor.cpp
  double spin = 0;                 ///< turn about the vertical [rad/s]
  double phase = 0;                ///< of gait or turn at the start [rad]
  double throw_height = 0;         ///< of a bouncing ball's first top [m]
  /// Until then it has never moved since frame 1: nobody can tell it from what stands still [s].
  double undecided_until_s = -1e9;

  /// Radius of the disc on the floor that it needs, for keeping out of each other's way [m].
  [[nodiscard]] double footprint() const noexcept;
  /// No point of it is higher than this above its place on the path [m].
  [[nodiscard]] double height() const noexcept;
};

/// An actor at one moment.
struct PosedActor {
  std::uint32_t id = 0;
  bool undecided = false;  ///< has not moved yet
  std::vector<Shape> shapes;
  std::vector<Shape> contacts;  ///< spheres that keep skylight from the floor beneath
  Vec3 center;                  ///< of a sphere around all shapes
  double radius = 0;
};

/// Where `actor` is at time t and how it holds its limbs. False when it is not on its way then.
bool pose(const Actor& actor, double t_s, PosedActor& out);

}  // namespace stereotrack::capture::synthetic
