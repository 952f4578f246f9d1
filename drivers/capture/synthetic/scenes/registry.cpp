#include "drivers/capture/synthetic/scene.hpp"
#include "drivers/capture/synthetic/scenes/eleven.hpp"

namespace stereotrack::capture::synthetic {

const std::vector<SceneEntry>& scenes() {
  static const std::vector<SceneEntry> all{
      {"eleven", "a yard with eleven moving things: people, a dog, a trolley, balls, a drone...", &make_eleven},
  };
  return all;
}

}  // namespace stereotrack::capture::synthetic
