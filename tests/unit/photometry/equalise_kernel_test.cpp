#include "pipeline/photometry/equalise_kernel.hpp"

#include <gtest/gtest.h>

#include <random>
#include <vector>

#include "tests/support/each_target.hpp"

namespace stereotrack {
namespace {

TEST(EqualiseKernel, EveryLevelAndLengthIsTheReferenceAndNothingBeyondIsTouched) {
  std::mt19937 engine(1);
  GreyTable table;
  for (std::uint8_t& value : table) value = static_cast<std::uint8_t>(engine());
  std::vector<std::uint8_t> levels(257 + 256);
  for (std::size_t i = 0; i < levels.size(); ++i) levels[i] = static_cast<std::uint8_t>(i);
  std::vector<int> lengths(std::begin(test::kRowLengths), std::end(test::kRowLengths));
  lengths.push_back(512);
  for (const int width : lengths) {
    std::vector<std::uint8_t> expected = levels;
    map_row_reference(table, width, expected.data() + 1);
    for (int x = 0; x < width; ++x) {
      ASSERT_EQ(expected[static_cast<std::size_t>(x) + 1], table[levels[static_cast<std::size_t>(x) + 1]]);
    }
    test::on_each_target([&] {
      std::vector<std::uint8_t> got = levels;
      map_row(table, width, got.data() + 1);
      EXPECT_EQ(got, expected) << width;
    });
  }
}

}  // namespace
}  // namespace stereotrack
