#include "drivers/capture/synthetic/scenes/foliage.hpp"

#include <array>

#include "drivers/capture/synthetic/random.hpp"
#include "drivers/capture/synthetic/scenes/passers.hpp"
#include "drivers/capture/synthetic/scenes/yard.hpp"

namespace stereotrack::capture::synthetic {
namespace {

struct Green {
  Vec3 upper;
  Vec3 under;
};

Green draw_green(Random& random) {
  const std::array<Green, 4> greens{{{rgb(82, 116, 50), rgb(146, 164, 104)},
                                     {rgb(104, 124, 48), rgb(168, 172, 98)},
                                     {rgb(66, 104, 62), rgb(132, 156, 122)},
                                     {rgb(128, 112, 44), rgb(178, 160, 92)}}};
  return greens[static_cast<std::size_t>(random.below(static_cast<int>(greens.size())))];
}

/// A trunk, branches to some of its clumps, and the crown.
struct Tree {
  Vec3 foot;
  double crown_m = 3.0;  ///< height of its middle
  int bark = 0;
};
void plant_tree(Scene& scene, const Tree& tree, Random& random) {
  const Green green = draw_green(random);
  Foliage::Plant crown;
  crown.center = tree.foot + Vec3{0, tree.crown_m, 0};
  crown.radii = Vec3{1.15, 0.85, 0.95} * random.uniform(0.9, 1.1);
  crown.clumps = 17;
  crown.clump_radius = 0.43;
  crown.leaves = 125;
  crown.leaf_half = {0.072, 0.008, 0.046};
  crown.give_m = random.uniform(0.11, 0.13);
  crown.upper = green.upper;
  crown.under = green.under;
  const std::size_t first = scene.foliage->clumps().size();
  scene.foliage->plant(crown, scene.light.to_sun, random);
  const Vec3 fork = tree.foot + Vec3{0, 0.55 * tree.crown_m, 0};
  scene.statics.push_back(cylinder(tree.foot, fork, 0.10, {1, 0, 0}, tree.bark));
  const std::vector<Vec3> clumps = scene.foliage->clumps();
  for (std::size_t c = first; c < clumps.size(); c += 2) {
    scene.statics.push_back(capsule(fork, mix(fork, clumps[c], 0.8), 0.026, {1, 0, 0}, tree.bark));
  }
}

struct Bush {
  Vec3 foot;
  Vec3 radii;
  int clumps = 5;
  double clump_radius = 0.3;
  double give_m = 0.07;
};
void plant_bush(Scene& scene, const Bush& bush, Random& random) {
  const Green green = draw_green(random);
  Foliage::Plant plant;
  plant.center = bush.foot + Vec3{0, bush.radii.y, 0};
  plant.radii = bush.radii - Vec3{1, 1, 1} * (0.6 * bush.clump_radius);
  plant.clumps = bush.clumps;
  plant.clump_radius = bush.clump_radius;
  plant.leaves = 120;
  plant.leaf_half = {0.055, 0.007, 0.034};
  plant.give_m = bush.give_m;
  plant.upper = green.upper;
  plant.under = green.under;
  scene.foliage->plant(plant, scene.light.to_sun, random);
}

}  // namespace

Scene make_foliage(std::uint64_t seed) {
  Scene scene;
  scene.name = "foliage";
  scene.seed = seed;
  Random random(seed * 1000003ULL + 503);
  const YardPlan plan = build_yard(scene, random);
  const Wardrobe wardrobe = make_wardrobe(scene, random);
  const double mirror = plan.mirror;
  const auto material = [&](Material look) {
    look.seed = static_cast<std::uint32_t>(random.bits());
    scene.materials.push_back(look);
    return static_cast<int>(scene.materials.size()) - 1;
  };
  const int bark = material({Pattern::kPatches, rgb(84, 72, 60), rgb(108, 94, 78), rgb(66, 58, 50), 0.06});
  const int pole = material({Pattern::kPlain, rgb(178, 180, 184), {}, {}, 1});
  const int pot = material({Pattern::kConcrete, rgb(150, 142, 130), rgb(104, 98, 90), {}, 0.7});

  Wind wind;
  wind.towards = normalized({random.sign(), 0, random.uniform(-0.25, 0.25)});
  wind.phase = random.uniform(0.0, 6.28);
  scene.foliage.emplace(wind);
  const auto at = [&](double x, double z) {
    const double wide = random.uniform(-0.2, 0.2);
    return Vec3{(x + wide) * mirror, 0, z + random.uniform(-0.15, 0.15)};
  };
  plant_tree(scene, {at(-3.0, 11.2), random.uniform(2.75, 3.0), bark}, random);
  plant_tree(scene, {at(1.1, 11.0), random.uniform(2.8, 3.05), bark}, random);
  plant_bush(scene, {at(-1.0, 11.6), {0.75, 0.48, 0.5}, 6, 0.3, 0.075}, random);
  plant_bush(scene, {at(3.7, 11.3), {0.8, 0.55, 0.5}, 6, 0.32, 0.085}, random);
  // The near one grows in a pot.
  const Vec3 near = at(2.05, 4.6);
  scene.statics.push_back(box(near + Vec3{0, 0.17, 0}, {}, {0.42, 0.17, 0.3}, pot));
  plant_bush(scene, {near + Vec3{0, 0.26, 0}, {0.55, 0.38, 0.4}, 6, 0.24, 0.042}, random);

  // The cloth hangs where the near trees leave a gap.
  const Vec3 foot{-1.1 * mirror - 0.62 * wind.towards.x, 0, 12.9};
  scene.statics.push_back(cylinder(foot, foot + Vec3{0, 4.6, 0}, 0.035, {1, 0, 0}, pole));
  const Vec3 band = print_colour(random);
  scene.foliage->raise({foot + Vec3{0, 3.35, -0.05}, 1.25, 0.8, {band, rgb(214, 210, 200), print_colour(random)}});

  let_pass(scene, wardrobe, {503, 5.7, 8.8});
  return scene;
}

}  // namespace stereotrack::capture::synthetic
