#include "firmware-app/evaluation/assignment.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <random>
#include <set>

namespace stereotrack::evaluation {
namespace {

double total(const Eigen::MatrixXd& score, const std::vector<int>& column) {
  double sum = 0;
  for (std::size_t row = 0; row < column.size(); ++row) {
    if (column[row] != kUnassigned) sum += score(static_cast<Eigen::Index>(row), column[row]);
  }
  return sum;
}

/// Every row (or every column) has a partner, nobody has two.
void expect_complete(const Eigen::MatrixXd& score, const std::vector<int>& column) {
  ASSERT_EQ(column.size(), static_cast<std::size_t>(score.rows()));
  std::set<int> used;
  for (const int c : column) {
    if (c == kUnassigned) continue;
    EXPECT_GE(c, 0);
    EXPECT_LT(c, score.cols());
    EXPECT_TRUE(used.insert(c).second) << "column " << c << " twice";
  }
  EXPECT_EQ(used.size(), static_cast<std::size_t>(std::min(score.rows(), score.cols())));
}

double brute_force(const Eigen::MatrixXd& score) {
  if (score.rows() > score.cols()) return brute_force(score.transpose());
  std::vector<int> order(static_cast<std::size_t>(score.cols()));
  std::iota(order.begin(), order.end(), 0);
  double best = -1e300;
  do {
    double sum = 0;
    for (Eigen::Index row = 0; row < score.rows(); ++row) sum += score(row, order[row]);
    best = std::max(best, sum);
  } while (std::next_permutation(order.begin(), order.end()));
  return best;
}

TEST(Assignment, GreedyChoiceIsGivenUpForTheBetterSum) {
  Eigen::MatrixXd score(2, 2);
  score << 9, 8,  //
      8, 1;
  EXPECT_EQ(assign_best(score), (std::vector<int>{1, 0}));
}

TEST(Assignment, EqualsBruteForceInEveryShapeUpToSeven) {
  std::mt19937 random(1);
  for (int rows = 1; rows <= 7; ++rows) {
    for (int columns = 1; columns <= 7; ++columns) {
      for (int repeat = 0; repeat < 5; ++repeat) {
        Eigen::MatrixXd score(rows, columns);
        // Small whole numbers give many ties; odd repeats have negative scores.
        for (double& value : score.reshaped()) {
          value = static_cast<double>(random() % (repeat < 3 ? 4 : 1000)) - (repeat % 2 == 1 ? 2 : 0);
        }
        const std::vector<int> column = assign_best(score);
        expect_complete(score, column);
        EXPECT_EQ(total(score, column), brute_force(score)) << score;
      }
    }
  }
}

TEST(Assignment, NoRowsOrNoColumnsAssignNothing) {
  EXPECT_TRUE(assign_best(Eigen::MatrixXd(0, 0)).empty());
  EXPECT_TRUE(assign_best(Eigen::MatrixXd(0, 3)).empty());
  EXPECT_EQ(assign_best(Eigen::MatrixXd(2, 0)), (std::vector<int>{kUnassigned, kUnassigned}));
}

TEST(Assignment, HiddenPermutationOfTwoHundredIsFound) {
  constexpr int kSize = 200;
  std::vector<int> hidden(kSize);
  std::iota(hidden.begin(), hidden.end(), 0);
  std::mt19937 random(2);
  std::shuffle(hidden.begin(), hidden.end(), random);
  Eigen::MatrixXd score(kSize, kSize);
  for (double& value : score.reshaped()) value = static_cast<double>(random() % 1000) / 1000;
  for (int row = 0; row < kSize; ++row) score(row, hidden[row]) = 2;
  EXPECT_EQ(assign_best(score), hidden);
}

}  // namespace
}  // namespace stereotrack::evaluation
