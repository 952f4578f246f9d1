#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

#include "pipeline/core/arena.hpp"
#include "pipeline/geometry/remap_kernel.hpp"
#include "tests/support/each_target.hpp"

namespace stereotrack {
namespace {

struct Size {
  int width;
  int height;
};

/// A raw picture, and a canvas that is turned by `angle` and shrunk by `scale` against it.
class Scene {
 public:
  Scene(Size raw_size, Size canvas, double angle, double scale) {
    std::mt19937 engine(7);
    raw = arena_.image<std::uint8_t>(raw_size.width, raw_size.height);
    for (int y = 0; y < raw.height; ++y) {
      for (int x = 0; x < raw.width; ++x) raw.at(x, y) = static_cast<std::uint8_t>(engine());
    }
    table.corner = arena_.image<RawPixel>(canvas.width, canvas.height);
    table.fractions = arena_.image<std::uint16_t>(canvas.width, canvas.height);
    table.mask = arena_.image<std::uint8_t>(canvas.width, canvas.height);
    table.window = arena_.image<RawPixel>(canvas.width, canvas.height);
    table.place = arena_.image<std::uint8_t>(canvas.width, canvas.height);
    constexpr int kSub = RemapTable::kSubPixels;
    for (int v = 0; v < canvas.height; ++v) {
      for (int u = 0; u < canvas.width; ++u) {
        const int x =
            static_cast<int>(std::floor(kSub * scale * (u * std::cos(angle) - v * std::sin(angle)))) - 3 * kSub;
        const int y = static_cast<int>(std::floor(kSub * scale * (u * std::sin(angle) + v * std::cos(angle))));
        if (x < 0 || y < 0 || x > (raw.width - 1) * kSub || y > (raw.height - 1) * kSub) continue;
        const RawPixel corner{static_cast<std::int16_t>(std::min(x / kSub, raw.width - 2)),
                              static_cast<std::int16_t>(std::min(y / kSub, raw.height - 2))};
        table.corner.at(u, v) = corner;
        table.fractions.at(u, v) = static_cast<std::uint16_t>(x - corner.x * kSub + 64 * (y - corner.y * kSub));
        table.mask.at(u, v) = 255;
      }
    }
    table.find_windows(raw.width, raw.height);
  }

  void expect_reference_on_each_target() const {
    const auto length = static_cast<std::size_t>(table.corner.width) + 1;
    for (const Sampling sampling : {Sampling::kBilinear, Sampling::kNearest}) {
      for (int v = 0; v < table.corner.height; ++v) {
        std::vector<std::uint8_t> expected(length, 77);
        remap_row_reference(raw, table, v, sampling, expected.data());
        test::on_each_target([&] {
          std::vector<std::uint8_t> got(length, 77);
          remap_row(raw, table, v, sampling, got.data());
          EXPECT_EQ(got, expected) << "row " << v;
        });
      }
    }
  }

  [[nodiscard]] int windows() const {
    int count = 0;
    for (int v = 0; v < table.corner.height; ++v) {
      for (int u = 0; u < table.corner.width; u += RemapTable::kBlock) {
        count += table.window.at(u / RemapTable::kBlock, v).valid() ? 1 : 0;
      }
    }
    return count;
  }

 private:
  Arena arena_;

 public:
  ImageView<std::uint8_t> raw;
  RemapTable table;
};

TEST(RemapKernel, EveryWidthIsTheReference) {
  for (int width = 1; width <= 40; ++width) Scene({64, 20}, {width, 20}, 0.05, 1.02).expect_reference_on_each_target();
}

TEST(RemapKernel, SmallTurnsAreAllWindowsAndTheReference) {
  for (const double angle : {-0.1, -0.01, 0.0, 0.03, 0.1}) {
    for (const double scale : {0.4, 0.97, 1.0, 1.3}) {
      const Scene scene({200, 120}, {160, 100}, angle, scale);
      scene.expect_reference_on_each_target();
      EXPECT_EQ(scene.windows(), 20 * 100) << angle << " " << scale;
    }
  }
}

TEST(RemapKernel, LargeTurnsAndShrinkingLeaveTheWindowsAndAreTheReference) {
  for (const double angle : {0.3, 0.5, 0.9}) {
    const Scene scene({200, 120}, {160, 100}, angle, 1);
    scene.expect_reference_on_each_target();
    EXPECT_LT(scene.windows(), 20 * 100) << angle;
  }
  const Scene shrunk({400, 300}, {160, 100}, 0, 2.5);
  shrunk.expect_reference_on_each_target();
  EXPECT_LT(shrunk.windows(), 20 * 100);
}

TEST(RemapKernel, PicturesTooSmallForAWindowHaveNone) {
  for (const Size raw : {Size{2, 2}, Size{15, 30}, Size{30, 2}}) {
    const Scene scene(raw, {24, 12}, 0, 1);
    EXPECT_EQ(scene.windows(), 0);
    scene.expect_reference_on_each_target();
  }
  const Scene smallest({16, 3}, {24, 12}, 0, 1);
  EXPECT_EQ(smallest.windows(), 3 * 12);
  smallest.expect_reference_on_each_target();
}

// All mixtures of black and white corners with all fractions, to the last row and column.
TEST(RemapKernel, EveryFractionOfEveryContrastIsTheReference) {
  Scene scene({16, 3}, {33 * 33, 16}, 0, 1);
  for (int corners = 0; corners < 16; ++corners) {
    for (int i = 0; i < 33 * 33; ++i) {
      scene.table.corner.at(i, corners) = {14, 1};
      scene.table.fractions.at(i, corners) = static_cast<std::uint16_t>(i % 33 + 64 * (i / 33));
      scene.table.mask.at(i, corners) = 255;
    }
  }
  scene.table.find_windows(16, 3);
  for (const int bright : {1, 254, 255}) {
    for (int corners = 0; corners < 16; ++corners) {
      for (int i = 0; i < 4; ++i) {
        scene.raw.at(14 + i % 2, 1 + i / 2) = static_cast<std::uint8_t>((corners >> i & 1) != 0 ? bright : 0);
      }
      scene.expect_reference_on_each_target();
    }
  }
}

// Halfway goes to the right and down; checked by hand.
TEST(RemapKernel, NearestTakesOneOfTheFourPixels) {
  Scene scene({16, 3}, {4, 1}, 0, 1);
  scene.raw.at(5, 1) = 10;
  scene.raw.at(6, 1) = 20;
  scene.raw.at(5, 2) = 30;
  scene.raw.at(6, 2) = 40;
  const int fractions[4] = {15 + 64 * 15, 16 + 64 * 15, 15 + 64 * 16, 16 + 64 * 16};
  for (int i = 0; i < 4; ++i) {
    scene.table.corner.at(i, 0) = {5, 1};
    scene.table.fractions.at(i, 0) = static_cast<std::uint16_t>(fractions[i]);
    scene.table.mask.at(i, 0) = 255;
  }
  scene.table.find_windows(16, 3);
  test::on_each_target([&] {
    std::vector<std::uint8_t> out(4);
    remap_row(scene.raw, scene.table, 0, Sampling::kNearest, out.data());
    EXPECT_EQ(out, (std::vector<std::uint8_t>{10, 20, 30, 40}));
  });
}

}  // namespace
}  // namespace stereotrack
