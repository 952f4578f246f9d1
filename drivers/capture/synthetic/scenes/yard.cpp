#include "drivers/capture/synthetic/scenes/yard.hpp"

#include <cmath>

namespace stereotrack::capture::synthetic {
namespace {

constexpr double kWall_z = 14.0;

/// Adds shapes and materials to a scene; x is mirrored for half of the seeds.
///
/// Here and below whatever is given several drawn numbers takes them in one brace list: its elements are
/// worked out from left to right, those of a parameter list or a product in the compiler's own order.
class Yard {
 public:
  Yard(Scene& scene, Random& random) : scene_(scene), random_(random), mirror_(random.sign()) {}

  [[nodiscard]] double mirror() const { return mirror_; }
  int material(Material look) {
    look.seed = static_cast<std::uint32_t>(random_.bits());
    scene_.materials.push_back(look);
    return static_cast<int>(scene_.materials.size()) - 1;
  }
  struct Block {
    Vec3 low;  ///< its corner with the lowest x, y, z
    Vec3 size;
    int material = 0;
  };
  Shape& block(const Block& b) {
    Vec3 center = b.low + b.size * 0.5;
    center.x *= mirror_;
    scene_.statics.push_back(box(center, {}, b.size * 0.5, b.material));
    return scene_.statics.back();
  }
  /// Paint, paper, panes: too flat for a shadow.
  void flat(const Block& b) { block(b).casts_shadow = false; }
  struct Post {
    double x = 0;
    double z = 0;
    double from = 0;
    double to = 0;
    double radius = 0;
    int material = 0;
  };
  void post(const Post& p) {
    scene_.statics.push_back(
        cylinder({p.x * mirror_, p.from, p.z}, {p.x * mirror_, p.to, p.z}, p.radius, {1, 0, 0}, p.material));
  }
  struct Bush {
    Vec3 center;
    Vec3 radii;
    int material = 0;
  };
  void bush(Bush b) {
    b.center.x *= mirror_;
    scene_.statics.push_back(ellipsoid(b.center, {}, b.radii, b.material));
  }
  Vec3 vary(int red, int green, int blue) {
    const double light = random_.uniform(0.88, 1.12);
    return rgb(red, green, blue) * light;
  }

 private:
  Scene& scene_;
  Random& random_;
  double mirror_;
};

}  // namespace

Vec3 print_colour(Random& random) {
  constexpr std::array<std::array<int, 3>, 8> kInks{{{176, 44, 38},
                                                     {32, 72, 140},
                                                     {206, 160, 42},
                                                     {44, 110, 70},
                                                     {120, 52, 110},
                                                     {40, 128, 138},
                                                     {196, 96, 36},
                                                     {58, 60, 66}}};
  const auto& ink = kInks[static_cast<std::size_t>(random.below(static_cast<int>(kInks.size())))];
  return rgb(ink[0], ink[1], ink[2]);
}

YardPlan build_yard(Scene& scene, Random& random) {
  Yard yard(scene, random);
  const Vec3 dark = rgb(40, 40, 42);
  const Vec3 pale = rgb(196, 192, 182);

  // Ground. The floor must be the first shape: collides() leaves it out.
  const int slabs =
      yard.material({Pattern::kPaving, yard.vary(132, 128, 120), rgb(74, 71, 66), rgb(146, 128, 112), 0.6});
  yard.block({{-45, -1, -10}, {90, 1, 100}, slabs});
  const int asphalt = yard.material({Pattern::kAsphalt, yard.vary(98, 98, 101), rgb(78, 78, 82), dark, 1});
  const double lane = random.uniform(5.9, 6.6);
  yard.flat({{-45, -0.01, lane}, {90, 0.012, 2.3}, asphalt});
  const int paint = yard.material({Pattern::kPlain, rgb(188, 164, 74), dark, dark, 1});
  yard.flat({{-45, -0.01, lane - 0.16}, {90, 0.013, 0.1}, paint});
  yard.flat({{-45, -0.01, lane + 2.36}, {90, 0.013, 0.1}, paint});
  const int iron = yard.material({Pattern::kChecks, rgb(62, 58, 55), rgb(84, 80, 76), dark, 0.06});
  yard.post({random.uniform(-1.5, 1.5), lane + random.uniform(0.6, 1.7), -0.01, 0.004, 0.32, iron});
  scene.statics.back().casts_shadow = false;

  // The wall behind: plinth, bricks, coping; a gate, a door, windows and posters on it.
  const int bricks =
      random.chance(0.5)
          ? yard.material({Pattern::kBrick, yard.vary(140, 84, 66), rgb(166, 106, 82), rgb(158, 150, 138), 1})
          : yard.material({Pattern::kBrick, yard.vary(158, 138, 108), rgb(178, 156, 122), rgb(120, 114, 104), 1});
  const int concrete = yard.material({Pattern::kConcrete, yard.vary(142, 140, 134), rgb(104, 100, 92), dark, 1.2});
  yard.block({{-20, 0, kWall_z}, {40, 3.25, 0.4}, bricks});
  yard.block({{-20, 0, kWall_z - 0.05}, {40, 0.42, 0.06}, concrete});
  yard.block({{-20, 3.25, kWall_z - 0.08}, {40, 0.14, 0.56}, concrete});
  for (const double x : {-6.3, -2.1, 2.1, 6.3}) yard.block({{x - 0.2, 0, kWall_z - 0.12}, {0.4, 3.25, 0.14}, bricks});
  const int shutter = yard.material({Pattern::kShutter, yard.vary(108, 122, 130), dark, dark, 0.11});
  const int frame = yard.material({Pattern::kPlain, rgb(70, 72, 76), dark, dark, 1});
  yard.flat({{-1.45, 0, kWall_z - 0.055}, {2.9, 2.75, 0.06}, frame});
  yard.flat({{-1.35, 0, kWall_z - 0.06}, {2.7, 2.65, 0.06}, shutter});
  const int panes = yard.material({Pattern::kGlass, pale, rgb(44, 54, 62), rgb(150, 166, 178), 1});
  yard.flat({{-4.9, 1.2, kWall_z - 0.03}, {1.5, 1.3, 0.04}, panes});
  yard.flat({{2.9, 1.2, kWall_z - 0.03}, {1.5, 1.3, 0.04}, panes});
  for (const double x : {-3.05, -5.95, 4.85, 5.6}) {
    const int print = yard.material({Pattern::kPoster, print_colour(random), print_colour(random), pale, 1});
    const double width = random.uniform(0.5, 0.62);
    yard.flat({{x, random.uniform(1.15, 1.35), kWall_z - 0.02}, {width, width * 1.42, 0.03}, print});
  }

  // Beyond the wall: houses and trees.
  const int house = yard.material({Pattern::kFacade, yard.vary(168, 158, 142), rgb(64, 74, 86), pale, 2.6});
  const int house2 = yard.material({Pattern::kFacade, yard.vary(150, 118, 98), rgb(58, 66, 74), pale, 2.2});
  const double gap = random.uniform(-4.0, 2.0);
  yard.block({{-30, 0, 36}, {30 + gap, random.uniform(5.4, 6.4), 8}, house});
  yard.block({{gap + random.uniform(4.0, 6.0), 0, 31}, {30, random.uniform(4.6, 5.4), 8}, house2});
  const int leaves = yard.material({Pattern::kFoliage, rgb(38, 62, 30), rgb(108, 132, 66), dark, 0.55});
  for (const double around : {-7.0, 0.5, 6.5}) {
    const double x = around + random.uniform(-2.5, 2.5);
    const double z = random.uniform(20, 26);
    const double top = random.uniform(3.4, 4.2);
    for (int crown = 0; crown < 6; ++crown) {
      const double r = random.uniform(0.55, 1.05);
      yard.bush({{x + random.uniform(-1.3, 1.3), top + random.uniform(-0.7, 0.45), z + random.uniform(-0.6, 0.6)},
                 {r * 1.15, r * 0.9, r},
                 leaves});
    }
  }

  // A container on one side, a shed on the other.
  const int steel =
      yard.material({Pattern::kCorrugated, random.chance(0.5) ? yard.vary(52, 92, 116) : yard.vary(146, 70, 52),
                     rgb(206, 204, 196), rgb(112, 74, 52), 0.24});
  const double container = random.uniform(9.9, 10.3);
  yard.block({{4.5, 0.08, container}, {2.6, 2.35, 1.6}, steel});
  yard.block({{4.55, 0, container + 0.05}, {2.5, 0.1, 1.5}, frame});
  const int planks = yard.material({Pattern::kPlanks, yard.vary(146, 112, 76), rgb(118, 88, 58), dark, 0.14});
  yard.block({{-9.5, 0, 13.0}, {4.6, 2.2, 1.0}, planks});
  yard.block({{-9.7, 2.2, 12.8}, {5.0, 0.12, 1.2}, frame});

  // Small things to look past.
  const int lamp = yard.material({Pattern::kPlain, rgb(86, 96, 92), dark, dark, 1});
  const double lamp_x = random.uniform(2.3, 2.9);
  yard.post({lamp_x, 9.9, 0, 7.0, 0.065, lamp});
  yard.post({lamp_x, 9.9, 0, 0.5, 0.11, lamp});
  const int bollard =
      yard.material({Pattern::kStripes, rgb(178, 52, 44), rgb(206, 202, 196), rgb(206, 202, 196), 0.36});
  for (const double x : {-4.1, -2.9, -1.7}) yard.post({x, 10.1, 0, 0.85, 0.075, bollard});
  const int stone = yard.material({Pattern::kConcrete, yard.vary(150, 144, 132), rgb(110, 104, 94), dark, 0.5});
  const int hedge = yard.material({Pattern::kFoliage, rgb(34, 58, 32), rgb(104, 136, 70), dark, 0.16});
  yard.block({{-6.2, 0, 10.6}, {1.5, 0.5, 0.6}, stone});
  for (const double x : {-5.9, -5.45, -5.0}) {
    yard.bush({{x, 0.62 + random.uniform(0.0, 0.15), 10.9}, {0.36, random.uniform(0.3, 0.42), 0.34}, hedge});
  }
  const int drum = yard.material({Pattern::kStripes, yard.vary(44, 84, 128), rgb(40, 78, 118), rgb(26, 48, 74), 0.3});
  yard.post({-3.4, 13.3, 0, 0.9, 0.29, drum});
  yard.post({-2.75, 13.45, 0, 0.9, 0.29, drum});
  const int pallet = yard.material({Pattern::kPlanks, yard.vary(162, 130, 88), rgb(132, 102, 68), dark, 0.11});
  yard.block({{2.5, 0, 13.0}, {0.95, 0.8, 0.8}, pallet});
  yard.block({{3.55, 0, 13.1}, {0.75, 0.62, 0.7}, planks});
  yard.block({{2.62, 0.8, 13.1}, {0.7, 0.55, 0.6}, planks});
  const int sign = yard.material({Pattern::kHazard, rgb(204, 168, 46), rgb(44, 42, 40), dark, 0.22});
  yard.block({{1.55, 0.55, 13.35}, {0.04, 0.04, 0.04}, frame});
  yard.block({{-1.95, 0, 13.2}, {0.12, 0.85, 0.5}, sign});

  const Vec3 from_left = normalized({-0.72 * yard.mirror() * random.uniform(0.85, 1.15), 1.0, -0.48});
  scene.light.to_sun = from_left;
  scene.light.sun = Vec3{1.02, 0.95, 0.83} * random.uniform(0.93, 1.07);
  scene.light.sky = {0.39, 0.42, 0.47};
  scene.light.bounce = {0.20, 0.19, 0.17};
  scene.horizon_colour = {0.70, 0.74, 0.79};
  scene.zenith_colour = {0.40, 0.52, 0.70};
  return {yard.mirror(), {lamp_x * yard.mirror(), 7.0, 9.9}};
}

Wardrobe make_wardrobe(Scene& scene, Random& random) {
  const auto add = [&](Material look) {
    look.seed = static_cast<std::uint32_t>(random.bits());
    scene.materials.push_back(look);
    return static_cast<int>(scene.materials.size()) - 1;
  };
  const auto plain = [&](int r, int g, int b) { return add({Pattern::kPlain, rgb(r, g, b), {}, {}, 1}); };
  const auto cloth = [&](Vec3 colour) { return add({Pattern::kFabric, colour, colour, colour, -9}); };
  const auto skin = [&] {
    constexpr std::array<std::array<int, 3>, 4> kTones{
        {{206, 160, 134}, {176, 128, 98}, {124, 84, 62}, {222, 180, 154}}};
    const auto& tone = kTones[static_cast<std::size_t>(random.below(4))];
    return plain(tone[0], tone[1], tone[2]);
  };
  const auto shirt = [&](int which) {
    const Vec3 a = print_colour(random);
    if (which == 0) return add({Pattern::kStripes, a, rgb(206, 202, 192), a, 0.12});
    if (which == 1) return add({Pattern::kChecks, a, mix(a, rgb(212, 208, 198), 0.6), a, 0.09});
    return add({Pattern::kPatches, a, mix(a, rgb(30, 30, 34), 0.55), mix(a, rgb(210, 206, 190), 0.5), 0.16});
  };
  const int hair = plain(52, 40, 32);
  const int shoe = plain(36, 34, 36);
  const int tyre = add({Pattern::kSegments, rgb(34, 34, 36), rgb(150, 150, 152), rgb(150, 150, 152), 1});
  const int metal = plain(156, 160, 166);
  Wardrobe w;
  w.tall = {shirt(0), cloth(rgb(52, 64, 92)), skin(), hair, shoe};
  w.bystander = {shirt(1 + random.below(2)), cloth(rgb(92, 82, 66)), skin(), plain(96, 74, 44), shoe};
  // Near the wall's and the floor's own colours.
  w.child = {cloth(random.chance(0.5) ? rgb(112, 108, 84) : rgb(134, 130, 122)), cloth(rgb(104, 102, 100)), skin(),
             plain(70, 52, 40), shoe};
  const int coat = random.chance(0.5)
                       ? add({Pattern::kPatches, rgb(62, 44, 32), rgb(176, 148, 112), rgb(216, 208, 196), 0.22})
                       : add({Pattern::kPatches, rgb(190, 184, 172), rgb(58, 54, 52), rgb(96, 86, 76), 0.25});
  w.dog = {coat, plain(52, 40, 34), coat, 0, 0};
  const int label = add({Pattern::kCardboard, rgb(176, 138, 96), rgb(150, 110, 66), rgb(222, 220, 212), 1});
  w.cart = {plain(196, 92, 36), label, tyre, metal,
            add({Pattern::kLogo, print_colour(random), rgb(214, 208, 190), rgb(40, 42, 46), 0.24})};
  w.crate = {random.chance(0.5) ? add({Pattern::kLogo, rgb(64, 118, 92), rgb(206, 176, 58), rgb(226, 224, 214), 0.98})
                                : add({Pattern::kPlanks, rgb(186, 146, 92), rgb(150, 110, 66), {}, 0.16}),
             plain(48, 48, 52), 0, 0, 0};
  w.robot = {add({Pattern::kLogo, rgb(198, 200, 204), rgb(40, 96, 156), rgb(206, 108, 40), 0.34}),
             add({Pattern::kSegments, rgb(188, 192, 198), rgb(44, 100, 158), rgb(44, 100, 158), 1}), plain(46, 48, 54),
             plain(30, 34, 44), 0};
  w.drone = {add({Pattern::kHazard, rgb(216, 196, 56), rgb(38, 38, 42), {}, 0.12}), plain(44, 44, 48),
             plain(90, 92, 98), 0, 0};
  w.beach_ball = add({Pattern::kSegments, rgb(226, 222, 212), rgb(204, 58, 50), rgb(46, 98, 178), 1});
  w.football = add({Pattern::kFootball, rgb(222, 220, 212), rgb(34, 34, 38), {}, 1});
  w.small_ball = add({Pattern::kChecks, rgb(214, 96, 34), rgb(236, 190, 60), {}, 0.09});
  return w;
}

double off_stage(double z, double reach) {
  const double depth = 0.96 * z + 0.28 * 3.0;
  return depth * 320.0 / 600.0 + 0.25 + reach + 1.6;
}

std::vector<Vec3> Troupe::across(const Crossing& c) {
  std::vector<Vec3> points;
  const double from = c.side * off_stage(c.depths.front(), c.reach);
  const double to = -c.side * off_stage(c.depths.back(), c.reach);
  for (std::size_t i = 0; i < c.depths.size(); ++i) {
    const double part = static_cast<double>(i) / static_cast<double>(c.depths.size() - 1);
    const bool inner = i > 0 && i + 1 < c.depths.size();
    points.push_back({mix(from, to, part) + (inner ? at(-0.4, 0.4) : 0.0), 0, c.depths[i]});
  }
  return points;
}

Path Troupe::enter(Entrance e) {
  Path::Timing timing;
  timing.speed_m_s = e.speed;
  timing.start_s = e.seen_s - 1.7 / e.speed;
  if (e.pause_s > 0) timing.pause_at_s = e.seen_s + e.pause_after_s;
  timing.pause_s = e.pause_s;
  return Path(std::move(e.points), timing);
}

Actor Troupe::base(ActorKind kind, Vec3 size, std::array<int, 5> materials) {
  Actor a;
  a.kind = kind;
  a.size = size;
  a.materials = materials;
  a.phase = random_.uniform(0.0, 6.0);
  return a;
}

}  // namespace stereotrack::capture::synthetic
