#include "drivers/capture/synthetic/scenes/exposure_step.hpp"

#include <array>
#include <cmath>

#include "drivers/capture/synthetic/random.hpp"
#include "drivers/capture/synthetic/scenes/passers.hpp"
#include "drivers/capture/synthetic/scenes/yard.hpp"

namespace stereotrack::capture::synthetic {
namespace {

constexpr double kPeriod_s = 14.0;
constexpr double kRamp_s = 0.4;

/// When what happens, counted from the start of a period [s].
struct Programme {
  double brighter = 0;
  double darker = 0;
  double lamp_on = 0;
  double dark = 0;
  double ramp = 0;
  double lamp_off = 0;

  [[nodiscard]] Moment at(double t_s) const noexcept {
    const double t = t_s - kPeriod_s * std::floor(t_s / kPeriod_s);
    Moment moment;
    if (t >= brighter) moment.exposure = 1.5;
    if (t >= darker) moment.exposure = 1.5 / 1.4;
    if (t >= dark) moment.exposure = 0.75 + 0.25 * clamp((t - ramp) / kRamp_s, 0.0, 1.0);
    moment.lamp = t >= lamp_on && t < lamp_off ? 1.0 : 0.0;
    return moment;
  }
};

}  // namespace

Scene make_exposure_step(std::uint64_t seed) {
  Scene scene;
  scene.name = "exposure_step";
  scene.seed = seed;
  Random random(seed * 1000003ULL + 307);
  const YardPlan plan = build_yard(scene, random);
  const Wardrobe wardrobe = make_wardrobe(scene, random);
  Lamp lamp;
  lamp.position = plan.lamp + Vec3{0, -0.2, -1.2};  // at the end of an arm, above the picture
  lamp.light = Vec3{29.0, 25.5, 19.5};
  lamp.cos_full = 0.90;
  lamp.cos_none = 0.64;
  scene.lamp = lamp;
  const auto about = [&](double frame) { return (frame - 0.5 + random.uniform(-9.0, 9.0)) / 30.0; };
  const Programme programme{about(85), about(140), about(190), about(240), about(290), about(345)};
  scene.moment = [programme](double t_s) { return programme.at(t_s); };
  let_pass(scene, wardrobe, {307});
  return scene;
}

}  // namespace stereotrack::capture::synthetic
