#include <gtest/gtest.h>

#include "pipeline/core/rect.hpp"

namespace stereotrack {
namespace {

TEST(Rect, TheCommonPartOfTwo) {
  EXPECT_EQ(intersect({0, 0, 10, 10}, {5, 6, 10, 10}), (Rect{5, 6, 5, 4}));
  EXPECT_EQ(intersect({0, 0, 10, 10}, {2, 3, 4, 5}), (Rect{2, 3, 4, 5}));
}

TEST(Rect, NeighboursHaveNothingInCommon) {
  EXPECT_EQ(intersect({0, 0, 10, 10}, {10, 0, 5, 5}), Rect{});
  EXPECT_EQ(intersect({0, 0, 10, 10}, {0, 10, 5, 5}), Rect{});
  EXPECT_TRUE(intersect({-8, -8, 3, 3}, {4, 4, 3, 3}).empty());
}

TEST(Rect, UnionHoldsBothAndSkipsTheEmptyOne) {
  EXPECT_EQ(unite({0, 0, 2, 2}, {5, -3, 1, 1}), (Rect{0, -3, 6, 5}));
  EXPECT_EQ(unite({}, {5, 6, 7, 8}), (Rect{5, 6, 7, 8}));
  EXPECT_EQ(unite({5, 6, 7, 8}, {100, 100, 0, 4}), (Rect{5, 6, 7, 8}));
}

TEST(Rect, AreaDoesNotOverflow) {
  EXPECT_EQ((Rect{0, 0, 100000, 100000}.area()), 10000000000LL);
  EXPECT_EQ((Rect{0, 0, -3, 5}.area()), 0);
}

TEST(Rect, OverlapIsIntersectionOverUnion) {
  EXPECT_DOUBLE_EQ(overlap({0, 0, 4, 4}, {0, 0, 4, 4}), 1.0);
  EXPECT_DOUBLE_EQ(overlap({0, 0, 4, 4}, {2, 0, 4, 4}), 8.0 / 24.0);
  EXPECT_DOUBLE_EQ(overlap({0, 0, 4, 4}, {4, 0, 4, 4}), 0.0);
  EXPECT_DOUBLE_EQ(overlap({}, {}), 0.0);
}

TEST(Rect, GrownKeepsItsMiddle) {
  EXPECT_EQ(grown({10, 20, 3, 4}, 5), (Rect{5, 15, 13, 14}));
  EXPECT_EQ(grown({10, 20, 3, 4}, 0), (Rect{10, 20, 3, 4}));
}

}  // namespace
}  // namespace stereotrack
