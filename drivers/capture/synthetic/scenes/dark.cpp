#include "drivers/capture/synthetic/scenes/dark.hpp"

#include "drivers/capture/synthetic/random.hpp"
#include "drivers/capture/synthetic/scenes/few.hpp"
#include "drivers/capture/synthetic/scenes/yard.hpp"

namespace stereotrack::capture::synthetic {

Scene make_dark(std::uint64_t seed) {
  Scene scene;
  scene.name = "dark";
  scene.seed = seed;
  Random random(seed * 1000003ULL + 1201);
  build_yard(scene, random);
  const Wardrobe wardrobe = make_wardrobe(scene, random);
  scene.light.sun = scene.light.sun * 0.2;
  scene.horizon_colour = scene.horizon_colour * 0.5;
  scene.zenith_colour = scene.zenith_colour * 0.5;
  scene.noise = 1.8;
  scene.moment = [](double) {
    Moment moment;
    moment.exposure = 1.0 / 14.0;
    return moment;
  };
  let_few_pass(scene, wardrobe, 1201);
  return scene;
}

}  // namespace stereotrack::capture::synthetic
