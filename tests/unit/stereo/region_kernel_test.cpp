#include "pipeline/stereo/region_kernel.hpp"

#include <gtest/gtest.h>

#include <random>
#include <vector>

#include "tests/support/each_target.hpp"

namespace stereotrack {
namespace {

struct Sums {
  explicit Sums(int lanes) : values(4, std::vector<std::int32_t>(static_cast<std::size_t>(lanes) + 1, 0)) {
    for (std::vector<std::int32_t>& of_kind : values) of_kind.back() = -9;
  }
  [[nodiscard]] RegionSums view() {
    const auto but_last = [](std::vector<std::int32_t>& v) { return std::span(v).first(v.size() - 1); };
    return {but_last(values[0]), but_last(values[1]), but_last(values[2]), but_last(values[3])};
  }
  std::vector<std::vector<std::int32_t>> values;  ///< one more each, which must stay
};

TEST(RegionKernel, EveryNumberOfLanesIsTheReferenceInsideAndAcrossTheBorders) {
  constexpr int kWidth = 90;
  constexpr int kHeight = 12;
  std::mt19937 engine(11);
  for (const bool extreme : {false, true}) {
    std::vector<std::uint8_t> right(kWidth * kHeight);
    std::vector<std::uint8_t> moving(right.size());
    for (std::uint8_t& pixel : right) pixel = extreme ? 0 : static_cast<std::uint8_t>(engine());
    for (std::uint8_t& pixel : moving) pixel = extreme || engine() % 2 == 0 ? 255 : 0;
    const ImageView<const std::uint8_t> right_view{right.data(), kWidth, kHeight, kWidth};
    const ImageView<const std::uint8_t> moving_view{moving.data(), kWidth, kHeight, kWidth};
    std::vector<RegionSample> samples(700);  // more than are summed up in 16 bits
    for (RegionSample& sample : samples) {
      sample = {static_cast<std::int16_t>(50 + engine() % 30), static_cast<std::int16_t>(engine() % kHeight),
                static_cast<std::int16_t>(extreme ? 255 : engine() % 256)};
    }
    for (int lanes = 1; lanes <= 70; ++lanes) {
      for (const int row_offset : {-1, 0, 2}) {
        for (const bool moves : {false, true}) {
          for (const int shift : {-40, -75, 0}) {
            const RegionTask task{.samples = samples,
                                  .right = right_view,
                                  .moving = moves ? moving_view : ImageView<const std::uint8_t>{},
                                  .shift = shift,
                                  .row_offset = row_offset,
                                  .lanes = lanes};
            Sums expected(lanes);
            region_sums_reference(task, expected.view());
            test::on_each_target([&] {
              Sums got(lanes);
              region_sums(task, got.view());
              EXPECT_EQ(got.values, expected.values) << lanes << ' ' << row_offset << ' ' << shift;
            });
          }
        }
      }
    }
  }
}

TEST(RegionKernel, OnePixelByHand) {
  const std::vector<std::uint8_t> right{10, 20, 30};
  const std::vector<std::uint8_t> moving{0, 255, 1};
  const std::vector<RegionSample> samples{{5, 0, 25}};
  test::on_each_target([&] {
    Sums sums(4);
    region_sums({samples, {right.data(), 3, 1, 3}, {moving.data(), 3, 1, 3}, -6, 0, 4}, sums.view());
    EXPECT_EQ(sums.values[0], (std::vector<std::int32_t>{0, 15, 5, -5, -9}));
    EXPECT_EQ(sums.values[1], (std::vector<std::int32_t>{0, 225, 25, 25, -9}));
    EXPECT_EQ(sums.values[2], (std::vector<std::int32_t>{0, 0, 1, 1, -9}));
    EXPECT_EQ(sums.values[3], (std::vector<std::int32_t>{0, 1, 1, 1, -9}));
  });
}

TEST(RegionKernel, PartsAddUpToTheWhole) {
  constexpr int kWidth = 120;
  constexpr int kHeight = 9;
  std::mt19937 engine(3);
  std::vector<std::uint8_t> right(kWidth * kHeight);
  for (std::uint8_t& pixel : right) pixel = static_cast<std::uint8_t>(engine());
  const ImageView<const std::uint8_t> view{right.data(), kWidth, kHeight, kWidth};
  std::vector<RegionSample> samples(300);
  for (RegionSample& sample : samples) {
    sample = {static_cast<std::int16_t>(10 + engine() % 20), static_cast<std::int16_t>(engine() % kHeight),
              static_cast<std::int16_t>(engine() % 256)};
  }
  RegionTask task{.samples = samples, .right = view, .moving = view, .shift = -10, .row_offset = 0, .lanes = 40};
  Sums expected(task.lanes);
  region_sums_reference(task, expected.view());
  for (const bool inside : {false, true}) {  // lanes up to the second step's end lie in the picture
    test::on_each_target([&] {
      Sums got(task.lanes);
      for (const auto& [first, count] : {std::pair<std::size_t, std::size_t>{0, 1}, {1, 16}, {17, 0}, {17, 283}}) {
        RegionTask part = task;
        part.samples = task.samples.subspan(first, count);
        part.inside = inside;
        region_sums(part, got.view());
      }
      EXPECT_EQ(got.values, expected.values) << inside;
    });
  }
}

TEST(RegionKernel, NoSampleIsNoSum) {
  const std::vector<std::uint8_t> right(64, 7);
  test::on_each_target([&] {
    Sums sums(20);
    region_sums({{}, {right.data(), 64, 1, 64}, {}, 0, 0, 20}, sums.view());
    for (std::vector<std::int32_t>& values : sums.values) {
      values.pop_back();
      EXPECT_EQ(values, std::vector<std::int32_t>(20, 0));
    }
  });
}

}  // namespace
}  // namespace stereotrack
