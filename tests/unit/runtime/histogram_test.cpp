#include "firmware-app/runtime/histogram.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <random>
#include <vector>

namespace stereotrack::runtime {
namespace {

TEST(Histogram, EmptyOneIsZero) {
  const auto h = std::make_unique<Histogram>();
  EXPECT_EQ(h->count(), 0U);
  EXPECT_EQ(h->percentile_ns(0.5), 0U);
  EXPECT_EQ(h->max_ns(), 0U);
  EXPECT_EQ(h->sum_ns(), 0U);
}

TEST(Histogram, SmallValuesAreExact) {
  const auto h = std::make_unique<Histogram>();
  for (const std::int64_t v : {3, 5, 5, 9, 31}) h->record(v);
  EXPECT_EQ(h->count(), 5U);
  EXPECT_EQ(h->sum_ns(), 53U);
  EXPECT_EQ(h->percentile_ns(0.2), 3U);
  EXPECT_EQ(h->percentile_ns(0.21), 5U);
  EXPECT_EQ(h->percentile_ns(0.6), 5U);
  EXPECT_EQ(h->percentile_ns(0.8), 9U);
  EXPECT_EQ(h->percentile_ns(1.0), 31U);
}

TEST(Histogram, NegativeCountsAsZeroAndTheLongestKeepsItsMaximum) {
  const auto h = std::make_unique<Histogram>();
  h->record(-5);
  h->record(INT64_MAX);
  EXPECT_EQ(h->count(), 2U);
  EXPECT_EQ(h->percentile_ns(0.5), 0U);
  EXPECT_EQ(h->max_ns(), static_cast<std::uint64_t>(INT64_MAX));
}

// Against the sorted values themselves, over seven decades.
TEST(Histogram, PercentilesAreNeverUnderAndAtMostASixteenthOverTheTruth) {
  const auto h = std::make_unique<Histogram>();
  std::mt19937_64 random(5);
  std::uniform_real_distribution<double> decades(0.0, 10.0);
  std::vector<std::uint64_t> values;
  for (int i = 0; i < 20000; ++i) {
    values.push_back(static_cast<std::uint64_t>(std::pow(10.0, decades(random))));
    h->record(static_cast<std::int64_t>(values.back()));
  }
  std::sort(values.begin(), values.end());
  for (const double part : {0.001, 0.01, 0.1, 0.25, 0.5, 0.75, 0.9, 0.99, 0.999, 1.0}) {
    const auto rank = static_cast<std::size_t>(std::ceil(part * static_cast<double>(values.size())));
    const auto truth = static_cast<double>(values[rank - 1]);
    const auto told = static_cast<double>(h->percentile_ns(part));
    EXPECT_GE(told, truth) << part;
    EXPECT_LE(told, truth * (1 + 1.0 / 16)) << part;
  }
  EXPECT_EQ(h->max_ns(), values.back());
}

// Each value at the edge of a bucket is told as itself or the end of its bucket.
TEST(Histogram, EdgesOfBuckets) {
  for (unsigned bit = 4; bit < 40; ++bit) {
    for (const std::int64_t v : {(std::int64_t{1} << bit) - 1, std::int64_t{1} << bit, (std::int64_t{1} << bit) + 1}) {
      const auto h = std::make_unique<Histogram>();
      h->record(v);
      h->record(std::int64_t{1} << 41);  // so that the maximum does not cap it
      const auto told = static_cast<double>(h->percentile_ns(0.5));
      EXPECT_GE(told, static_cast<double>(v));
      EXPECT_LE(told, static_cast<double>(v) * (1 + 1.0 / 16)) << v;
    }
  }
}

}  // namespace
}  // namespace stereotrack::runtime
