#include "drivers/capture/synthetic/scene.hpp"
#include "drivers/capture/synthetic/scenes/eleven.hpp"
#include "drivers/capture/synthetic/scenes/exposure_step.hpp"
#include "drivers/capture/synthetic/scenes/foliage.hpp"
#include "drivers/capture/synthetic/scenes/occupied.hpp"
#include "drivers/capture/synthetic/scenes/shake.hpp"

namespace stereotrack::capture::synthetic {

const std::vector<SceneEntry>& scenes() {
  static const std::vector<SceneEntry> all{
      {"eleven", "a yard with eleven moving things: people, a dog, a trolley, balls, a drone...", &make_eleven},
      {"occupied", "the yard with six things that stand there in frame 1 and leave one by one", &make_occupied},
      {"exposure_step", "the yard while exposure jumps and a floodlight goes on and off", &make_exposure_step},
      {"foliage", "the yard with trees, bushes and a flag in gusts of wind", &make_foliage},
      {"shake", "the yard seen from a mast that sways by up to 4 px", &make_shake},
  };
  return all;
}

std::string scene_names() {
  std::string names;
  for (const SceneEntry& entry : scenes()) names += (names.empty() ? "" : ", ") + std::string(entry.name);
  return names;
}

}  // namespace stereotrack::capture::synthetic
