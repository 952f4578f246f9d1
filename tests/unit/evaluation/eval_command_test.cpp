#include "firmware-app/stereotrack/eval.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <sstream>
#include <stdexcept>

namespace stereotrack {
namespace {

using testing::HasSubstr;

class EvalCommand : public testing::Test {
 protected:
  std::filesystem::path write(const std::string& name, const std::string& text) {
    const std::filesystem::path folder =
        std::filesystem::path(testing::TempDir()) / testing::UnitTest::GetInstance()->current_test_info()->name();
    std::filesystem::create_directories(folder);
    std::ofstream(folder / name) << text;
    return folder / name;
  }
  std::string run(const EvalArguments& arguments) {
    std::ostringstream out;
    EXPECT_EQ(run_eval(arguments, out), 0);
    return out.str();
  }

  // Two objects in two frames, the second lost; 3-D error 1 at z = 10.
  std::string truth_ = "1,1,0,0,10,10,1,0,0,10\n2,1,0,0,10,10,1,0,0,10\n1,2,50,0,10,10,1,5,0,10\n";
  std::string tracks_ = "1,4,0,0,10,10,0.9,0,0,11\n2,4,0,0,10,10,0.9,0,0,11\n";
};

TEST_F(EvalCommand, TableHasEveryScoreUnderItsHeading) {
  EXPECT_EQ(run({write("gt.csv", truth_), write("tracks.csv", tracks_), false}),
            R"(data         frames  objects    boxes  ignored   tracks    boxes  dropped
                  2        2        3        0        1        2        0
HOTA           HOTA     DetA     AssA     LocA    DetRe    DetPr    AssRe    AssPr
             81.6 %   66.7 %  100.0 %  100.0 %   66.7 %  100.0 %  100.0 %  100.0 %
CLEAR          MOTA     MOTP   recall  precision       FP       FN     IDSW     Frag
             66.7 %  100.0 %   66.7 %    100.0 %        0        1        0        0
identity       IDF1      IDP      IDR       MT       PT       ML
             80.0 %  100.0 %   66.7 %        1        0        1
3-D error    median     95 %  median/z   95 %/z    pairs  no x y z  /(1/4 px)
             1.0000   1.0000    10.0 %   10.0 %        2         0          -
velocity     median     95 %    pairs
                  -        -        0
false        tracks  a minute
                  0      0.00
)");
}

TEST_F(EvalCommand, JsonIsOneObjectWithRatesAsFractions) {
  const std::string json = run({write("gt.csv", truth_), write("tracks.csv", tracks_), true});
  EXPECT_THAT(json, testing::StartsWith("{\n  \"frames\": 2,\n"));
  EXPECT_THAT(json, testing::EndsWith("\n}\n"));
  EXPECT_THAT(json, HasSubstr("\"mota\": 0.6666666666666666,\n"));
  EXPECT_THAT(json, HasSubstr("\"idf1\": 0.8,\n"));
  EXPECT_THAT(json, HasSubstr("\"false_negatives\": 1,\n"));
  EXPECT_THAT(json, HasSubstr("\"position_median\": 1,\n"));
  EXPECT_THAT(json, HasSubstr("\"position_relative_p95\": 0.1,\n"));
  EXPECT_THAT(json, HasSubstr("\"position_geometry_median\": null,\n"));
  EXPECT_THAT(json, HasSubstr("\"velocity_median\": null,\n"));
  EXPECT_THAT(json, HasSubstr("\"false_tracks_a_minute\": 0\n"));
}

// z^2 / (f b) 0.25 = 100 / 50 / 4 = 0.5, and the error is 1. One false track within the tenth of a minute of 60 frames.
TEST_F(EvalCommand, GeometryAndTimeComeFromTheArguments) {
  EvalArguments arguments{write("gt.csv", truth_), write("tracks.csv", tracks_ + "2,9,200,0,10,10,0.9,-1,-1,-1\n"),
                          true};
  arguments.fps = 10;
  arguments.frames = 60;
  arguments.focal_baseline = 50;
  const std::string json = run(arguments);
  EXPECT_THAT(json, HasSubstr("\"position_geometry_median\": 2,\n"));
  EXPECT_THAT(json, HasSubstr("\"false_tracks\": 1,\n"));
  EXPECT_THAT(json, HasSubstr("\"false_tracks_a_minute\": 10\n"));
}

TEST_F(EvalCommand, EmptyTracksFileIsScored) {
  const EvalArguments arguments{write("gt.csv", truth_), write("tracks.csv", ""), true};
  const std::string json = run(arguments);
  EXPECT_THAT(json, HasSubstr("\"false_negatives\": 3,\n"));
  EXPECT_THAT(json, HasSubstr("\"motp\": null,\n"));
  EXPECT_THAT(json, HasSubstr("\"position_median\": null,\n"));
  EXPECT_THAT(run({arguments.truth, arguments.tracks, false}), HasSubstr("  -"));
}

TEST_F(EvalCommand, ErrorNamesTheFileAndTheLine) {
  const auto truth = write("gt.csv", truth_);
  const auto tracks = write("tracks.csv", "1,4,0,0,10,10,0.9\n1,4,0,0,10,10,0.9\n");
  std::ostringstream out;
  EXPECT_THAT(
      [&] {
        run_eval({truth, tracks, false}, out);
      },
      testing::ThrowsMessage<std::runtime_error>(HasSubstr(tracks.string() + ":2: frame 1 holds id 4")));
  EXPECT_EQ(out.str(), "");
}

TEST_F(EvalCommand, FullDiskIsAnError) {
  std::ofstream full("/dev/full");
  if (!full) GTEST_SKIP() << "no /dev/full on this system";
  EXPECT_THROW(run_eval({write("gt.csv", truth_), write("tracks.csv", tracks_), false}, full), std::runtime_error);
}

}  // namespace
}  // namespace stereotrack
