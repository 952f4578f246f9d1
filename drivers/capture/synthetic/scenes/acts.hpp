#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "drivers/capture/synthetic/scene.hpp"

namespace stereotrack::capture::synthetic {

/// How a scene's casts follow one another: a new one every `length_s`, for as long as the sequence is.
struct Acts {
  double length_s = 0;
  double prelude_s = 0;    ///< a cast's first one sets out at most this much before its act
  std::uint64_t salt = 0;  ///< of the scene: another scene, other people
  std::uint32_t ids = 0;   ///< ids of a cast are 1 .. ids, then go on with the next act's
};

/// Draws a cast for an act that begins at 0 s, from `key` alone; nothing where it cannot be had or breaks a promise.
/// `yard`: the scene without its cast, for planning.
using DrawCast = std::function<std::optional<std::vector<Actor>>(const Scene& yard, std::uint64_t key)>;

/// Sets act_s, prelude_s and cast of a scene that is complete else: casts are drawn until one is kept.
/// The cast throws std::runtime_error when a thousand draws are not enough.
void hold_acts(Scene& scene, const Acts& acts, DrawCast draw);

}  // namespace stereotrack::capture::synthetic
