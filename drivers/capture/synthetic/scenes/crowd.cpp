#include "drivers/capture/synthetic/scenes/crowd.hpp"

#include <array>
#include <optional>
#include <utility>
#include <vector>

#include "drivers/capture/synthetic/random.hpp"
#include "drivers/capture/synthetic/scenes/acts.hpp"
#include "drivers/capture/synthetic/scenes/yard.hpp"

namespace stereotrack::capture::synthetic {
namespace {

constexpr double kPrelude_s = 7.0;
constexpr double kLastExit_s = 27.0;
constexpr int kAtPeak = 45;  ///< by the survey, which counts what the picture's edge cuts as it is
constexpr std::size_t kLanes = 8;
constexpr double kFirstLane_z = 3.9;
constexpr double kLane_m = 0.78;  ///< from one lane to the next
/// How near they come beyond the discs that they need [m]: arms and legs swing along the lanes.
constexpr double kGap_m = -0.1;

class Casting : private Troupe {
 public:
  Casting(const Scene& yard, const std::array<Wardrobe, 3>& wardrobes, std::uint64_t key)
      : Troupe(yard, wardrobes[0], key, {-kPrelude_s, kLastExit_s}), wardrobes_(wardrobes) {}

  /// The large ones first: they find no way later.
  std::optional<std::vector<Actor>> draw() {
    for (Lane& lane : lanes_) lane = {random_.sign(), at(0.62, 0.95)};
    const auto several = [&](int count, auto make) {
      for (int i = 0; i < count; ++i) {
        if (!place([&] { return make(i); }, kGap_m, 400)) return false;
      }
      return true;
    };
    const bool all = several(2, [&](int) { return crate(); }) && several(3, [&](int i) { return cart(i); }) &&
                     several(4, [&](int i) { return robot(i); }) && several(24, [&](int i) { return person(i); }) &&
                     several(6, [&](int i) { return dog(i); }) && several(9, [&](int i) { return ball(i); }) &&
                     several(4, [&](int i) { return drone(i); });
    if (!all) return std::nullopt;
    return cast_;
  }

 private:
  struct Lane {
    double side = 1;     ///< from which they come
    double speed = 0.8;  ///< of nearly everybody in it [m/s]
  };
  /// Along a lane, with a small bend.
  Path cross(double reach, double pause_s) {
    const auto which = static_cast<std::size_t>(random_.below(static_cast<int>(kLanes)));
    const Lane& lane = lanes_[which];
    const double z = kFirstLane_z + kLane_m * static_cast<double>(which);
    return enter({across({lane.side, {z, z + at(-0.1, 0.1), z}, reach}), at(-4.0, 6.0), lane.speed * at(0.97, 1.03),
                  at(1.5, 5.0), pause_s});
  }
  const Wardrobe& wardrobe(int i) const { return wardrobes_[static_cast<std::size_t>(i) % wardrobes_.size()]; }

  Actor person(int i) {
    const Wardrobe& w = wardrobe(i);
    const std::array<const std::array<int, 5>*, 3> outfits{&w.tall, &w.bystander, &w.child};
    const auto which = static_cast<std::size_t>(i / 3) % 3;
    const double height = which == 2 ? at(1.12, 1.4) : at(1.58, 1.88);
    Actor a = base(ActorKind::kWalker, {height, 0, 0}, *outfits[which]);
    a.path = cross(0.5, i < 3 ? at(1.6, 3.6) : 0.0);
    return a;
  }
  Actor dog(int i) {
    Actor a = base(ActorKind::kDog, {at(0.5, 0.66), 0, 0}, wardrobe(i).dog);
    a.path = cross(0.6, 0);
    return a;
  }
  Actor ball(int i) {
    const Wardrobe& w = wardrobe(i / 3);
    const std::array<int, 3> prints{w.beach_ball, w.football, w.small_ball};
    Actor a = base(ActorKind::kBall, {at(0.12, 0.26), 0, 0}, {prints[static_cast<std::size_t>(i) % 3], 0, 0, 0, 0});
    a.path = cross(0.3, 0);
    return a;
  }
  Actor robot(int i) {
    Actor a = base(ActorKind::kRobot, {at(0.8, 1.1), 0, 0}, wardrobe(i).robot);
    a.spin = either_way(0.25, 0.5);
    a.path = cross(0.4, 0);
    return a;
  }
  Actor cart(int i) {
    Actor a = base(ActorKind::kCart, {at(0.34, 0.4), at(0.72, 0.85), at(0.55, 0.65)}, wardrobe(i).cart);
    a.path = cross(0.8, 0);
    return a;
  }
  Actor crate() {
    Actor a = base(ActorKind::kCrate, {at(0.38, 0.44), at(0.7, 0.9), at(0.36, 0.42)}, wear_.crate);
    a.spin = either_way(0.3, 0.6);
    a.path = cross(0.7, 0);
    return a;
  }
  Actor drone(int i) {
    Actor a = base(ActorKind::kDrone, {at(0.6, 0.8), 0, 0}, wardrobe(i).drone);
    a.spin = at(-0.3, 0.3);
    const double z = at(5.0, 9.0);
    const double y = at(2.3, 2.9);
    std::vector<Vec3> points = across({random_.sign(), {z, z, z}, 0.6});
    for (Vec3& p : points) p.y = y;
    a.path = enter({std::move(points), at(-2.0, 7.0), at(0.6, 1.0)});
    return a;
  }

  const std::array<Wardrobe, 3>& wardrobes_;
  std::array<Lane, kLanes> lanes_{};
};

bool keeps_promises(const Scene& yard, const std::vector<Actor>& cast_list) {
  return survey(yard, cast_list, 6.0, 13.0, {0.5}).most_in_view >= kAtPeak;
}

}  // namespace

Scene make_crowd(std::uint64_t seed) {
  Scene scene;
  scene.name = "crowd";
  scene.seed = seed;
  scene.rig.height_m = 5.0;
  scene.rig.sin_pitch = 0.6;
  scene.rig.cos_pitch = 0.8;
  Random random(seed * 1000003ULL + 809);
  build_yard(scene, random);
  std::array<Wardrobe, 3> wardrobes;
  for (Wardrobe& wardrobe : wardrobes) wardrobe = make_wardrobe(scene, random);
  hold_acts(scene, {kLastExit_s + kPrelude_s, kPrelude_s, 809, 52},
            [wardrobes](const Scene& yard, std::uint64_t key) -> std::optional<std::vector<Actor>> {
              std::optional<std::vector<Actor>> drawn = Casting(yard, wardrobes, key).draw();
              if (!drawn || !keeps_promises(yard, *drawn)) return std::nullopt;
              return drawn;
            });
  return scene;
}

}  // namespace stereotrack::capture::synthetic
