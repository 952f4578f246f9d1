#pragma once

#include <cstdint>

#include "drivers/capture/synthetic/scene.hpp"
#include "drivers/capture/synthetic/scenes/yard.hpp"

namespace stereotrack::capture::synthetic {

/// Who passes in scenes that are empty most of the time: in every act of 40 s one or two people and a dog or a trolley,
/// first seen 1 to 14 s after its begin, gone 26 s after it. Each is seen for 3 s or more and runs into nobody. The
/// first act's first comes after 3 s, when a background of 60 frames is learnt. Sets act_s, prelude_s and cast of a
/// scene that is complete else. Ids: 3 an act. `salt`: of the scene.
void let_few_pass(Scene& scene, const Wardrobe& wardrobe, std::uint64_t salt);

}  // namespace stereotrack::capture::synthetic
