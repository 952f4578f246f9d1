#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "pipeline/core/simd.hpp"
#include "pipeline/stereo/census_matcher.hpp"
#include "pipeline/stereo/median_kernel.hpp"
#include "pipeline/stereo/row_bits_kernel.hpp"
#include "pipeline/stereo/sad_matcher.hpp"
#include "tests/support/grid.hpp"

namespace stereotrack {
namespace {

using test::Grid;
using test::random_grid;
using Grey = Grid<std::uint8_t>;
using Map = Grid<std::uint16_t>;

/// Every instruction set but the plain reference, which the others are compared with.
class StereoSimd : public testing::TestWithParam<SimdTarget> {
 protected:
  void TearDown() override { EXPECT_TRUE(use_simd(simd_targets().back())); }
};

INSTANTIATE_TEST_SUITE_P(Targets, StereoSimd,
                         testing::ValuesIn(std::vector<SimdTarget>(simd_targets().begin() + 1, simd_targets().end())),
                         [](const auto& target) { return std::string(to_string(target.param)); });
// A machine may have none of them.
GTEST_ALLOW_UNINSTANTIATED_PARAMETERIZED_TEST(StereoSimd);

struct Case {
  int width = 1;
  int height = 1;
  int right_width = 1;
  int block = 3;
  int offset = 0;
  DisparityRange range;
  bool masked = false;
  Rect roi;
  int greys = 255;
};

std::ostream& operator<<(std::ostream& out, const Case& c) {
  return out << c.width << 'x' << c.height << ", right " << c.right_width << ", block " << c.block << ", offset "
             << c.offset << ", range " << c.range.min << ".." << c.range.max << ", masked " << c.masked << ", roi "
             << c.roi.left << ' ' << c.roi.top << ' ' << c.roi.width << ' ' << c.roi.height << ", greys " << c.greys;
}

/// Around every vector's width (8, 16, 32 lanes), and what chance adds.
std::vector<Case> cases() {
  std::mt19937 random(7);
  const auto pick = [&](auto... values) {
    const int all[] = {values...};
    return all[random() % std::size(all)];
  };
  std::vector<Case> result;
  for (const int width : {1, 2, 7, 8, 9, 15, 16, 17, 31, 32, 33, 63, 64, 65, 97, 131}) {
    for (int repeat = 0; repeat < 12; ++repeat) {
      Case c;
      c.width = width;
      c.height = pick(1, 2, 5, 9, 10, 22, 30);
      c.right_width = repeat % 3 == 0 ? std::max(1, width + pick(-9, -1, 1, 12)) : width;
      c.block = pick(3, 5, 9, 9, 11, 15, 17, 21);
      c.offset = pick(0, 0, 0, -7, 5, -40);
      c.range.min = pick(0, 0, 0, 1, 3, 10);
      c.range.max = c.range.min + pick(1, 2, 7, 8, 9, 15, 16, 31, 32, 33, 63, 64, 64, 65, 96, 130) - 1;
      c.masked = repeat % 2 == 1;
      c.roi = {0, 0, c.width, c.height};
      if (repeat % 4 >= 2) c.roi = {width / 3 - 1, c.height / 4, width / 2 + 2, c.height / 2 + 1};
      c.greys = pick(1, 255, 255);
      result.push_back(c);
    }
  }
  // As the pipeline asks: whole windows far from the borders.
  result.push_back({200, 40, 200, 9, 0, {0, 63}, false, {0, 0, 200, 40}, 255});
  result.push_back({300, 30, 300, 9, 0, {0, 127}, false, {0, 0, 300, 30}, 255});
  result.push_back({200, 40, 200, 9, 0, {8, 27}, true, {90, 10, 37, 20}, 255});
  return result;
}

Grey blobs(int width, int height) {
  Grey mask(width, height);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) mask.at(x, y) = (x / 11 + y / 4) % 3 == 0 && (x * y) % 7 != 3 ? 255 : 0;
  }
  return mask;
}

/// What the right camera sees: in the left half all of `left` has disparity d, noise beyond.
Grey half_shifted(const Grey& left, int right_width, int d, int greys) {
  Grey right = random_grid(right_width, left.height(), 0, greys, 2);
  for (int y = 0; y < left.height(); ++y) {
    for (int x = 0; x < std::min(left.width(), right_width) / 2; ++x) {
      if (x + d >= 0 && x + d < left.width()) right.at(x, y) = left.at(x + d, y);
    }
  }
  return right;
}

struct Output {
  Map disparity;
  std::vector<std::int64_t> counts;
};

template <class Matcher>
Output matched(const Case& c, SimdTarget target, typename Matcher::Config config) {
  EXPECT_TRUE(use_simd(target));
  const Grey left = random_grid(c.width, c.height, 0, c.greys, 1);
  // Half of it true matches, so that gates and sub-pixel have something to pass.
  const Grey right = half_shifted(left, c.right_width, c.range.min + c.range.count() / 2 + c.offset, c.greys);
  const Grey mask = blobs(c.width, c.height);
  config.width = c.width;
  config.height = c.height;
  config.right_width = c.right_width;
  config.block = c.block;
  config.offset = c.offset;
  config.range = c.range;
  Arena arena;
  auto matcher = Matcher::create(config, arena);
  EXPECT_TRUE(matcher.has_value());
  arena.seal();
  Output out{Map(c.width, c.height, 4321), {}};
  // Twice, and the second time counts: nothing may be left over from another region.
  Map other(c.width, c.height);
  (void)matcher->run(right.width() == left.width() ? right.view() : left.view(), right.view(), other.view());
  const auto counts =
      matcher->run_region(left.view(), right.view(), c.roi, c.masked ? mask.view() : ImageView<const std::uint8_t>{},
                          c.range, out.disparity.view());
  EXPECT_TRUE(counts.has_value());
  EXPECT_FALSE(arena.failed());
  if (counts.has_value()) {
    out.counts = {counts->wanted,     counts->matched,    counts->border,  counts->texture,
                  counts->uniqueness, counts->left_right, counts->speckle, counts->filled};
  }
  return out;
}

template <class Matcher>
std::int64_t expect_equal_to_reference(SimdTarget target, const typename Matcher::Config& config) {
  std::int64_t pixels = 0;
  for (const Case& c : cases()) {
    const Output plain = matched<Matcher>(c, SimdTarget::kScalar, config);
    const Output lanes = matched<Matcher>(c, target, config);
    EXPECT_TRUE(plain.disparity == lanes.disparity) << c;
    EXPECT_EQ(plain.counts, lanes.counts) << c;
    pixels += plain.counts[1];
  }
  return pixels;
}

TEST_P(StereoSimd, SadEqualsTheReferenceBitForBit) {
  EXPECT_GT(expect_equal_to_reference<SadMatcher>(GetParam(), {}), 50'000);
}

TEST_P(StereoSimd, CensusEqualsTheReferenceBitForBit) {
  EXPECT_GT(expect_equal_to_reference<CensusMatcher>(GetParam(), {}), 20'000);
}

TEST_P(StereoSimd, CensusWithoutGatesAndFiltersEqualsTheReferenceBitForBit) {
  CensusMatcher::Config config;
  config.texture = 0;
  config.uniqueness = 0;
  config.left_right_px = -1;
  config.filter = {.median = false, .speckle_size = 0, .speckle_step = 0, .fill_px = 0};
  EXPECT_GT(expect_equal_to_reference<CensusMatcher>(GetParam(), config), 50'000);
}

TEST_P(StereoSimd, CensusWithHardGatesEqualsTheReferenceBitForBit) {
  CensusMatcher::Config config;
  config.texture = 1000;
  config.uniqueness = 30;
  config.left_right_px = 0;
  EXPECT_GT(expect_equal_to_reference<CensusMatcher>(GetParam(), config), 1'000);
}

TEST_P(StereoSimd, MedianEqualsTheReferenceBitForBit) {
  ASSERT_TRUE(use_simd(GetParam()));
  for (const int width : {1, 2, 3, 8, 9, 10, 16, 17, 18, 31, 32, 33, 34, 35, 65, 100}) {
    for (const int height : {1, 2, 3, 8}) {
      for (const int holes : {0, 30, 150, 256}) {
        Map in(width, height);
        const Grey values = random_grid(width, height, 0, 255, 5);
        const Grey missing = random_grid(width, height, 0, 255, 6);
        for (int y = 0; y < height; ++y) {
          for (int x = 0; x < width; ++x) {
            in.at(x, y) = missing.at(x, y) < holes ? kNoDisparity : static_cast<std::uint16_t>(values.at(x, y) * 250);
          }
        }
        Map plain(width, height, 1);
        Map lanes(width, height, 2);
        const std::vector<std::uint16_t> none(static_cast<std::size_t>(width), kNoDisparity);
        median_reference(std::as_const(in).view(), plain.view());
        median_lanes(std::as_const(in).view(), none, lanes.view());
        ASSERT_TRUE(plain == lanes) << width << 'x' << height << " holes " << holes;
      }
    }
  }
}

TEST_P(StereoSimd, RowBitsEqualTheReferenceBitForBit) {
  ASSERT_TRUE(use_simd(GetParam()));
  std::mt19937 random(3);
  for (const int width : {0, 1, 2, 7, 8, 9, 31, 32, 33, 63, 64, 65, 66, 127, 128, 129, 200}) {
    for (const int step : {0, 3, 40, 65535}) {
      // Odd addresses, and values behind the row that must not count.
      std::vector<std::uint16_t> row(static_cast<std::size_t>(width) + 100);
      std::vector<std::uint16_t> above(row.size());
      std::vector<std::uint8_t> mask(row.size());
      for (std::size_t x = 0; x < row.size(); ++x) {
        const auto value = [&] {
          return random() % 4 == 0 ? kNoDisparity
                                   : static_cast<std::uint16_t>(random() % 2 == 0 ? random() % 50 : 65534);
        };
        row[x] = value();
        above[x] = value();
        mask[x] = static_cast<std::uint8_t>(random() % 3 == 0 ? 0 : random());
      }
      const auto words = static_cast<std::size_t>(words_of(width));
      const RowBitsTask task{row.data() + 1, above.data() + 1, width, step};
      std::vector<std::uint64_t> plain[4];
      std::vector<std::uint64_t> lanes[4];
      for (int i = 0; i < 4; ++i) {
        plain[i].assign(words, 1);
        lanes[i].assign(words, 2);
      }
      row_bits_reference(task, {plain[0].data(), plain[1].data(), plain[2].data()});
      row_bits(task, {lanes[0].data(), lanes[1].data(), lanes[2].data()});
      wanted_bits_reference(mask.data() + 1, width, plain[3].data());
      wanted_bits(mask.data() + 1, width, lanes[3].data());
      for (int i = 0; i < 4; ++i) ASSERT_EQ(plain[i], lanes[i]) << width << " px, step " << step << ", bits " << i;
    }
  }
}

}  // namespace
}  // namespace stereotrack
