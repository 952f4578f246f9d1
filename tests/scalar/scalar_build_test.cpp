// A build without vectors gives what the build that ships gives with each of its instruction sets.
#include <gtest/gtest.h>

#include <algorithm>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "pipeline/core/simd.hpp"
#include "tests/support/run_program.hpp"
#include "tests/support/scene_cases.hpp"

namespace stereotrack::test {
namespace {

std::vector<std::string> lines_of(const std::string& program, const std::string& argument) {
  const ProgramResult result = run_program({STEREOTRACK_TEST_PROGRAMS "/" + program, argument});
  EXPECT_EQ(result.exit_code, 0) << result.err;
  std::vector<std::string> lines;
  std::istringstream text(result.out);
  for (std::string line; std::getline(text, line);) lines.push_back(line);
  return lines;
}

TEST(ScalarBuild, HasNoInstructionSetButThePlainOne) {
  EXPECT_EQ(lines_of("pipeline_hash_scalar", "targets"), std::vector<std::string>{"scalar"});
  EXPECT_GE(lines_of("pipeline_hash", "targets").size(), 2U) << "this machine has but the plain references";
}

TEST(ScalarBuild, GivesTheSameResultsAsEachInstructionSet) {
  const std::vector<std::string> plain = lines_of("pipeline_hash_scalar", "scalar");
  ASSERT_EQ(plain.size(), scene_cases().size());
  EXPECT_EQ(std::set(plain.begin(), plain.end()).size(), plain.size()) << "two ways to run that do not differ";
  for (const std::string& line : plain) EXPECT_EQ(line.find(" of 0 reports"), std::string::npos) << line;
  for (const std::string& target : lines_of("pipeline_hash", "targets")) {
    EXPECT_EQ(lines_of("pipeline_hash", target), plain) << target;
  }
}

}  // namespace
}  // namespace stereotrack::test
