#include "drivers/capture/synthetic/foliage.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "pipeline/core/pinned_math.hpp"

namespace stereotrack::capture::synthetic {
namespace {

constexpr double kTurn = 2.0 * std::numbers::pi;

/// In the unit ball, evenly.
Vec3 in_ball(Random& random) noexcept {
  for (;;) {
    const Vec3 p{random.uniform(-1.0, 1.0), random.uniform(-1.0, 1.0), random.uniform(-1.0, 1.0)};
    const double r2 = dot(p, p);
    if (r2 <= 1.0 && r2 > 1e-4) return p;
  }
}

Vec3 cross(Vec3 a, Vec3 b) noexcept { return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x}; }

/// With this y and a drawn turn about it.
Axes around(Vec3 y, Random& random) noexcept {
  Vec3 x;
  do {
    x = cross(y, in_ball(random));
  } while (dot(x, x) < 1e-3);
  x = normalized(x);
  return {x, y, cross(x, y)};
}

/// Turned about its own x.
Axes turned(const Axes& a, double angle) noexcept {
  const double c = pinned_cos(angle);
  const double s = pinned_sin(angle);
  return {a.x, a.y * c + a.z * s, a.z * c - a.y * s};
}

}  // namespace

double Wind::strength(Vec3 place, double t_s) const noexcept {
  const double t = t_s - dot(place, towards) / 4.0;
  const auto wave = [&](double period_s, double share) { return pinned_sin(kTurn * (t / period_s) + share * phase); };
  return clamp(0.48 + 0.18 * wave(7.3, 1.0) + 0.27 * wave(3.7, 2.0) + 0.16 * wave(1.9, 3.0), 0.05, 1.05);
}

void Foliage::plant(const Plant& p, Vec3 to_sun, Random& random) {
  const std::size_t first = clumps_.size();
  for (int i = 0; i < p.clumps; ++i) {
    // Evenly apart: of some places the one that is farthest from the others.
    Vec3 best;
    double best_gap = -1;
    for (int attempt = 0; attempt < 12; ++attempt) {
      const Vec3 place = in_ball(random);
      double gap = 2;
      for (std::size_t c = first; c < clumps_.size(); ++c) {
        const Vec3 d = clumps_[c].center - p.center;
        gap = std::min(gap, length(place - Vec3{d.x / p.radii.x, d.y / p.radii.y, d.z / p.radii.z}));
      }
      if (gap > best_gap) {
        best_gap = gap;
        best = place;
      }
    }
    Clump clump;
    clump.center = p.center + best * p.radii;
    clump.radius = p.clump_radius * random.uniform(0.8, 1.2);
    clump.give_m = p.give_m * (0.45 + 0.55 * length(best)) * random.uniform(0.85, 1.15);
    clump.rate_hz = random.uniform(0.55, 1.05);
    clump.along_phase = random.uniform(0.0, kTurn);
    clump.across_phase = random.uniform(0.0, kTurn);
    const double tone = random.uniform(0.86, 1.12);
    for (int k = 0; k < p.leaves; ++k) {
      const Vec3 in = in_ball(random);
      const double depth = length(in);
      // Most near the surface.
      const Vec3 offset = in * (clump.radius * mix(0.58, 1.06, random.uniform()) / depth);
      const Vec3 outward = normalized(offset);
      Leaf leaf;
      leaf.offset = offset;
      leaf.axes = around(normalized(outward * 0.7 + Vec3{0, 0.6, 0} + in_ball(random) * 0.75), random);
      const double size = random.uniform(0.75, 1.25);
      leaf.half = p.leaf_half * size;
      const double light = tone * random.uniform(0.8, 1.2);
      const double yellow = random.uniform(0.9, 1.15);
      leaf.upper = p.upper * Vec3{light * yellow, light, light};
      leaf.under = p.under * Vec3{light * yellow, light, light};
      leaf.open = 0.55 + 0.45 * clamp(0.5 + 0.8 * outward.y, 0.0, 1.0);
      leaf.follows = random.uniform(0.85, 1.15);
      leaf.rate_hz = random.uniform(1.6, 3.6);
      leaf.phase = random.uniform(0.0, kTurn);
      leaf.flutter = random.uniform(0.25, 0.75);
      clump.leaves.push_back(leaf);
    }
    // What is seen between the leaves: twigs and leaves in the dark.
    Leaf core;
    const double inner = 0.60 * clump.radius;
    core.half = {inner, 0.9 * inner, inner};
    core.upper = p.upper * 0.45;
    core.under = core.upper;
    core.open = 0.5;
    core.lit = 0.12;
    core.flutter = 0;
    clump.leaves.push_back(core);
    for (int k = 0; k < 5; ++k) clump.shades.push_back(in_ball(random) * (0.75 * clump.radius));
    clumps_.push_back(std::move(clump));
  }

  // How much sun comes through the plant to each leaf: less with every leaf on the way.
  struct Ball {
    Vec3 center;
    double radius = 0;
  };
  std::vector<Ball> balls;
  for (std::size_t c = first; c < clumps_.size(); ++c) {
    for (const Leaf& leaf : clumps_[c].leaves) {
      balls.push_back({clumps_[c].center + leaf.offset, 0.75 * std::max(leaf.half.x, leaf.half.z)});
    }
  }
  std::size_t own = 0;
  for (std::size_t c = first; c < clumps_.size(); ++c) {
    for (Leaf& leaf : clumps_[c].leaves) {
      const Vec3 from = balls[own++].center;
      if (leaf.lit < 1) continue;
      for (std::size_t b = 0; b < balls.size() && leaf.lit > 0.05; ++b) {
        const Vec3 to = balls[b].center - from;
        const double along = dot(to, to_sun);
        if (along < 0.03 || dot(to, to) - along * along > balls[b].radius * balls[b].radius) continue;
        leaf.lit *= balls[b].radius > 0.15 ? 0.25 : 0.72;
      }
    }
  }
}

void Foliage::pose(double t_s, PosedFoliage& out) const {
  out.leaves.clear();
  out.clump_ends.clear();
  out.shades.clear();
  const Vec3 across{wind_.towards.z, 0, -wind_.towards.x};
  for (const Clump& clump : clumps_) {
    const double g = wind_.strength(clump.center, t_s);
    const double turn = kTurn * clump.rate_hz * t_s;
    const double along = clump.give_m * g * (0.7 + 0.45 * pinned_sin(turn + clump.along_phase));
    const double aside = 0.4 * clump.give_m * g * pinned_sin(0.83 * turn + clump.across_phase);
    const Vec3 swing = wind_.towards * along + across * aside + Vec3{0, -0.3 * along + 0.25 * aside, 0};
    for (const Leaf& leaf : clump.leaves) {
      const double tremble = g * pinned_sin(kTurn * leaf.rate_hz * t_s + leaf.phase);
      const Axes axes = leaf.flutter > 0 ? turned(leaf.axes, leaf.flutter * (1.3 * tremble + 0.8 * g)) : leaf.axes;
      const Vec3 center =
          clump.center + leaf.offset + swing * leaf.follows + leaf.axes.z * (0.02 * leaf.flutter * tremble);
      out.leaves.push_back({ellipsoid(center, axes, leaf.half, 0), leaf.upper, leaf.under, leaf.open, leaf.lit});
    }
    out.clump_ends.push_back(out.leaves.size());
    const double r = 0.42 * clump.radius;
    for (const Vec3& shade : clump.shades) {
      out.shades.push_back(ellipsoid(clump.center + shade + swing, {}, {r, r, r}, 0));
    }
  }
  if (flag_) pose_flag(t_s, out);
}

void Foliage::pose_flag(double t_s, PosedFoliage& out) const {
  constexpr int kStrips = 26;
  constexpr double kWaves = 1.3;    // along the cloth
  constexpr double kRate_hz = 1.5;  // past a place
  const Flag& f = *flag_;
  const double g = wind_.strength(f.top, t_s);
  const Vec3 across{wind_.towards.z, 0, -wind_.towards.x};
  const double step = f.width / kStrips;
  const double amplitude = 0.05 + 0.07 * g;
  for (int i = 0; i < kStrips; ++i) {
    const double s = (i + 0.5) / kStrips;
    const double angle = kTurn * (kWaves * s - kRate_hz * t_s);
    const double aside = amplitude * s * pinned_sin(angle);
    const double slope = (amplitude * pinned_sin(angle) + amplitude * s * kTurn * kWaves * pinned_cos(angle)) / f.width;
    const double sag = (0.22 - 0.14 * g) * s * s;
    const double norm = 1.0 / std::sqrt(1.0 + slope * slope);
    const Vec3 along = (wind_.towards + across * slope) * norm;
    // Local y is the cloth's normal, z points down.
    const Axes axes{along, cross(Vec3{0, -1, 0}, along), {0, -1, 0}};
    const double rise = 0.04 * s * pinned_sin(angle - 1.1);
    for (std::size_t band = 0; band < f.colours.size(); ++band) {
      const double below = (static_cast<double>(band) + 0.5) / 3.0 * f.height;
      const Vec3 center =
          f.top + wind_.towards * ((s - 0.012) * f.width) + across * aside + Vec3{0, rise - sag - below, 0};
      const Shape patch = box(center, axes, {0.62 * step, 0.006, f.height / 6.0}, 0);
      out.leaves.push_back({patch, f.colours[band], f.colours[band], 1.0, 1.0});
    }
  }
  out.clump_ends.push_back(out.leaves.size());
}

std::vector<Vec3> Foliage::clumps() const {
  std::vector<Vec3> centers;
  for (const Clump& clump : clumps_) centers.push_back(clump.center);
  return centers;
}

}  // namespace stereotrack::capture::synthetic
