#include "drivers/capture/synthetic/scenes/flicker.hpp"

#include <array>
#include <cmath>
#include <cstddef>

#include "drivers/capture/synthetic/random.hpp"
#include "drivers/capture/synthetic/scenes/few.hpp"
#include "drivers/capture/synthetic/scenes/yard.hpp"

namespace stereotrack::capture::synthetic {
namespace {

constexpr double kPeriod_s = 120.0;
constexpr double kPulse_hz = 100.06;
constexpr double kReadout_s = 0.024;
constexpr double kAmplitude = 0.15;

struct Programme {
  struct Step {
    double at_s = 0;
    double exposure = 1;  ///< from then on
  };
  struct Lit {
    double from_s = 0;
    double until_s = 0;
  };
  std::array<Step, 8> steps;
  std::array<Lit, 3> lamp;
  double phase = 0;  ///< of the mains [turns]

  [[nodiscard]] Moment at(double t_s) const noexcept {
    const double t = t_s - kPeriod_s * std::floor(t_s / kPeriod_s);
    Moment moment;
    for (const Step& step : steps) {
      if (t >= step.at_s) moment.exposure = step.exposure;
    }
    for (const Lit& lit : lamp) {
      if (t >= lit.from_s && t < lit.until_s) moment.lamp = 1.0;
    }
    const bool at_once = t >= 12.0 && t < 46.0;
    const bool rolling = t >= 58.0 && t < 108.0;
    if (at_once || rolling) {
      const double turns = phase + kPulse_hz * t_s;
      moment.ripple = {kAmplitude, turns - std::floor(turns), rolling ? kPulse_hz * kReadout_s : 0.0};
    }
    return moment;
  }
};

}  // namespace

Scene make_flicker(std::uint64_t seed) {
  Scene scene;
  scene.name = "flicker";
  scene.seed = seed;
  Random random(seed * 1000003ULL + 1103);
  const YardPlan plan = build_yard(scene, random);
  const Wardrobe wardrobe = make_wardrobe(scene, random);
  Lamp lamp;
  lamp.position = plan.lamp + Vec3{0, -0.2, -1.2};
  lamp.light = Vec3{29.0, 25.5, 19.5};
  lamp.cos_full = 0.90;
  lamp.cos_none = 0.64;
  scene.lamp = lamp;
  Programme programme;
  constexpr std::array<double, 8> kSteps_s{8, 20, 31, 52, 64, 77, 90, 103};
  for (std::size_t i = 0; i < kSteps_s.size(); ++i) {
    programme.steps[i].at_s = kSteps_s[i] + random.uniform(-2.0, 2.0);
    programme.steps[i].exposure = i % 2 == 0 ? random.uniform(0.75, 0.85) : 1.0;
  }
  constexpr std::array<double, 3> kLamp_s{25, 70, 96};
  for (std::size_t i = 0; i < kLamp_s.size(); ++i) {
    const double from_s = kLamp_s[i] + random.uniform(-1.0, 1.0);
    programme.lamp[i] = {from_s, from_s + random.uniform(4.0, 8.0)};
  }
  programme.phase = random.uniform();
  scene.moment = [programme](double t_s) { return programme.at(t_s); };
  let_few_pass(scene, wardrobe, 1103);
  return scene;
}

}  // namespace stereotrack::capture::synthetic
