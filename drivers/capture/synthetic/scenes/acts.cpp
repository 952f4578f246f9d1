#include "drivers/capture/synthetic/scenes/acts.hpp"

#include <stdexcept>
#include <string>
#include <utility>

#include "drivers/capture/synthetic/random.hpp"

namespace stereotrack::capture::synthetic {

void hold_acts(Scene& scene, const Acts& acts, DrawCast draw) {
  scene.act_s = acts.length_s;
  scene.prelude_s = acts.prelude_s;
  Scene yard = scene;
  scene.cast = [yard = std::move(yard), acts, draw = std::move(draw)](std::uint32_t act) {
    for (std::uint64_t attempt = 0; attempt < 1000; ++attempt) {
      std::optional<std::vector<Actor>> drawn =
          draw(yard, mix_bits((yard.seed + acts.salt) ^ mix_bits(act * 1000ULL + attempt)));
      if (!drawn) continue;
      for (Actor& actor : *drawn) {
        actor.id += act * acts.ids;
        actor.path.delay(act * acts.length_s);
      }
      return *drawn;
    }
    throw std::runtime_error("synthetic:" + yard.name + ": seed " + std::to_string(yard.seed) +
                             " finds no cast; take another seed");
  };
}

}  // namespace stereotrack::capture::synthetic
