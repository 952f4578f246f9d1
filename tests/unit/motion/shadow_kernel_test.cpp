#include "pipeline/motion/shadow_kernel.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "pipeline/core/arena.hpp"
#include "tests/support/each_target.hpp"
#include "tests/support/grid.hpp"

namespace stereotrack {
namespace {

using test::on_each_target;
using test::random_grid;
using Plane = test::Grid<std::uint8_t>;

struct Planes {
  Planes(int width, int height)
      : y(width, height),
        cb(width, height),
        cr(width, height),
        y_background(width, height),
        cb_background(width, height),
        cr_background(width, height) {}
  Plane y, cb, cr, y_background, cb_background, cr_background;

  LookPlanes input(bool colour) {
    LookPlanes in;
    in.y = y.view();
    in.y_background = y_background.view();
    if (!colour) return in;
    in.cb = cb.view();
    in.cr = cr.view();
    in.cb_background = cb_background.view();
    in.cr_background = cr_background.view();
    return in;
  }
};

/// A background under another light, with noise of which some is too much: all verdicts occur.
Planes scene(int width, int height, double light, int noise, unsigned seed) {
  const auto seen = [](const Plane& background, double factor, const Plane& grain) {
    Plane now(background.width(), background.height());
    for (int y = 0; y < now.height(); ++y) {
      for (int x = 0; x < now.width(); ++x) {
        const long lit = std::lround(background.at(x, y) * factor) + grain.at(x, y);
        now.at(x, y) = static_cast<std::uint8_t>(std::min(lit, 255L));
      }
    }
    return now;
  };
  Planes p(width, height);
  p.y_background = random_grid(width, height, 60, 120, seed);
  p.y = seen(p.y_background, light, random_grid(width, height, 0, noise, seed + 1));
  for (auto [now, background] : {std::pair{&p.cb, &p.cb_background}, std::pair{&p.cr, &p.cr_background}}) {
    *background = random_grid(width, height, 118, 138, seed + 2);
    *now = seen(*background, 1, random_grid(width, height, 0, noise, seed + 3));
  }
  return p;
}

void expect_reference(Planes& planes, const LookTolerances& tolerances, int from, int to,
                      std::array<int, 16>* seen = nullptr) {
  for (const bool colour : {false, true}) {
    const LookPlanes in = planes.input(colour);
    for (int v = 0; v < in.y.height; ++v) {
      std::vector<std::uint8_t> expected(static_cast<std::size_t>(in.y.width), 77);
      look_row_reference(in, tolerances, v, from, to, expected.data());
      on_each_target([&] {
        std::vector<std::uint8_t> got(static_cast<std::size_t>(in.y.width), 77);
        look_row(in, tolerances, v, from, to, got.data());
        for (int x = from; x < to; ++x) {
          ASSERT_EQ(got[static_cast<std::size_t>(x)], expected[static_cast<std::size_t>(x)]) << x << " " << v;
        }
      });
      if (seen == nullptr) continue;
      for (int x = from; x < to; ++x) ++(*seen)[expected[static_cast<std::size_t>(x)]];
    }
  }
}

TEST(ShadowKernel, LooksAreTheReferenceUnderEveryLightAndAllKindsOccur) {
  std::array<int, 16> seen{};
  unsigned seed = 0;
  for (const double light : {0.1, 0.13, 0.2, 0.39, 0.41, 0.7, 0.96, 0.98, 1.3, 1.9, 2.1}) {
    for (const int noise : {4, 12, 40, 120}) {
      Planes planes = scene(90, 12, light, noise, seed += 10);
      expect_reference(planes, {40, 8, 5}, 0, 90, &seen);
    }
  }
  for (const int looks : {0, kTexture | kTextureWide, kTexture | kSameLook | kTextureWide | kSameLookWide,
                          kTexture | kTextureWide | kSameLookWide, +kTextureWide, kTextureWide | kSameLookWide}) {
    EXPECT_GT(seen[static_cast<std::size_t>(looks)], 100) << looks;
  }
}

TEST(ShadowKernel, EveryPartOfARowIsTheReference) {
  Planes planes = scene(75, 3, 0.6, 12, 1);
  for (int from = 0; from <= 75; from += 1 + from / 8) {
    for (int to = from; to <= 75; to += 1 + (to - from) / 4) expect_reference(planes, {40, 8, 5}, from, to);
  }
  for (int width = 1; width < 40; ++width) {
    Planes narrow = scene(width, 2, 0.6, 12, static_cast<unsigned>(width));
    expect_reference(narrow, {40, 8, 5}, 0, width);
  }
}

// Black backgrounds make the ratio as large as it gets.
TEST(ShadowKernel, ExtremesAreTheReference) {
  constexpr int kWidth = 80;
  constexpr int kHeight = 9;
  for (const LookTolerances& tolerances : {LookTolerances{1, 0, 0}, LookTolerances{99, 255, 255}}) {
    for (const int brightest : {0, 1, 2, 255}) {
      Planes planes(kWidth, kHeight);
      planes.y = random_grid(kWidth, kHeight, 250, 255, 1);
      planes.y_background = random_grid(kWidth, kHeight, 0, brightest, 2);
      const Plane dark = random_grid(kWidth, kHeight, 0, 9, 3);
      for (int y = 0; y < kHeight; ++y) {
        for (int x = 0; x < kWidth; ++x) {
          if (dark.at(x, y) > 0) planes.y_background.at(x, y) = 0;
        }
      }
      planes.cb = random_grid(kWidth, kHeight, 0, 255, 4);
      planes.cr = random_grid(kWidth, kHeight, 0, 255, 5);
      planes.cb_background = random_grid(kWidth, kHeight, 0, 255, 6);
      planes.cr_background = random_grid(kWidth, kHeight, 0, 255, 7);
      expect_reference(planes, tolerances, 0, kWidth);
    }
  }
}

TEST(ShadowKernel, VotesAreTheReferenceAtEveryWidthAndNothingBesideIsTouched) {
  for (int width = 1; width <= 140; ++width) {
    Arena arena;
    constexpr int kHeight = 7;
    const ImageView<std::int8_t> verdicts =
        arena.image<std::int8_t>(width + 2 * kVerdictFrame, kHeight + 4).window(kVerdictFrame, 2, width, kHeight);
    const Plane drawn = random_grid(width, kHeight, 0, 2, static_cast<unsigned>(width));
    Plane mask(width, kHeight);
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < width; ++x) {
        verdicts.at(x, y) = static_cast<std::int8_t>(drawn.at(x, y) - 1);
        mask.at(x, y) = drawn.at(x, y) == 1 ? 0 : 255;
        if (x > 70 && x < 140) mask.at(x, y) = 0;  // a vector without work
      }
    }
    for (int y = 0; y < kHeight; ++y) {
      Plane expected = mask;
      const int cleared = clear_outvoted_reference(verdicts, y, expected.row(y));
      int changed = 0;
      for (int x = 0; x < width; ++x) changed += expected.at(x, y) != mask.at(x, y) ? 1 : 0;
      EXPECT_EQ(cleared, changed);
      on_each_target([&] {
        Plane got = mask;
        EXPECT_EQ(clear_outvoted(verdicts, y, got.row(y)), cleared);
        EXPECT_TRUE(got == expected) << width;
      });
    }
  }
}

}  // namespace
}  // namespace stereotrack
