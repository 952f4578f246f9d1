#include "pipeline/track/assignment.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <vector>

namespace stereotrack {
namespace {

struct Problem {
  int rows = 0;
  int columns = 0;
  double alone = 0;
  std::vector<double> cost;
};

std::vector<int> solved(Assignment& assignment, const Problem& problem) {
  std::vector<int> columns(static_cast<std::size_t>(problem.rows), -7);
  assignment.solve(problem.cost, problem.rows, problem.columns, problem.alone, columns);
  return columns;
}

/// Cost of a solution; fails the test where a column is used twice or a forbidden pair is formed.
double total(const Problem& problem, const std::vector<int>& column_of_row) {
  double sum = 0;
  std::vector<int> used(static_cast<std::size_t>(problem.columns), 0);
  for (int row = 0; row < problem.rows; ++row) {
    const int column = column_of_row[static_cast<std::size_t>(row)];
    if (column == Assignment::kNone) {
      sum += problem.alone;
      continue;
    }
    EXPECT_GE(column, 0);
    EXPECT_LT(column, problem.columns);
    if (column < 0 || column >= problem.columns) return -1;
    EXPECT_EQ(used[static_cast<std::size_t>(column)]++, 0) << "column " << column << " twice";
    sum += problem.cost[static_cast<std::size_t>(row * problem.columns + column)];
  }
  EXPECT_LT(sum, Assignment::kForbidden) << "a forbidden pair";
  return sum;
}

double least(const Problem& problem, int row, std::uint32_t used) {
  if (row == problem.rows) return 0;
  double best = problem.alone + least(problem, row + 1, used);
  for (int column = 0; column < problem.columns; ++column) {
    const double cost = problem.cost[static_cast<std::size_t>(row * problem.columns + column)];
    if ((used >> column & 1U) != 0 || !(cost < Assignment::kForbidden)) continue;
    best = std::min(best, cost + least(problem, row + 1, used | 1U << column));
  }
  return best;
}

class AssignmentOf64 : public testing::Test {
 protected:
  void SetUp() override {
    auto created = Assignment::create(64, 64, arena_);
    ASSERT_TRUE(created.has_value());
    assignment_ = *created;
  }
  Assignment assignment_;

 private:
  Arena arena_;
};

TEST_F(AssignmentOf64, SumOfAllPairsCountsNotTheBestPair) {
  // Greedy takes (0, 0) and pays 1 + 9; the other pairing costs 2 + 3.
  EXPECT_EQ(solved(assignment_, {2, 2, 100, {1, 2, 3, 9}}), (std::vector<int>{1, 0}));
}

TEST_F(AssignmentOf64, RowStaysAloneWhereThatIsCheaper) {
  EXPECT_EQ(solved(assignment_, {2, 2, 5, {1, 20, 30, 6}}), (std::vector<int>{0, Assignment::kNone}));
  EXPECT_EQ(solved(assignment_, {2, 2, 7, {1, 20, 30, 6}}), (std::vector<int>{0, 1}));
}

TEST_F(AssignmentOf64, ForbiddenPairIsNotFormedAtAnyPrice) {
  const double no = Assignment::kForbidden;
  EXPECT_EQ(solved(assignment_, {2, 2, 1e6, {no, no, 3, no}}), (std::vector<int>{Assignment::kNone, 0}));
  EXPECT_EQ(solved(assignment_, {1, 1, 1e6, {no}}), (std::vector<int>{Assignment::kNone}));
}

TEST_F(AssignmentOf64, RandomProblemsUpToSixBySixAreSolvedAsByBruteForce) {
  std::mt19937 random(1);
  for (int trial = 0; trial < 3000; ++trial) {
    Problem problem;
    problem.rows = static_cast<int>(random() % 7);
    problem.columns = static_cast<int>(random() % 7);
    problem.alone = static_cast<double>(random() % 60);
    for (int i = 0; i < problem.rows * problem.columns; ++i) {
      // Whole numbers: sums are exact, and ties are frequent.
      const bool forbidden = random() % 4 == 0;
      problem.cost.push_back(forbidden ? Assignment::kForbidden : static_cast<double>(random() % 40));
    }
    ASSERT_EQ(total(problem, solved(assignment_, problem)), least(problem, 0, 0)) << trial;
  }
}

TEST_F(AssignmentOf64, NoRowsOrNoColumns) {
  EXPECT_TRUE(solved(assignment_, {0, 0, 1, {}}).empty());
  EXPECT_TRUE(solved(assignment_, {0, 3, 1, {}}).empty());
  EXPECT_EQ(solved(assignment_, {2, 0, 1, {}}), (std::vector<int>{Assignment::kNone, Assignment::kNone}));
}

TEST_F(AssignmentOf64, OneByOne) {
  EXPECT_EQ(solved(assignment_, {1, 1, 5, {4}}), (std::vector<int>{0}));
  EXPECT_EQ(solved(assignment_, {1, 1, 5, {6}}), (std::vector<int>{Assignment::kNone}));
}

TEST_F(AssignmentOf64, FullCapacityFindsAHiddenPermutation) {
  std::mt19937 random(2);
  std::vector<int> hidden(64);
  for (int i = 0; i < 64; ++i) hidden[static_cast<std::size_t>(i)] = (i * 37 + 11) % 64;
  Problem problem{64, 64, 1000, {}};
  for (int row = 0; row < 64; ++row) {
    for (int column = 0; column < 64; ++column) {
      const double noise = static_cast<double>(random() % 1000) / 1000;
      problem.cost.push_back(column == hidden[static_cast<std::size_t>(row)] ? noise : 2 + 100 * noise);
    }
  }
  EXPECT_EQ(solved(assignment_, problem), hidden);
  EXPECT_EQ(solved(assignment_, problem), hidden) << "a second time";
}

TEST(Assignment, Faults) {
  Arena arena;
  EXPECT_EQ(Assignment::create(0, 4, arena).error(), Fault::kBadConfig);
  EXPECT_EQ(Assignment::create(4, 0, arena).error(), Fault::kBadConfig);
  arena.seal();
  EXPECT_EQ(Assignment::create(4, 4, arena).error(), Fault::kOutOfMemory);
}

}  // namespace
}  // namespace stereotrack
