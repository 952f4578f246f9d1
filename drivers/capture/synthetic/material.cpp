#include "drivers/capture/synthetic/material.hpp"

#include <cmath>

#include "pipeline/core/pinned_math.hpp"

namespace stereotrack::capture::synthetic {
namespace {

std::uint32_t scramble(std::uint32_t h) noexcept {  // MurmurHash3's finaliser
  h ^= h >> 16;
  h *= 0x85ebca6bU;
  h ^= h >> 13;
  h *= 0xc2b2ae35U;
  return h ^ (h >> 16);
}

std::uint32_t cell_bits(std::int64_t x, std::int64_t y, std::int64_t z, std::uint32_t seed) noexcept {
  return scramble(static_cast<std::uint32_t>(x) * 0x8da6b343U ^ static_cast<std::uint32_t>(y) * 0xd8163841U ^
                  static_cast<std::uint32_t>(z) * 0xcb1ab31fU ^ seed);
}

/// In [-1, 1).
double cell(std::int64_t x, std::int64_t y, std::int64_t z, std::uint32_t seed) noexcept {
  return static_cast<double>(cell_bits(x, y, z, seed)) * 0x1p-31 - 1.0;
}

double fade(double t) noexcept { return t * t * (3.0 - 2.0 * t); }

/// The whole part below and the rest, for |v| < 2^63: a call of std::floor takes longer on x86-64.
struct Split {
  explicit Split(double v) noexcept : below(static_cast<std::int64_t>(v)) {
    if (static_cast<double>(below) > v) --below;
    rest = v - static_cast<double>(below);
  }
  std::int64_t below;
  double rest;
};

/// Between the four corners of a cell.
double between(const Split& u, const Split& v, double right, double up, std::uint32_t seed) noexcept {
  return mix(mix(cell(u.below, v.below, 0, seed), cell(u.below + 1, v.below, 0, seed), right),
             mix(cell(u.below, v.below + 1, 0, seed), cell(u.below + 1, v.below + 1, 0, seed), right), up);
}

double noise(double u, double v, std::uint32_t seed) noexcept {
  const Split across(u);
  const Split upright(v);
  return between(across, upright, fade(across.rest), fade(upright.rest), seed);
}

double noise(Vec3 p, std::uint32_t seed) noexcept {
  const Split x(p.x);
  const Split y(p.y);
  const Split z(p.z);
  const double right = fade(x.rest);
  const double up = fade(y.rest);
  const auto slice = [&](std::int64_t at) {
    return between(x, y, right, up, scramble(seed ^ static_cast<std::uint32_t>(at)));
  };
  return mix(slice(z.below), slice(z.below + 1), fade(z.rest));
}

double fraction(double v) noexcept { return Split(v).rest; }
std::int64_t whole(double v) noexcept { return Split(v).below; }

/// Position on the surface [m]; the face tells flat sides apart.
struct Place {
  double u = 0;
  double v = 0;
  int face = 0;  ///< 0 round or +-z, 1 +-x, 2 +-y
};

Place unroll(const Shape& shape, Vec3 p, Vec3 n) noexcept {
  if (shape.kind == ShapeKind::kBox) {
    if (std::abs(n.x) > 0.5) return {p.z, p.y, 1};
    if (std::abs(n.y) > 0.5) return {p.x, p.z, 2};
    return {p.x, p.y, 0};
  }
  if (shape.kind == ShapeKind::kCylinder && std::abs(n.y) > 0.5) return {p.x, p.z, 2};
  return {pinned_atan2(p.x, -p.z) * shape.half.x, p.y, 0};
}

/// Distance to the nearest multiple of `period`.
double to_grid(double v, double period) noexcept {
  const double f = fraction(v / period + 0.5) - 0.5;
  return std::abs(f) * period;
}

Vec3 mottled(Vec3 colour, double amount) noexcept { return colour * (1.0 + amount); }

Vec3 paving(const Material& m, double u, double v) noexcept {
  const double size = m.scale;
  const std::int64_t row = whole(v / size);
  const double shifted = u + ((row & 1) != 0 ? 0.5 * size : 0.0);
  const std::int64_t column = whole(shifted / size);
  const double tone = cell(column, row, 1, m.seed);
  const double stain = fractal_noise(u * 0.35, v * 0.35, 4, m.seed + 11);
  const double grain = fractal_noise(u * 9.0, v * 9.0, 3, m.seed + 12);
  Vec3 colour = mottled(m.a, 0.13 * tone + 0.30 * stain + 0.16 * grain);
  if (cell_bits(column, row, 2, m.seed) % 9 == 0) colour = mix(colour, m.c, 0.45);
  const double joint = std::fmin(to_grid(shifted, size), to_grid(v, size));
  return mix(colour, mottled(m.b, 0.3 * grain), 1.0 - smoothstep(0.006, 0.016, joint));
}

Vec3 asphalt(const Material& m, double u, double v) noexcept {
  const double patch = smoothstep(0.05, 0.25, fractal_noise(u * 0.3, v * 0.3, 4, m.seed));
  const double grain =
      fractal_noise(u * 22.0, v * 22.0, 2, m.seed + 3) + 0.7 * fractal_noise(u * 4.0, v * 4.0, 2, m.seed + 4);
  const double crack_field = fractal_noise(u * 0.8, v * 0.8, 4, m.seed + 5);
  const double crack = 1.0 - smoothstep(0.006, 0.018, std::abs(crack_field));
  return mottled(mix(m.a, m.b, patch), 0.28 * grain - 0.45 * crack);
}

Vec3 brick(const Material& m, double u, double v) noexcept {
  constexpr double kLength = 0.25;
  constexpr double kHeight = 0.083;
  const std::int64_t row = whole(v / kHeight);
  const double shifted = u + ((row & 1) != 0 ? 0.5 * kLength : 0.0);
  const std::int64_t column = whole(shifted / kLength);
  const double tone = cell(column, row, 0, m.seed);
  const double weather = fractal_noise(u * 0.5, v * 0.9, 4, m.seed + 7);
  const double grain = fractal_noise(u * 14.0, v * 14.0, 2, m.seed + 8);
  Vec3 colour = mottled(mix(m.a, m.b, 0.5 + 0.5 * tone), 0.28 * weather + 0.14 * grain);
  if (cell_bits(column, row, 5, m.seed) % 13 == 0) colour = colour * 0.55;
  const double joint = std::fmin(to_grid(shifted, kLength), to_grid(v, kHeight));
  return mix(colour, mottled(m.c, 0.25 * weather), 1.0 - smoothstep(0.004, 0.009, joint));
}

Vec3 concrete(const Material& m, double u, double v) noexcept {
  const double cloud = fractal_noise(u * 0.9, v * 0.9, 5, m.seed);
  const double streak = smoothstep(0.1, 0.7, fractal_noise(u * 5.0, v * 0.35, 3, m.seed + 1));
  Vec3 colour = mix(mottled(m.a, 0.22 * cloud), m.b, 0.45 * streak);
  const double joint = std::fmin(to_grid(u, m.scale), to_grid(v, m.scale));
  colour = colour * (1.0 - 0.55 * (1.0 - smoothstep(0.008, 0.018, joint)));
  const double hu = to_grid(u + 0.5 * m.scale, m.scale) - 0.3 * m.scale;
  const double hv = to_grid(v + 0.5 * m.scale, m.scale) - 0.3 * m.scale;
  return colour * (1.0 - 0.5 * (1.0 - smoothstep(0.02, 0.03, std::sqrt(hu * hu + hv * hv))));
}

Vec3 corrugated(const Material& m, double u, double v) noexcept {
  const double fold = fraction(u / m.scale);
  // Flat, slope, flat, slope: the slopes take more or less of the light.
  double shade = 1.0;
  if (fold < 0.2) shade = 0.72;
  if (fold >= 0.5 && fold < 0.7) shade = 1.22;
  const double rust = smoothstep(0.25, 0.6, fractal_noise(u * 0.9, v * 0.9, 5, m.seed));
  Vec3 colour = mix(mottled(m.a, 0.12 * fractal_noise(u * 3.0, v * 0.8, 3, m.seed + 2)), m.c, 0.7 * rust);
  // The owner's livery: a broad and a thin line.
  if (std::abs(v - 0.42) < 0.16 || std::abs(v - 0.16) < 0.03) colour = mix(colour, m.b, 0.85 - 0.5 * rust);
  return colour * shade;
}

Vec3 poster(const Material& m, const Shape& shape, Place p) noexcept {
  const double x = p.u / shape.half.x;  // -1..1
  const double y = p.v / shape.half.y;
  if (std::abs(x) > 0.93 || std::abs(y) > 0.95) return m.c;
  const double disc_x = 0.25 * cell(1, 0, 0, m.seed);
  const double dx = (x - disc_x) * shape.half.x;
  const double dy = (y - 0.3) * shape.half.y;
  const double radius = (0.4 + 0.12 * cell(2, 0, 0, m.seed)) * shape.half.x;
  if (dx * dx + dy * dy < radius * radius) return dx * dx + dy * dy < 0.3 * radius * radius ? m.c : m.b;
  if (y < -0.3) {
    const double line = fraction(y * 6.0);
    const double end = 0.35 + 0.4 * cell(whole(y * 6.0), 3, 0, m.seed);
    if (line < 0.55 && x > -0.8 && x < end && cell(whole(x * 12.0), whole(y * 6.0), 4, m.seed) > -0.75) return m.c;
  }
  return mottled(mix(m.a, m.b, 0.35 * smoothstep(-1.0, 1.0, y + 0.4 * x)), 0.08 * noise(x * 5.0, y * 5.0, m.seed));
}

Vec3 facade(const Material& m, double u, double v) noexcept {
  const double fu = fraction(u / m.scale);
  const double fv = fraction(v / (1.15 * m.scale));
  const Vec3 wall = mottled(m.a, 0.14 * fractal_noise(u * 0.4, v * 0.4, 4, m.seed));
  if (fu < 0.28 || fu > 0.75 || fv < 0.25 || fv > 0.8) return wall;
  if (fu < 0.32 || fu > 0.71 || fv < 0.29 || fv > 0.77 || std::abs(fu - 0.515) < 0.015) return m.c;
  const double lit = cell(whole(u / m.scale), whole(v / (1.15 * m.scale)), 0, m.seed);
  return m.b * (1.0 + 0.6 * lit + 0.4 * fv);
}

Vec3 glass(const Material& m, const Shape& shape, Place p) noexcept {
  const double edge = std::fmin(shape.half.x - std::abs(p.u), shape.half.y - std::abs(p.v));
  if (edge < 0.05 || std::abs(p.u) < 0.025 || std::abs(p.v - 0.15) < 0.02) return m.a;
  const double sheen = smoothstep(-0.6, 0.9, p.u * 0.7 + p.v + 0.25 * noise(p.u * 2.0, p.v * 2.0, m.seed));
  return mix(m.b, m.c, 0.55 * sheen);
}

Vec3 logo(const Material& m, Place p, double grain) noexcept {
  const double u = (fraction(p.u / m.scale + 0.5) - 0.5) * m.scale;
  const double v = (fraction(p.v / m.scale + 0.5) - 0.5) * m.scale;
  const double r = std::sqrt(u * u + v * v) / m.scale;
  if (r < 0.36) {
    if (r > 0.28) return m.c;
    if (std::abs(v) < 0.06 * m.scale) return m.c;
    return m.b;
  }
  return mottled(m.a, grain);
}

Vec3 cardboard(const Material& m, const Shape& shape, Place p) noexcept {
  const double flute =
      0.05 * noise(p.u * 60.0, p.v * 3.0, m.seed) + 0.10 * fractal_noise(p.u * 2.0, p.v * 2.0, 3, m.seed + 1);
  const Vec3 base = mottled(m.a, flute);
  if (p.face == 2) return std::abs(p.v) < 0.06 ? mottled(m.b, 0.3 * flute) : base;
  const double width = p.face == 1 ? shape.half.z : shape.half.x;
  const double edge = std::fmin(width - std::abs(p.u), shape.half.y - std::abs(p.v));
  if (std::abs(p.u) < 0.045 && p.v > 0.25 * shape.half.y) return mottled(m.b, 0.3 * flute);
  if (edge < 0.02) return base * 0.75;
  const double x = p.u / width - 0.45;
  const double y = p.v / shape.half.y + 0.35;
  if (std::abs(x) < 0.32 && std::abs(y) < 0.3) {  // address label
    const bool ink =
        fraction(y * 9.0) < 0.5 && cell(whole(x * 30.0), whole(y * 9.0), 7, m.seed) > -0.4 && std::abs(x) < 0.27;
    return ink ? m.c * 0.08 : m.c;
  }
  const double ax = p.u / width + 0.5;
  const double ay = p.v / shape.half.y - 0.05;
  if (std::abs(ay) < 0.42 && std::abs(ax) < 0.26 * (ay > 0.1 ? (0.42 - ay) / 0.32 : 0.42)) return m.b * 0.35;  // arrow
  return base;
}

Vec3 planks(const Material& m, const Shape& shape, Place p) noexcept {
  const double width = p.face == 1 ? shape.half.z : shape.half.x;
  const double height = p.face == 2 ? shape.half.z : shape.half.y;
  const std::int64_t board = whole(p.v / m.scale);
  const double fibre = fractal_noise(p.u * 2.5, p.v * 40.0, 3, m.seed + static_cast<std::uint32_t>(p.face));
  Vec3 colour = mottled(m.a, 0.16 * cell(board, p.face, 0, m.seed) + 0.22 * fibre);
  colour = colour * (1.0 - 0.65 * (1.0 - smoothstep(0.004, 0.012, to_grid(p.v, m.scale))));
  const double edge = std::fmin(width - std::abs(p.u), height - std::abs(p.v));
  if (edge < 0.08) return mottled(m.b, 0.2 * fibre) * (edge > 0.07 ? 0.5 : 1.0);
  return colour;
}

}  // namespace

Vec3 rgb(int red, int green, int blue) noexcept {
  // The sensor's curve is about a square root (sensor.hpp), so its inverse is about a square.
  const auto linear = [](int v) { return static_cast<double>(v * v) / (255.0 * 255.0); };
  return {linear(red), linear(green), linear(blue)};
}

double fractal_noise(double u, double v, int octaves, std::uint32_t seed) noexcept {
  double sum = 0;
  double amplitude = 0.6;
  for (int i = 0; i < octaves; ++i) {
    sum += amplitude * noise(u, v, scramble(seed + static_cast<std::uint32_t>(i)));
    amplitude *= 0.5;
    u = u * 2.03 + 17.1;
    v = v * 2.03 + 5.3;
  }
  return sum;
}

double fractal_noise(Vec3 p, int octaves, std::uint32_t seed) noexcept {
  double sum = 0;
  double amplitude = 0.6;
  for (int i = 0; i < octaves; ++i) {
    sum += amplitude * noise(p, scramble(seed + static_cast<std::uint32_t>(i)));
    amplitude *= 0.5;
    p = p * 2.03 + Vec3{17.1, 5.3, 9.7};
  }
  return sum;
}

Vec3 reflectance(const Material& m, const Shape& shape, Vec3 local, Vec3 normal) noexcept {
  const Place p = unroll(shape, local, normal);
  switch (m.pattern) {
    case Pattern::kPlain: return mottled(m.a, 0.12 * fractal_noise(local * 6.0, 2, m.seed));
    case Pattern::kFabric: {
      const double folds = 0.20 * fractal_noise(local * 7.0, 2, m.seed) + 0.10 * noise(local * 45.0, m.seed + 1);
      return mottled(local.y < m.scale ? m.b : m.a, folds);
    }
    case Pattern::kStripes: {
      const double f = fraction(local.y / m.scale);
      const Vec3 colour = f < 0.5 ? m.a : (f > 0.9 ? m.c : m.b);
      return mottled(colour, 0.14 * fractal_noise(local * 7.0, 2, m.seed));
    }
    case Pattern::kUpright:
      return mottled(fraction(p.u / m.scale) < 0.5 ? m.a : m.b, 0.12 * fractal_noise(local * 7.0, 2, m.seed));
    case Pattern::kChecks: {
      const bool odd = ((whole(p.u / m.scale) + whole(p.v / m.scale)) & 1) != 0;
      return mottled(odd ? m.a : m.b, 0.10 * noise(local * 8.0, m.seed));
    }
    case Pattern::kPatches: {
      const double field = fractal_noise(local * (1.0 / m.scale), 3, m.seed);
      const Vec3 colour = field < -0.12 ? m.a : (field < 0.16 ? m.b : m.c);
      return mottled(colour, 0.10 * noise(local * 40.0, m.seed + 9));
    }
    case Pattern::kSegments: {
      if (std::abs(local.y) > 0.93 * shape.half.y) return m.a;
      const double turn = pinned_atan2(local.x, local.z) * (3.0 / std::numbers::pi) + 3.0;  // 0..6
      const auto sector = static_cast<int>(turn) % 6;
      if (sector % 2 == 0) return m.a;
      return sector == 3 ? m.c : m.b;
    }
    case Pattern::kFootball: {
      // Spots at the twelve corners of an icosahedron.
      const Vec3 n = normalized(local);
      constexpr double kGolden = 1.6180339887498949;
      const double x = std::abs(n.x);
      const double y = std::abs(n.y);
      const double z = std::abs(n.z);
      const double nearest =
          std::fmax(std::fmax(y + kGolden * z, x + kGolden * y), z + kGolden * x) / 1.9021130325903071;
      return nearest > 0.915 ? m.b : m.a;
    }
    case Pattern::kLogo: return logo(m, p, 0.10 * fractal_noise(local * 6.0, 2, m.seed));
    case Pattern::kHazard:
      return mottled(fraction((p.u + p.v) / m.scale) < 0.5 ? m.a : m.b, 0.10 * fractal_noise(local * 6.0, 2, m.seed));
    case Pattern::kCardboard: return cardboard(m, shape, p);
    case Pattern::kPlanks: return planks(m, shape, p);
    case Pattern::kPaving: return paving(m, p.u, p.v);
    case Pattern::kAsphalt: return asphalt(m, p.u, p.v);
    case Pattern::kBrick: return brick(m, p.u, p.v);
    case Pattern::kConcrete: return concrete(m, p.u, p.v);
    case Pattern::kCorrugated: return corrugated(m, p.u, p.v);
    case Pattern::kShutter: {
      const double slat = fraction(p.v / m.scale);
      const double shade = 0.75 + 0.45 * slat * (1.0 - slat) * 4.0 - (slat < 0.12 ? 0.35 : 0.0);
      return mottled(m.a, 0.16 * fractal_noise(p.u * 1.3, p.v * 0.5, 4, m.seed)) * shade;
    }
    case Pattern::kFoliage: {
      const double leaf = fractal_noise(local * (1.0 / m.scale), 4, m.seed);
      return mix(m.a, m.b, smoothstep(-0.45, 0.5, leaf)) *
             (0.75 + 0.5 * smoothstep(-0.2, 0.25, noise(local * (3.1 / m.scale), m.seed + 1)));
    }
    case Pattern::kFacade: return facade(m, p.u, p.v);
    case Pattern::kPoster: return poster(m, shape, p);
    case Pattern::kGlass: return glass(m, shape, p);
  }
  return m.a;
}

}  // namespace stereotrack::capture::synthetic
