// summary.json says what a run was and did; among it that the frame loop took nothing from the heap.
#include "tests/replay/command_support.hpp"

namespace stereotrack::test {
namespace {

// A sanitizer's own malloc cannot be counted: the program then says null.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
const nlohmann::ordered_json kNoAllocation = nullptr;
#else
const nlohmann::ordered_json kNoAllocation = 0;
#endif

enum class Source { kColour, kGrey, kMono };

using SummaryCase = std::tuple<const char*, Source>;

class Summary : public testing::TestWithParam<SummaryCase> {
 protected:
  void SetUp() override {
    const auto [preset, source] = GetParam();
    SmallScene::write(folder_ / "scene", 45, source == Source::kGrey ? Paint::kGrey : Paint::kColour);
    const std::string scene = (folder_ / "scene").string();
    const ProgramResult result =
        stereotrack_command({"replay", source == Source::kMono ? "mono:" + scene + "/left" : scene, "--out",
                             out_.string(), "--set", std::string("preset=") + preset});
    ASSERT_EQ(result.exit_code, 0) << result.err;
  }

  TempDir folder_;
  fs::path out_ = folder_ / "out";
};

TEST_P(Summary, NoHeapCallAfterWarmUp) {
  const nlohmann::ordered_json summary = summary_of(out_);
  ASSERT_TRUE(summary.contains("allocations_after_warmup"));
  EXPECT_EQ(summary["allocations_after_warmup"], kNoAllocation);
  EXPECT_EQ(summary["frames"], 45);
  EXPECT_GE(summary["tracks"], 1) << "nothing moved: not every stage had work to do";
}

TEST_P(Summary, SaysWhatTheRunWasAndDid) {
  const nlohmann::ordered_json summary = summary_of(out_);
  const std::vector<CsvRow> rows = rows_of(out_ / "tracks.csv");
  EXPECT_EQ(summary["mono"], std::get<1>(GetParam()) == Source::kMono);
  EXPECT_EQ(summary["colour"], std::get<1>(GetParam()) != Source::kGrey);
  EXPECT_EQ(summary["rows"], rows.size());
  EXPECT_EQ(summary["deadline_misses"], 0);
  EXPECT_TRUE(summary.at("pair_skew_us").is_null()) << "numbered pictures have no times";
  EXPECT_EQ(summary["drops"]["unreadable"], 0);
  EXPECT_EQ(summary["drops"]["telemetry_failed"], 0);
  EXPECT_EQ(summary["skipped"], nlohmann::ordered_json::array());
  EXPECT_GE(summary["telemetry_datagrams"], 45);
  EXPECT_GT(summary["memory_bytes"], 0);
  for (const char* hash : {"pixels_blake2b", "telemetry_blake2b"}) {
    const std::string digits = summary[hash];
    EXPECT_EQ(digits.size(), 64U);
    EXPECT_EQ(digits.find_first_not_of("0123456789abcdef"), std::string::npos) << digits;
  }
  const std::string configuration = summary["configuration"];
  EXPECT_NE(configuration.find(std::string("preset = \"") + std::get<0>(GetParam()) + "\""), std::string::npos);
  ASSERT_GT(summary["stages_ms"].size(), 1U);
  ASSERT_TRUE(summary["stages_ms"].contains("whole"));
  for (const auto& [stage, times] : summary["stages_ms"].items()) {
    EXPECT_GE(times["p50"], 0.0) << stage;
    EXPECT_LE(times["p50"], times["p99"]) << stage;
    EXPECT_LE(times["p99"], times["max"]) << stage;
  }
  EXPECT_GT(summary["stages_ms"]["whole"]["p50"], 0.0);
}

std::string case_name(const testing::TestParamInfo<SummaryCase>& instance) {
  const auto [preset, source] = instance.param;
  return std::string(preset) + (source == Source::kColour ? "Colour" : (source == Source::kGrey ? "Grey" : "Mono"));
}

INSTANTIATE_TEST_SUITE_P(Sources, Summary,
                         testing::Combine(testing::Values("robust", "thesis"),
                                          testing::Values(Source::kColour, Source::kGrey, Source::kMono)),
                         case_name);

TEST(SummaryOfStamps, PairSkewIsTheDistanceOfTheStampsInMicroseconds) {
  const TempDir folder;
  const fs::path scene = folder / "scene";
  SmallScene::write(scene, 5);
  constexpr std::array<int, 5> kSkew_ns{-7000, 2500, 0, 1000, -3000};
  for (int i = 0; i < 5; ++i) {
    const int left_ns = 100'000'000 + 33'000'000 * i;
    for (const bool right : {false, true}) {
      const int stamp_ns = right ? left_ns + kSkew_ns.at(static_cast<std::size_t>(i)) : left_ns;
      const fs::path view = scene / (right ? "right" : "left");
      fs::rename(view / numbered(i + 1), view / ("1585434279_" + std::to_string(stamp_ns) + ".png"));
    }
  }
  const ProgramResult result = stereotrack_command({"replay", scene.string(), "--out", (folder / "out").string()});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const nlohmann::ordered_json skew = summary_of(folder / "out")["pair_skew_us"];
  EXPECT_EQ(skew, nlohmann::ordered_json({{"p50", 2.5}, {"p99", 7.0}, {"max", 7.0}}));
}

// Many objects, occlusions and more frames than the buffers of the stage times begin with.
TEST(SummaryOfEleven, NoHeapCallAfterWarmUp) {
  const TempDir folder;
  const ProgramResult result =
      stereotrack_command({"replay", "synthetic:eleven", "--out", (folder / "out").string(), "--set",
                           "synthetic.frames=1100", "--set", "synthetic.width=96", "--set", "synthetic.height=72"});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_EQ(summary_of(folder / "out")["allocations_after_warmup"], kNoAllocation);
}

// Eleven objects come one after the other: with room for one blob, the others are counted.
TEST(SummaryOfRejections, WhatFoundNoRoomIsCounted) {
  const TempDir folder;
  const auto without_room = [&](const char* most) {
    const ProgramResult result = stereotrack_command(
        {"replay", "synthetic:eleven", "--out", (folder / most).string(), "--set", "synthetic.frames=150", "--set",
         "synthetic.width=160", "--set", "synthetic.height=120", "--set", std::string("shape.max_blobs=") + most});
    EXPECT_EQ(result.exit_code, 0) << result.err;
    return summary_of(folder / most)["candidates_rejected"]["no_room"].get<int>();
  };
  EXPECT_EQ(without_room("128"), 0);
  EXPECT_GT(without_room("1"), 10);
}

}  // namespace
}  // namespace stereotrack::test
