// The same input gives the same bytes, and the future does not change the past.
#include <map>
#include <set>
#include <span>

#include "drivers/telemetry/receiver.hpp"
#include "pipeline/core/simd.hpp"
#include "tests/replay/command_support.hpp"

namespace stereotrack::test {
namespace {

void replay(const std::string& source, const fs::path& out, const std::vector<std::string>& more) {
  std::vector<std::string> arguments{"replay", source, "--out", out.string()};
  arguments.insert(arguments.end(), more.begin(), more.end());
  const ProgramResult result = stereotrack_command(arguments);
  ASSERT_EQ(result.exit_code, 0) << result.err;
}

void expect_same_results(const fs::path& a, const fs::path& b) {
  EXPECT_GT(fs::file_size(a / "tracks.csv"), 0U);
  EXPECT_EQ(read_text(a / "tracks.csv"), read_text(b / "tracks.csv"));
  EXPECT_TRUE(read_text(a / "telemetry.bin") == read_text(b / "telemetry.bin"));
  nlohmann::ordered_json first = summary_of(a);
  nlohmann::ordered_json second = summary_of(b);
  EXPECT_EQ(first.erase("stages_ms"), 1U);
  EXPECT_EQ(second.erase("stages_ms"), 1U);
  EXPECT_EQ(first.dump(2), second.dump(2));
}

/// The first frame in whose telemetry each track is confirmed.
std::map<std::uint32_t, std::uint64_t> confirmed_at(const fs::path& telemetry) {
  const std::string bytes = read_text(telemetry);
  telemetry::Receiver receiver;
  std::map<std::uint32_t, std::uint64_t> first;
  std::size_t at = 0;
  while (at + 4 <= bytes.size()) {
    std::size_t size = 0;
    for (std::size_t i = 0; i < 4; ++i) size |= std::size_t{static_cast<unsigned char>(bytes[at + i])} << (8 * i);
    at += 4;
    if (at + size > bytes.size()) break;
    const telemetry::Outcome outcome = receiver.accept(std::as_bytes(std::span(bytes).subspan(at, size)));
    at += size;
    if (outcome != telemetry::Outcome::kPair) continue;
    for (const telemetry::Target& target : receiver.pair().targets) {
      if (target.state == telemetry::TargetState::kTentative) continue;
      first.try_emplace(target.id, receiver.pair().header.ordinal);
    }
  }
  EXPECT_EQ(at, bytes.size()) << telemetry;
  EXPECT_EQ(receiver.counters().refused_total(), 0U);
  return first;
}

class Determinism : public testing::TestWithParam<const char*> {
 protected:
  void SetUp() override {
    const ProgramResult result =
        stereotrack_command({"synth", "eleven", "--out", sequence_.string(), "--frames", "120", "--size", "320x240"});
    ASSERT_EQ(result.exit_code, 0) << result.err;
  }

  TempDir folder_;
  fs::path sequence_ = folder_ / "sequence";
  std::vector<std::string> preset_{"--set", std::string("preset=") + GetParam()};
};

TEST_P(Determinism, SameFolderTwiceGivesTheSameBytes) {
  for (const char* name : {"whole", "again"}) replay(sequence_.string(), folder_ / name, preset_);
  expect_same_results(folder_ / "whole", folder_ / "again");
}

TEST_P(Determinism, ShorterRunGivesTheRowsOfTheWholeOneUpToItsEnd) {
  replay(sequence_.string(), folder_ / "whole", preset_);
  const std::vector<CsvRow> whole = rows_of(folder_ / "whole/tracks.csv");
  const std::map<std::uint32_t, std::uint64_t> confirmed = confirmed_at(folder_ / "whole/telemetry.bin");
  const std::string datagrams = read_text(folder_ / "whole/telemetry.bin");
  ASSERT_GE(confirmed.size(), 3U);
  std::size_t compared = 0;
  for (const std::uint64_t end : {1U, 47U, 78U, 103U}) {
    const fs::path out = folder_ / ("to-" + std::to_string(end));
    std::vector<std::string> arguments = preset_;
    arguments.insert(arguments.end(), {"--frames", "1:" + std::to_string(end)});
    replay(sequence_.string(), out, arguments);
    EXPECT_EQ(summary_of(out)["frames"], end);
    std::string expected;
    for (const CsvRow& row : whole) {
      const auto at = confirmed.find(row.id);
      ASSERT_NE(at, confirmed.end()) << row.text;
      if (row.frame > end || at->second > end) continue;
      expected += row.text + '\n';
      ++compared;
    }
    EXPECT_EQ(read_text(out / "tracks.csv"), expected) << end;
    EXPECT_TRUE(datagrams.starts_with(read_text(out / "telemetry.bin"))) << end;
  }
  EXPECT_GT(compared, 20U);
}

TEST_P(Determinism, PicturesAreTheSame) {
  for (const char* name : {"first", "second"}) {
    std::vector<std::string> arguments = preset_;
    arguments.insert(arguments.end(), {"--frames", "60:84", "--render", (folder_ / name).string()});
    replay(sequence_.string(), folder_ / "out", arguments);
  }
  const std::vector<std::string> names = names_in(folder_ / "first");
  ASSERT_EQ(names.size(), 25U);
  EXPECT_GT(fs::file_size(folder_ / "out/tracks.csv"), 0U) << "nothing to draw";
  EXPECT_EQ(names, names_in(folder_ / "second"));
  std::set<std::string> different;
  for (const std::string& name : names) {
    const std::string picture = read_text(folder_ / "first" / name);
    EXPECT_TRUE(picture == read_text(folder_ / "second" / name)) << name;
    different.insert(picture);
  }
  EXPECT_EQ(different.size(), names.size());
}

INSTANTIATE_TEST_SUITE_P(Presets, Determinism, testing::Values("robust", "thesis"),
                         [](const auto& instance) { return std::string(instance.param); });

struct Variant {
  const char* preset;
  Paint paint;
  const char* mode;  ///< of disparity
};

class InstructionSets : public testing::TestWithParam<Variant> {};

TEST_P(InstructionSets, EachGivesTheSameBytes) {
#if !defined(__arm__)  // has plain kernels alone
  ASSERT_GE(simd_targets().size(), 2U) << "this machine has but the plain references";
#endif
  const TempDir folder;
  const fs::path sequence = folder / "sequence";
  const ProgramResult result =
      stereotrack_command({"synth", "eleven", "--out", sequence.string(), "--frames", "60", "--size", "320x240"});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  if (GetParam().paint == Paint::kGrey) {
    for (const char* view : {"left", "right"}) {
      for (const std::string& name : names_in(sequence / view)) {
        const std::string file = (sequence / view / name).string();
        ASSERT_TRUE(cv::imwrite(file, cv::imread(file, cv::IMREAD_GRAYSCALE)));
      }
    }
  }
  const std::vector<std::string> arguments{"--set", std::string("preset=") + GetParam().preset, "--set",
                                           std::string("disparity.mode=") + GetParam().mode};
  replay(sequence.string(), folder / "best", arguments);
  EXPECT_EQ(summary_of(folder / "best")["colour"], GetParam().paint == Paint::kColour);
  for (const SimdTarget target : simd_targets()) {
    SCOPED_TRACE(to_string(target));
    std::vector<std::string> with_target = arguments;
    with_target.insert(with_target.end(), {"--simd", to_string(target)});
    replay(sequence.string(), folder / to_string(target), with_target);
    expect_same_results(folder / "best", folder / to_string(target));
  }
}

INSTANTIATE_TEST_SUITE_P(
    Variants, InstructionSets,
    testing::Values(Variant{"robust", Paint::kColour, "regions"}, Variant{"robust", Paint::kColour, "dense"},
                    Variant{"robust", Paint::kGrey, "regions"}, Variant{"robust", Paint::kGrey, "dense"},
                    Variant{"thesis", Paint::kColour, "regions"}, Variant{"thesis", Paint::kColour, "dense"},
                    Variant{"thesis", Paint::kGrey, "regions"}, Variant{"thesis", Paint::kGrey, "dense"}),
    [](const auto& instance) {
      return std::string(instance.param.preset) + (instance.param.paint == Paint::kGrey ? "_grey_" : "_colour_") +
             instance.param.mode;
    });

class SyntheticDeterminism : public testing::TestWithParam<const char*> {};

TEST_P(SyntheticDeterminism, SameSceneTwiceGivesTheSameBytes) {
  const TempDir folder;
  std::vector<std::string> arguments;
  for (const std::string& entry : {std::string("preset=") + GetParam(), std::string("synthetic.frames=60"),
                                   std::string("synthetic.width=320"), std::string("synthetic.height=240")}) {
    arguments.insert(arguments.end(), {"--set", entry});
  }
  replay("synthetic:eleven", folder / "first", arguments);
  replay("synthetic:eleven", folder / "second", arguments);
  expect_same_results(folder / "first", folder / "second");
}

// The scene has missing pictures and pairs one frame off, which are not scored.
TEST(SyntheticTruth, OfAReplayIsThatOfTheFilesAndChangesNothing) {
  const TempDir folder;
  const ProgramResult result = stereotrack_command(
      {"synth", "dropout", "--out", (folder / "files").string(), "--frames", "240", "--size", "160x120"});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const std::vector<std::string> small{"--set", "synthetic.frames=240", "--set", "synthetic.width=160",
                                       "--set", "synthetic.height=120"};
  std::vector<std::string> with_truth = small;
  with_truth.insert(with_truth.end(), {"--truth", (folder / "gt.csv").string()});
  replay("synthetic:dropout", folder / "with", with_truth);
  replay("synthetic:dropout", folder / "without", small);
  EXPECT_GT(fs::file_size(folder / "gt.csv"), 0U);
  EXPECT_EQ(read_text(folder / "gt.csv"), read_text(folder / "files" / "gt.csv"));
  expect_same_results(folder / "with", folder / "without");
}

INSTANTIATE_TEST_SUITE_P(Presets, SyntheticDeterminism, testing::Values("robust", "thesis"),
                         [](const auto& instance) { return std::string(instance.param); });

}  // namespace
}  // namespace stereotrack::test
