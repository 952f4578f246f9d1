#include "firmware-app/evaluation/mot_file.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sstream>
#include <stdexcept>
#include <string>

namespace stereotrack::evaluation {
namespace {

std::vector<MotRow> read(const std::string& text) {
  std::istringstream in(text);
  return read_mot(in, "t.csv");
}

std::string error_of(const std::string& text) {
  try {
    static_cast<void>(read(text));
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  return "no error";
}

TEST(MotFile, TenColumnsGiveBoxConfidenceAndPosition) {
  const auto rows = read("3,7,1.5,-2,30,40.25,0.5,0.1,-0.2,4e1\n");
  ASSERT_EQ(rows.size(), 1U);
  EXPECT_EQ(rows[0].frame, 3);
  EXPECT_EQ(rows[0].id, 7);
  EXPECT_EQ(rows[0].box.left, 1.5);
  EXPECT_EQ(rows[0].box.top, -2);
  EXPECT_EQ(rows[0].box.width, 30);
  EXPECT_EQ(rows[0].box.height, 40.25);
  EXPECT_EQ(rows[0].confidence, 0.5);
  EXPECT_TRUE(rows[0].has_position);
  EXPECT_EQ(rows[0].position, Eigen::Vector3d(0.1, -0.2, 40));
}

TEST(MotFile, SevenToNineColumnsHaveNoPosition) {
  const auto rows = read("1,1,0,0,1,1,1\n1,2,0,0,1,1,1,5\n1,3,0,0,1,1,1,5,6\n");
  ASSERT_EQ(rows.size(), 3U);
  for (const MotRow& row : rows) EXPECT_FALSE(row.has_position);
}

TEST(MotFile, OnlyThreeTimesMinusOneMeansUnknownPosition) {
  const auto rows = read("1,1,0,0,1,1,1,-1,-1,-1\n1,2,0,0,1,1,1,-1,-1,2\n");
  EXPECT_FALSE(rows[0].has_position);
  EXPECT_TRUE(rows[1].has_position);
}

TEST(MotFile, HeaderBlankLinesSpacesCrLfAndWholeNumbersWithPointAreAccepted) {
  const auto rows = read("frame,id,left,top,width,height,confidence,x,y,z\r\n\r\n 2.0 , 4.0, 1,2,3,4,1\r\n\n");
  ASSERT_EQ(rows.size(), 1U);
  EXPECT_EQ(rows[0].frame, 2);
  EXPECT_EQ(rows[0].id, 4);
}

TEST(MotFile, EmptyFileHasNoRows) { EXPECT_TRUE(read("").empty()); }

TEST(MotFile, LastLineNeedsNoLineFeed) { EXPECT_EQ(read("1,1,0,0,1,1,1\n2,1,0,0,1,1,1").size(), 2U); }

TEST(MotFile, ErrorsNameFileLineAndWhatIsWrong) {
  using testing::StartsWith;
  EXPECT_THAT(error_of("1,1,0,0,1,1,1\n1,2,0,0,1,1\n"), StartsWith("t.csv:2: 6 columns, but 7 to 10 are needed"));
  EXPECT_THAT(error_of("1,1,0,0,1,1,1,2,3,4,5\n"), StartsWith("t.csv:1: 11 columns"));
  EXPECT_THAT(error_of("1,1,0,abc,1,1,1\n"), StartsWith("t.csv:1: top (column 4) is 'abc', not a finite number"));
  EXPECT_THAT(error_of("1,1,0,,1,1,1\n"), StartsWith("t.csv:1: top (column 4) is ''"));
  EXPECT_THAT(error_of("1,1,0,2px,1,1,1\n"), StartsWith("t.csv:1: top (column 4) is '2px'"));
  EXPECT_THAT(error_of("1,1,nan,0,1,1,1\n"), StartsWith("t.csv:1: left (column 3) is 'nan', not a finite number"));
  EXPECT_THAT(error_of("1,1,0,0,1,1,1,0,0,inf\n"), StartsWith("t.csv:1: z (column 10) is 'inf'"));
  EXPECT_THAT(error_of("1,1,0,0,1e999,1,1\n"), StartsWith("t.csv:1: width (column 5) is '1e999'"));
  EXPECT_THAT(error_of("0,1,0,0,1,1,1\n"), StartsWith("t.csv:1: frame is 0"));
  EXPECT_THAT(error_of("1.5,1,0,0,1,1,1\n"), StartsWith("t.csv:1: frame is 1.5"));
  EXPECT_THAT(error_of("1e30,1,0,0,1,1,1\n"), StartsWith("t.csv:1: frame is 1e30"));
  EXPECT_THAT(error_of("1,-1,0,0,1,1,1\n"), StartsWith("t.csv:1: id is -1"));
  EXPECT_THAT(error_of("1,1,0,0,5,-3,1\n"), StartsWith("t.csv:1: the box's size is 5 x -3"));
  EXPECT_THAT(error_of("1,4,0,0,1,1,1\n2,4,0,0,1,1,1\n\n1,4,9,9,1,1,1\n"),
              StartsWith("t.csv:4: frame 1 holds id 4 already (line 1)"));
}

TEST(MotFile, ErrorIsOneLine) { EXPECT_THAT(error_of("1,1,0,abc,1,1,1\n"), testing::Not(testing::HasSubstr("\n"))); }

TEST(MotFile, MissingFileAndFolderAreNamed) {
  EXPECT_THAT([] { static_cast<void>(read_mot(std::filesystem::path("no/such.csv"))); },
              testing::ThrowsMessage<std::runtime_error>(testing::StartsWith("no/such.csv: cannot be opened")));
  EXPECT_THAT([] { static_cast<void>(read_mot(std::filesystem::path(testing::TempDir()))); },
              testing::ThrowsMessage<std::runtime_error>(testing::HasSubstr("is a folder")));
}

TEST(BoxOverlap, WorkedByHand) {
  const Box box{10, 10, 100, 40};
  EXPECT_EQ(overlap(box, box), 1.0);
  EXPECT_EQ(overlap(box, {35, 10, 100, 40}), 0.6);        // 75 of 125 columns
  EXPECT_EQ(overlap(box, {110, 10, 100, 40}), 0.0);       // side by side
  EXPECT_EQ(overlap(box, {10, 10, 50, 20}), 0.25);        // inside
  EXPECT_EQ(overlap(box, {20, 20, 0, 5}), 0.0);           // no area
  EXPECT_EQ(overlap({1, 1, 0, 0}, {1, 1, 0, 0}), 0.0);    // both without
  EXPECT_EQ(overlap({0, 0, 0.5, 1}, {0, 0, 1, 1}), 0.5);  // fractions of a pixel
}

}  // namespace
}  // namespace stereotrack::evaluation
