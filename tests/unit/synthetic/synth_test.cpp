#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

#include <csignal>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <set>
#include <sstream>
#include <string>

#include "config/calibration/read_calibration.hpp"
#include "config/error.hpp"
#include "firmware-app/stereotrack/synth.hpp"

namespace stereotrack {
namespace {

namespace fs = std::filesystem;

class Synth : public testing::Test {
 protected:
  void SetUp() override {
    std::string name = (fs::temp_directory_path() / "stereotrack_synth_XXXXXX").string();
    ASSERT_NE(mkdtemp(name.data()), nullptr);
    folder_ = name;
    arguments_.scene = "eleven";
    arguments_.out = folder_ / "out";
    arguments_.size = "96x72";
    arguments_.frames = 3;
  }
  void TearDown() override { fs::remove_all(folder_); }

  /// What is thrown, or "".
  template <class Error>
  std::string refusal() {
    std::ostringstream messages;
    try {
      (void)run_synth(arguments_, messages);
    } catch (const Error& e) {
      return e.what();
    }
    return "";
  }
  static std::string content(const fs::path& path) {
    std::ifstream file(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(file), {}};
  }

  fs::path folder_;
  SynthArguments arguments_;
};

TEST_F(Synth, WritesPicturesTruthAndCalibration) {
  std::ostringstream messages;
  EXPECT_EQ(run_synth(arguments_, messages), 0);
  for (const char* n : {"000001.png", "000002.png", "000003.png"}) {
    const cv::Mat left = cv::imread((arguments_.out / "left" / n).string(), cv::IMREAD_UNCHANGED);
    EXPECT_EQ(left.type(), CV_8UC3);
    EXPECT_EQ(left.size(), cv::Size(96, 72));
    EXPECT_EQ(cv::imread((arguments_.out / "right" / n).string(), cv::IMREAD_UNCHANGED).type(), CV_8UC3);
    EXPECT_EQ(cv::imread((arguments_.out / "masks" / n).string(), cv::IMREAD_UNCHANGED).type(), CV_8UC1);
    EXPECT_EQ(cv::imread((arguments_.out / "disparity" / n).string(), cv::IMREAD_UNCHANGED).type(), CV_16UC1);
  }
  EXPECT_FALSE(fs::exists(arguments_.out / "left" / "000004.png"));

  const auto read = calibration::read_calibration_file((arguments_.out / "calibration.yml").string());
  EXPECT_EQ(read.stereo.left.width, 96);
  EXPECT_EQ(read.stereo.left.fx, 90.0);
  EXPECT_EQ(read.stereo.t_right_left.x(), -0.25);

  // frame,id,left,top,width,height,confidence,x,y,z; the robot is there from the first frame on.
  EXPECT_THAT(content(arguments_.out / "gt.csv"),
              testing::ContainsRegex(
                  "^1,1,[0-9]+,[0-9]+,[0-9]+,[0-9]+,[01],-?[0-9]+\\.[0-9]{5},-?[0-9]+\\.[0-9]{5},[0-9]+\\.[0-9]{5}\n"));
}

TEST_F(Synth, WhatHasNeverMovedIsUnknownInTheMaskAndNotScored) {
  arguments_.scene = "synthetic:occupied";
  arguments_.frames = 1;
  std::ostringstream messages;
  EXPECT_EQ(run_synth(arguments_, messages), 0);
  const cv::Mat mask = cv::imread((arguments_.out / "masks" / "000001.png").string(), cv::IMREAD_UNCHANGED);
  ASSERT_EQ(mask.type(), CV_8UC1);
  EXPECT_GT(cv::countNonZero(mask == 170), 100);
  EXPECT_EQ(cv::countNonZero(mask == 255), 0);
  EXPECT_EQ(cv::countNonZero((mask != 0) & (mask != 50) & (mask != 170)), 0);
  // frame,id,left,top,width,height,confidence,...
  std::istringstream rows(content(arguments_.out / "gt.csv"));
  int count = 0;
  for (std::string row; std::getline(rows, row); ++count) {
    EXPECT_THAT(row, testing::MatchesRegex("1,[1-6],[0-9]+,[0-9]+,[0-9]+,[0-9]+,0,.*"));
  }
  EXPECT_EQ(count, 6);
}

// In the first 100 frames after the 40th there is a fault of each kind.
TEST_F(Synth, PicturesThatMayBeMissingAreNamedByTheirTimeAndPairsAreTold) {
  arguments_.frames = 3;  // an earlier run of another scene, whose pictures a replay must not find
  std::ostringstream messages;
  EXPECT_EQ(run_synth(arguments_, messages), 0);
  arguments_.scene = "dropout";
  arguments_.frames = 140;
  EXPECT_EQ(run_synth(arguments_, messages), 0);
  const auto names = [&](const char* side) {
    std::set<std::string> found;
    for (const auto& entry : fs::directory_iterator(arguments_.out / side)) {
      found.insert(entry.path().filename().string());
      EXPECT_THAT(entry.path().filename().string(), testing::MatchesRegex("[0-9]{10}_[0-9]{9}\\.png"));
    }
    return found;
  };
  const std::set<std::string> left = names("left");
  const std::set<std::string> right = names("right");
  EXPECT_EQ(left.count("1700000000_000000000.png"), 1U);
  EXPECT_EQ(left.count("1700000000_033333333.png"), 1U);

  std::istringstream pairs(content(arguments_.out / "pairs.csv"));
  std::string row;
  ASSERT_TRUE(std::getline(pairs, row));
  EXPECT_EQ(row, "frame,left,right,right_off,skew_ns");
  std::set<int> unscored;
  std::size_t lefts = 0;
  std::size_t rights = 0;
  int frames = 0;
  int wrong = 0;
  while (std::getline(pairs, row)) {
    int frame = 0, has_left = 0, has_right = 0, off = 0;
    long long skew = 0;
    ASSERT_EQ(std::sscanf(row.c_str(), "%d,%d,%d,%d,%lld", &frame, &has_left, &has_right, &off, &skew), 5) << row;
    EXPECT_EQ(frame, ++frames);
    lefts += static_cast<std::size_t>(has_left);
    rights += static_cast<std::size_t>(has_right);
    wrong += off != 0 ? 1 : 0;
    if (off != 0 || has_left == 0 || has_right == 0) unscored.insert(frame);
    EXPECT_TRUE(fs::exists(
        arguments_.out / "masks" /
        (std::string(frame < 100 ? "0000" : "000") + (frame < 10 ? "0" : "") + std::to_string(frame) + ".png")));
  }
  EXPECT_LT(frames, 140);  // both pictures were missing
  EXPECT_EQ(left.size(), lefts);
  EXPECT_EQ(right.size(), rights);
  EXPECT_LT(lefts, static_cast<std::size_t>(frames));
  EXPECT_LT(rights, static_cast<std::size_t>(frames));
  EXPECT_GE(wrong, 2);
  std::istringstream truth(content(arguments_.out / "gt.csv"));
  int scored = 0;
  while (std::getline(truth, row)) {
    int frame = 0, confidence = 0;
    ASSERT_EQ(std::sscanf(row.c_str(), "%d,%*d,%*d,%*d,%*d,%*d,%d,", &frame, &confidence), 2) << row;
    scored += confidence;
    if (unscored.count(frame) != 0) {
      EXPECT_EQ(confidence, 0) << row;
    }
  }
  EXPECT_GT(scored, 50);
}

TEST_F(Synth, SameArgumentsGiveTheSameBytes) {
  std::ostringstream messages;
  EXPECT_EQ(run_synth(arguments_, messages), 0);
  const std::string truth = content(arguments_.out / "gt.csv");
  const std::string left = content(arguments_.out / "left" / "000003.png");
  arguments_.out = folder_ / "again";
  EXPECT_EQ(run_synth(arguments_, messages), 0);
  EXPECT_EQ(content(arguments_.out / "gt.csv"), truth);
  EXPECT_EQ(content(arguments_.out / "left" / "000003.png"), left);
  arguments_.seed = 2;
  EXPECT_EQ(run_synth(arguments_, messages), 0);
  EXPECT_NE(content(arguments_.out / "left" / "000003.png"), left);
}

TEST_F(Synth, ShorterRunLeavesNothingOfALongerOne) {
  std::ostringstream messages;
  EXPECT_EQ(run_synth(arguments_, messages), 0);
  arguments_.frames = 1;
  EXPECT_EQ(run_synth(arguments_, messages), 0);
  for (const char* sub : {"left", "right", "masks", "disparity"}) {
    EXPECT_TRUE(fs::exists(arguments_.out / sub / "000001.png"));
    EXPECT_FALSE(fs::exists(arguments_.out / sub / "000002.png"));
    EXPECT_FALSE(fs::exists(arguments_.out / sub / "000003.png"));
  }
}

TEST_F(Synth, WrongWordsAreBadUsageAndTouchNothing) {
  arguments_.scene = "twelve";
  EXPECT_THAT(refusal<config::Error>(), testing::HasSubstr("eleven"));
  arguments_.scene = "synthetic:eleven";
  for (const char* size : {"96", "96x", "x72", "96x72x3", "axb", "10x10", "5000x72", "-96x72"}) {
    arguments_.size = size;
    EXPECT_NE(refusal<config::Error>(), "") << size;
  }
  arguments_.size = "96x72";
  arguments_.frames = 0;
  EXPECT_THAT(refusal<config::Error>(), testing::HasSubstr("100000"));
  EXPECT_FALSE(fs::exists(arguments_.out));
}

TEST_F(Synth, FileInTheWayIsNamed) {
  std::ofstream(arguments_.out) << "mine";
  EXPECT_THAT(refusal<std::runtime_error>(), testing::HasSubstr(arguments_.out.string()));
  EXPECT_EQ(content(arguments_.out), "mine");
}

TEST_F(Synth, UnwritableFolderIsNamed) {
  if (geteuid() == 0) GTEST_SKIP() << "root may write everywhere";
  fs::create_directory(arguments_.out);
  fs::permissions(arguments_.out, fs::perms::owner_read | fs::perms::owner_exec);
  EXPECT_THAT(refusal<std::runtime_error>(), testing::HasSubstr(arguments_.out.string()));
  fs::permissions(arguments_.out, fs::perms::owner_all);
}

// A limit on the size of files stands for a full disk.
TEST_F(Synth, PictureThatDoesNotFitIsRemovedAndNamed) {
  rlimit before{};
  ASSERT_EQ(getrlimit(RLIMIT_FSIZE, &before), 0);
  rlimit tight = before;
  tight.rlim_cur = 4096;
  const auto handler = std::signal(SIGXFSZ, SIG_IGN);
  ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &tight), 0);
  const std::string what = refusal<std::runtime_error>();
  ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &before), 0);
  (void)std::signal(SIGXFSZ, handler);
  EXPECT_THAT(what, testing::HasSubstr("left/000001.png: cannot be written"));
  EXPECT_FALSE(fs::exists(arguments_.out / "left" / "000001.png"));
  EXPECT_FALSE(fs::exists(arguments_.out / "gt.csv"));
  EXPECT_FALSE(fs::exists(arguments_.out / "calibration.yml"));
}

}  // namespace
}  // namespace stereotrack
