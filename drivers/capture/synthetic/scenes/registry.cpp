#include "drivers/capture/synthetic/scene.hpp"
#include "drivers/capture/synthetic/scenes/crossing.hpp"
#include "drivers/capture/synthetic/scenes/crowd.hpp"
#include "drivers/capture/synthetic/scenes/dark.hpp"
#include "drivers/capture/synthetic/scenes/dropout.hpp"
#include "drivers/capture/synthetic/scenes/eleven.hpp"
#include "drivers/capture/synthetic/scenes/exposure_step.hpp"
#include "drivers/capture/synthetic/scenes/far.hpp"
#include "drivers/capture/synthetic/scenes/fast.hpp"
#include "drivers/capture/synthetic/scenes/flicker.hpp"
#include "drivers/capture/synthetic/scenes/foliage.hpp"
#include "drivers/capture/synthetic/scenes/occupied.hpp"
#include "drivers/capture/synthetic/scenes/shake.hpp"
#include "drivers/capture/synthetic/scenes/stop_and_go.hpp"

namespace stereotrack::capture::synthetic {

const std::vector<SceneEntry>& scenes() {
  static const std::vector<SceneEntry> all{
      {"eleven", "a yard with eleven moving things: people, a dog, a trolley, balls, a drone...", &make_eleven},
      {"occupied", "the yard with six things that stand there in frame 1 and leave one by one", &make_occupied},
      {"exposure_step", "the yard while exposure jumps and a floodlight goes on and off", &make_exposure_step},
      {"foliage", "the yard with trees, bushes and a flag in gusts of wind", &make_foliage},
      {"shake", "the yard seen from a mast that sways by up to 4 px", &make_shake},
      {"crossing", "people who pass in front of and behind each other, in different and in the same clothes",
       &make_crossing},
      {"stop-and-go", "people and trolleys that stop for 2 to 15 s and go on", &make_stop_and_go},
      {"crowd", "more than 40 people and things at once, seen from higher up", &make_crowd},
      {"far", "targets of 6 x 6 px: balls along the wall, balloons before the houses", &make_far},
      {"fast", "balls that are thrown and bounce by at 40 px a frame, with motion blur", &make_fast},
      {"flicker", "light that pulses with the mains, in bands, too, and goes on and off; few people", &make_flicker},
      {"dark", "the last light of the day: noise and low contrast; few people", &make_dark},
      {"dropout", "pictures that never come and pairs whose right picture is one frame off", &make_dropout},
  };
  return all;
}

std::string scene_names() {
  std::string names;
  for (const SceneEntry& entry : scenes()) names += (names.empty() ? "" : ", ") + std::string(entry.name);
  return names;
}

}  // namespace stereotrack::capture::synthetic
