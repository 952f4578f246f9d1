#include "pipeline/motion/distance_kernel.hpp"

#include <gtest/gtest.h>

#include <random>
#include <vector>

#include "tests/support/each_target.hpp"

namespace stereotrack {
namespace {

using test::kRowLengths;
using test::on_each_target;

template <class T>
std::vector<T> random_row(std::size_t size, int low, int high, unsigned seed) {
  std::mt19937 engine(seed);
  std::uniform_int_distribution<int> draw(low, high);
  std::vector<T> row(size);
  for (T& value : row) value = static_cast<T>(draw(engine));
  return row;
}

/// One more than the row, so that a write past its end is seen.
template <class T>
std::vector<T> room_for(int width) {
  return std::vector<T>(static_cast<std::size_t>(width) + 1, T{77});
}

TEST(DistanceKernel, LitRowIsTheReferenceForEveryMeanAndGain) {
  std::vector<std::uint16_t> means(65536);
  for (std::size_t i = 0; i < means.size(); ++i) means[i] = static_cast<std::uint16_t>(i);
  std::vector<std::uint8_t> expected(means.size());
  std::vector<std::uint8_t> got(means.size());
  for (const int gain : {0, 1, 64, 200, 255, 256, 257, 300, 511, 777, 1023}) {
    lit_row_reference(means.data(), gain, 65536, expected.data());
    on_each_target([&] {
      lit_row(means.data(), gain, 65536, got.data());
      EXPECT_EQ(got, expected) << gain;
    });
  }
}

TEST(DistanceKernel, LitRowAndRangeRowAreTheReferenceAtEveryLength) {
  for (const int width : kRowLengths) {
    const auto mean = random_row<std::uint16_t>(300, 0, 65280, 1);
    const auto pixels = random_row<std::uint8_t>(900, 0, 255, 2);
    const ThreeRows rows{pixels.data() + 1, pixels.data() + 300, pixels.data() + 607};
    auto lit = room_for<std::uint8_t>(width);
    auto range = lit;
    lit_row_reference(mean.data() + 1, 300, width, lit.data());
    range_row_reference(rows, width, range.data());
    on_each_target([&] {
      auto got = room_for<std::uint8_t>(width);
      lit_row(mean.data() + 1, 300, width, got.data());
      EXPECT_EQ(got, lit) << width;
      got = room_for<std::uint8_t>(width);
      range_row(rows, width, got.data());
      EXPECT_EQ(got, range) << width;
    });
  }
}

/// All rows of a distance that a test varies.
struct Rows {
  std::vector<std::uint8_t> now[3];
  std::vector<std::uint16_t> mean[3];
  std::vector<std::uint16_t> deviation[3];
  std::vector<std::uint8_t> range;
  mutable std::vector<std::uint8_t> shown[3];  ///< of the last distance

  Rows(std::size_t size, int most_deviation, int apart, unsigned seed)
      : range(random_row<std::uint8_t>(size, 0, 255, seed)) {
    for (unsigned c = 0; c < 3; ++c) {
      now[c] = random_row<std::uint8_t>(size, 0, 255, seed + c + 1);
      mean[c] = random_row<std::uint16_t>(size, -apart, apart, seed + c + 4);
      for (std::size_t i = 0; i < size; ++i) {
        mean[c][i] =
            static_cast<std::uint16_t>(std::clamp(now[c][i] * 256 + static_cast<std::int16_t>(mean[c][i]), 0, 65535));
      }
      deviation[c] = random_row<std::uint16_t>(size, 0, most_deviation, seed + c + 7);
      shown[c].assign(size + 1, 77);
    }
  }

  [[nodiscard]] DistanceRow view(bool colour, std::size_t from = 0) const {
    const auto row = [&](int c) {
      return ChannelRow{now[c].data() + from, mean[c].data() + from, deviation[c].data() + from,
                        shown[c].data() + from};
    };
    return {row(0), colour ? row(1) : ChannelRow{}, colour ? row(2) : ChannelRow{}, range.data() + from};
  }
};

TEST(DistanceKernel, DistanceRowIsTheReferenceAtEveryLength) {
  const Rows rows(300, 2000, 4000, 5);
  for (const bool colour : {false, true}) {
    for (const int width : kRowLengths) {
      DistanceRow in = rows.view(colour, 1);
      in.gain = 250;
      in.noise_floor = 256;
      in.edge_percent = 75;
      auto expected = room_for<std::uint8_t>(width);
      for (std::vector<std::uint8_t>& row : rows.shown) row.assign(row.size(), 77);
      distance_row_reference(in, width, expected.data());
      const std::vector<std::uint8_t> shown[] = {rows.shown[0], rows.shown[1], rows.shown[2]};
      on_each_target([&] {
        for (std::vector<std::uint8_t>& row : rows.shown) row.assign(row.size(), 77);
        auto got = room_for<std::uint8_t>(width);
        distance_row(in, width, got.data());
        EXPECT_EQ(got, expected) << width;
        for (std::size_t c = 0; c < 3; ++c) EXPECT_EQ(rows.shown[c], shown[c]) << width << " channel " << c;
      });
    }
  }
}

// Every tolerance there is: all ranges with all edge settings, a distance that lies just at, above and below it.
TEST(DistanceKernel, EveryToleranceIsTheReference) {
  for (int percent = 0; percent <= 200; ++percent) {
    Rows rows(256 * 3, 0, 0, 1);
    for (std::size_t i = 0; i < rows.range.size(); ++i) {
      const int range = static_cast<int>(i / 3);
      rows.range[i] = static_cast<std::uint8_t>(range);
      rows.now[0][i] = 255;
      const int tolerance = range * percent * 256 / 100;
      rows.mean[0][i] = static_cast<std::uint16_t>(std::clamp(65280 - tolerance - static_cast<int>(i % 3), 0, 65535));
    }
    DistanceRow in = rows.view(false);
    in.noise_floor = 1;
    in.edge_percent = percent;
    std::vector<std::uint8_t> expected(rows.range.size());
    std::vector<std::uint8_t> got(expected.size());
    distance_row_reference(in, static_cast<int>(expected.size()), expected.data());
    on_each_target([&] {
      distance_row(in, static_cast<int>(got.size()), got.data());
      EXPECT_EQ(got, expected) << percent;
    });
  }
}

// The quotient changes only where 4 apart is a multiple of the noise: with every noise there is, on both sides of every
// multiple up to the saturation.
TEST(DistanceKernel, EveryDivisorIsExactAroundItsMultiples) {
  const std::uint8_t range = 0;
  for (int floor : {1, 256, 4096}) {
    std::vector<std::uint8_t> now;
    std::vector<std::uint16_t> mean;
    std::vector<std::uint16_t> deviation;
    for (int d = 0; d <= 65535; d += d < 4096 ? 1 : 13) {
      const int noise = d * 5 / 4 + floor;
      for (int k = 1; k <= 256; k += k < 8 ? 1 : 31) {
        for (int apart = k * noise / 4 - 1; apart <= k * noise / 4 + 1; ++apart) {
          if (apart < 0 || apart > 65280) continue;
          now.push_back(255);
          mean.push_back(static_cast<std::uint16_t>(65280 - apart));
          deviation.push_back(static_cast<std::uint16_t>(d));
        }
      }
    }
    const std::vector<std::uint8_t> ranges(now.size(), range);
    const std::vector<std::uint8_t> black(now.size(), 0);
    const std::vector<std::uint16_t> dark(now.size(), 0);
    const int width = static_cast<int>(now.size());
    ASSERT_GT(width, 40000);
    std::vector<std::uint8_t> expected(now.size());
    std::vector<std::uint8_t> got(now.size());
    std::vector<std::uint8_t> shown(now.size());
    const ChannelRow sought{now.data(), mean.data(), deviation.data(), shown.data()};
    // Other channels' divisors take part in the division: the same, and others up to the largest.
    std::vector<std::uint16_t> other(deviation.rbegin(), deviation.rend());
    const ChannelRow same{black.data(), dark.data(), deviation.data(), shown.data()};
    const ChannelRow apart{black.data(), dark.data(), other.data(), shown.data()};
    for (const DistanceRow& rows : {DistanceRow{sought, {}, {}, ranges.data(), 256, floor, 75},
                                    DistanceRow{sought, same, same, ranges.data(), 256, floor, 75},
                                    DistanceRow{sought, apart, same, ranges.data(), 256, floor, 75},
                                    DistanceRow{same, sought, same, ranges.data(), 256, floor, 75},
                                    DistanceRow{same, sought, apart, ranges.data(), 256, floor, 75},
                                    DistanceRow{apart, same, sought, ranges.data(), 256, floor, 75},
                                    DistanceRow{same, same, sought, ranges.data(), 256, floor, 75}}) {
      distance_row_reference(rows, width, expected.data());
      on_each_target([&] {
        distance_row(rows, width, got.data());
        EXPECT_EQ(got, expected) << floor;
      });
    }
  }
}

TEST(DistanceKernel, EveryMeanIsShownRounded) {
  Rows rows(65536, 1000, 100, 6);
  for (std::size_t i = 0; i < 65536; ++i) {
    rows.mean[1][i] = static_cast<std::uint16_t>(i);
    rows.mean[2][i] = static_cast<std::uint16_t>(65535 - i);
  }
  std::vector<std::uint8_t> out(65536);
  on_each_target([&] {
    distance_row(rows.view(true), 65536, out.data());
    for (std::size_t i = 0; i < 65536; ++i) {
      const int rounded = std::min((static_cast<int>(i) + 128) / 256, 255);
      ASSERT_EQ(rows.shown[1][i], rounded) << i;
      ASSERT_EQ(rows.shown[2][65535 - i], rounded) << i;
    }
  });
}

TEST(DistanceKernel, ExtremeGainsAndDistancesAreTheReference) {
  for (const int gain : {0, 1, 64, 255, 1023}) {
    const Rows rows(4099, 65535, 65535 / 2, static_cast<unsigned>(gain));
    DistanceRow in = rows.view(true);
    in.gain = gain;
    in.noise_floor = 1;
    in.edge_percent = 200;
    std::vector<std::uint8_t> expected(4099);
    std::vector<std::uint8_t> got(4099);
    distance_row_reference(in, 4099, expected.data());
    on_each_target([&] {
      distance_row(in, 4099, got.data());
      EXPECT_EQ(got, expected) << gain;
    });
  }
}

// Each row holds every mean, each picture value once.
TEST(DistanceKernel, GainBinsAreTheReferenceForEveryPixelAndMean) {
  constexpr int kCount = 65536;
  std::vector<std::uint16_t> mean(kGainStep * kCount);
  for (std::size_t i = 0; i < mean.size(); ++i) mean[i] = static_cast<std::uint16_t>(i / kGainStep);
  const std::vector<std::uint8_t> still(mean.size(), 0);
  std::vector<std::uint16_t> expected(kCount);
  std::vector<std::uint16_t> got(kCount);
  for (int value = 0; value < 256; ++value) {
    const std::vector<std::uint8_t> now(mean.size(), static_cast<std::uint8_t>(value));
    gain_bins_reference(now.data(), mean.data(), still.data(), kCount, expected.data());
    on_each_target([&] {
      gain_bins(now.data(), mean.data(), still.data(), kCount, got.data());
      EXPECT_TRUE(got == expected) << value;
    });
  }
}

TEST(DistanceKernel, GainBinsAreTheReferenceAtEveryCountAndLeaveOutForeground) {
  const auto now = random_row<std::uint8_t>(700, 0, 255, 1);
  const auto mean = random_row<std::uint16_t>(700, 0, 65280, 2);
  const auto moving = random_row<std::uint8_t>(700, 0, 1, 3);
  for (const int count : kRowLengths) {
    auto expected = room_for<std::uint16_t>(count);
    gain_bins_reference(now.data() + 1, mean.data() + 1, moving.data() + 1, count, expected.data());
    on_each_target([&] {
      auto got = room_for<std::uint16_t>(count);
      gain_bins(now.data() + 1, mean.data() + 1, moving.data() + 1, count, got.data());
      EXPECT_EQ(got, expected) << count;
    });
  }
}

TEST(DistanceKernel, CountUpToIsTheReferenceAtEveryCountAndLimit) {
  const auto values = random_row<std::uint16_t>(300, 0, 1024, 9);
  for (const int count : kRowLengths) {
    for (const int limit : {0, 1, 500, 1023, 1024, 65535}) {
      const int expected = count_up_to_reference(values.data() + 1, count, limit);
      on_each_target(
          [&] { EXPECT_EQ(count_up_to(values.data() + 1, count, limit), expected) << count << " " << limit; });
    }
  }
}

TEST(DistanceKernel, CountUpToDoesNotOverflow) {
  const std::vector<std::uint16_t> values(65536 * 64 + 70000, 65535);
  const int count = static_cast<int>(values.size());
  on_each_target([&] {
    EXPECT_EQ(count_up_to(values.data(), count, 65535), count);
    EXPECT_EQ(count_up_to(values.data(), count, 65534), 0);
  });
}

}  // namespace
}  // namespace stereotrack
