#include "drivers/capture/synthetic/scenes/shake.hpp"

#include <array>
#include <cmath>
#include <numbers>

#include "drivers/capture/synthetic/random.hpp"
#include "drivers/capture/synthetic/scenes/passers.hpp"
#include "drivers/capture/synthetic/scenes/yard.hpp"
#include "pipeline/core/pinned_math.hpp"

namespace stereotrack::capture::synthetic {
namespace {

constexpr double kPixel = 1.0 / 600.0;  ///< of 640 x 480, in the middle of the picture [rad]

struct Wave {
  double amplitude = 0;  ///< [rad]
  double period_s = 1;
  double top_s = 0;  ///< one of its tops

  [[nodiscard]] double at(double t_s) const noexcept {
    return amplitude * pinned_cos(2.0 * std::numbers::pi * ((t_s - top_s) / period_s));
  }
};

/// Smooth noise, one number every 1/20 s.
struct Jitter {
  std::uint64_t key = 0;
  double amplitude = 0;  ///< [rad]

  [[nodiscard]] double at(double t_s) const noexcept {
    const double place = t_s * 20.0;
    const double before = std::floor(place);
    const auto number = [&](double index) {
      return Random(key ^ mix_bits(static_cast<std::uint64_t>(index))).uniform(-1.0, 1.0);
    };
    return amplitude * mix(number(before), number(before + 1.0), smoothstep(0.0, 1.0, place - before));
  }
};

struct Mast {
  std::array<Wave, 3> yaw;
  std::array<Wave, 3> pitch;
  Wave roll;
  Jitter yaw_jitter;
  Jitter pitch_jitter;

  [[nodiscard]] Sway at(double t_s) const noexcept {
    Sway sway{yaw_jitter.at(t_s), pitch_jitter.at(t_s), roll.at(t_s)};
    for (const Wave& wave : yaw) sway.yaw += wave.at(t_s);
    for (const Wave& wave : pitch) sway.pitch += wave.at(t_s);
    return sway;
  }
};

Mast draw_mast(Random& random) {
  const double meet_s = random.uniform(4.0, 9.0);
  const double side = random.sign();
  const auto waves = [&](std::array<double, 3> pixels, double sign) {
    std::array<Wave, 3> result;
    constexpr std::array<double, 3> kPeriods{2.6, 1.1, 0.4};
    for (std::size_t i = 0; i < result.size(); ++i) {
      result[i] = {sign * pixels[i] * kPixel, kPeriods[i] * random.uniform(0.85, 1.15), meet_s};
    }
    return result;
  };
  Mast mast;
  mast.yaw = waves({1.62, 0.95, 0.40}, side);
  mast.pitch = waves({0.42, 0.28, 0.12}, random.sign());
  // A quarter of its period off, so that it does not add to the others' top.
  const double period = random.uniform(1.7, 2.3);
  mast.roll = {random.sign() * 0.0005, period, meet_s + 0.25 * period};
  mast.yaw_jitter = {random.bits(), 0.12 * kPixel};
  mast.pitch_jitter = {random.bits(), 0.12 * kPixel};
  return mast;
}

}  // namespace

Scene make_shake(std::uint64_t seed) {
  Scene scene;
  scene.name = "shake";
  scene.seed = seed;
  Random random(seed * 1000003ULL + 409);
  build_yard(scene, random);
  const Wardrobe wardrobe = make_wardrobe(scene, random);
  scene.sways = true;
  const Mast mast = draw_mast(random);
  scene.moment = [mast](double t_s) {
    Moment moment;
    moment.sway = mast.at(t_s);
    return moment;
  };
  let_pass(scene, wardrobe, {409});
  return scene;
}

}  // namespace stereotrack::capture::synthetic
