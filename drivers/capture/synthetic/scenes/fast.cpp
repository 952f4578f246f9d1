#include "drivers/capture/synthetic/scenes/fast.hpp"

#include <optional>
#include <utility>
#include <vector>

#include "drivers/capture/synthetic/random.hpp"
#include "drivers/capture/synthetic/scenes/acts.hpp"
#include "drivers/capture/synthetic/scenes/yard.hpp"

namespace stereotrack::capture::synthetic {
namespace {

constexpr double kPrelude_s = 6.0;
constexpr double kLastExit_s = 25.0;
constexpr int kThrows = 10;
constexpr std::uint32_t kIds = kThrows + 2;

class Casting : private Troupe {
 public:
  Casting(const Scene& yard, const Wardrobe& wardrobe, const std::vector<int>& prints, std::uint64_t key)
      : Troupe(yard, wardrobe, key, {-kPrelude_s, kLastExit_s}), rig_(yard.rig), prints_(prints) {}

  std::optional<std::vector<Actor>> draw() {
    for (int i = 0; i < kThrows; ++i) {
      if (!place([&] { return ball(1.8 + 2.05 * i + at(-0.4, 0.4), i % 5 == 1 || i % 5 == 3); })) return std::nullopt;
    }
    if (!walker(wear_.tall) || !walker(wear_.bystander)) return std::nullopt;
    return cast_;
  }

 private:
  /// Its centre passes the middle of the picture about then.
  Actor ball(double when_s, bool bounces) {
    const double radius = random_.chance(0.5) ? 0.11 : 0.075;
    const auto print = static_cast<std::size_t>(random_.below(static_cast<int>(prints_.size())));
    Actor a = base(ActorKind::kBouncingBall, {radius, 0, 0}, {prints_[print], 0, 0, 0, 0});
    const double z = at(5.6, 8.0);
    const double depth = rig_.cos_pitch * z + rig_.sin_pitch * (rig_.height_m - 0.8);
    const double px_a_frame = at(41.0, 48.0);
    const double speed = px_a_frame * 30.0 * depth / (rig_.focal_widths * 640.0);
    const double side = random_.sign();
    const double edge = off_stage(z, 0.3);
    Path::Timing timing;
    timing.speed_m_s = speed;
    // It leaves the floor when it sets out. A throw comes down beyond the other side; what bounces does so underway.
    const double crossing_s = 2.0 * edge / speed;
    const double flight_s = bounces ? crossing_s * at(0.34, 0.62) : crossing_s * at(1.05, 1.5);
    constexpr double kGravity = 9.81;
    a.throw_height = kGravity * flight_s * flight_s / 8.0;
    timing.start_s = when_s - 0.5 * crossing_s;
    const double drift = at(-0.25, 0.25);
    a.path = Path({{side * edge, 0, z}, {0, 0, z + 0.5 * drift}, {-side * edge, 0, z + drift}}, timing);
    return a;
  }

  bool walker(const std::array<int, 5>& wears) {
    return place([&] {
      Actor a = base(ActorKind::kWalker, {at(1.6, 1.86), 0, 0}, wears);
      a.path =
          enter({across({random_.sign(), {at(6, 8.8), at(6, 8.8), at(6, 8.8)}, 0.5}), at(2.0, 14.0), at(1.1, 1.4)});
      return a;
    });
  }

  const Rig& rig_;
  const std::vector<int>& prints_;
};

}  // namespace

Scene make_fast(std::uint64_t seed) {
  Scene scene;
  scene.name = "fast";
  scene.seed = seed;
  scene.shutter_s = 1.0 / 60.0;
  Random random(seed * 1000003ULL + 1009);
  build_yard(scene, random);
  const Wardrobe wardrobe = make_wardrobe(scene, random);
  const std::vector<int> prints{wardrobe.football, wardrobe.small_ball, wardrobe.beach_ball};
  hold_acts(
      scene, {kLastExit_s + kPrelude_s, kPrelude_s, 1009, kIds},
      [wardrobe, prints](const Scene& yard, std::uint64_t key) { return Casting(yard, wardrobe, prints, key).draw(); });
  return scene;
}

}  // namespace stereotrack::capture::synthetic
