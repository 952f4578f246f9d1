// What a run did, with frames lost and messages late as they come in life, is what `stereotrack replay` of its
// recording does: tracks.csv and telemetry.bin, byte for byte.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "config/load.hpp"
#include "config/schema.hpp"
#include "drivers/capture/synthetic/synthetic_source.hpp"
#include "drivers/record/black_box.hpp"
#include "drivers/record/output_note.hpp"
#include "drivers/record/recording_source.hpp"
#include "drivers/telemetry/encoder.hpp"
#include "drivers/telemetry/file_sink.hpp"
#include "firmware-app/stereotrack/tracks_file.hpp"
#include "pipeline/pipeline.hpp"
#include "tests/replay/command_support.hpp"
#include "tests/support/temp_dir.hpp"

namespace stereotrack::test {
namespace {

struct Message {
  std::uint64_t ordinal = 0;
  std::vector<std::vector<std::byte>> datagrams;
};

/// A run of synthetic:eleven as the daemon's threads make it, one after the other: some pairs never reach the pipeline,
/// some results are late and leave no message, and clocks decide when the others leave.
class LiveRun {
 public:
  static constexpr std::uint64_t kSession = 0xFEDC'BA98'7654'3210U;
  static constexpr std::uint32_t kRig = 41;

  LiveRun(const std::vector<std::string>& set, const fs::path& folder, record::BlackBox::Config box) : folder_(folder) {
    std::vector<config::Layer> layers;
    for (const std::string& key : set) layers.push_back(config::override_layer(key));
    layers.push_back(config::override_layer("telemetry.rig_id=41"));
    loaded_ = config::load(layers);
    capture::SyntheticOptions options;
    options.width = 320;
    options.height = 240;
    options.frames = 120;
    source_ = capture::open_synthetic("eleven", options);
    calibration_ = source_->calibration();
    Pipeline::Setup setup;
    setup.width = options.width;
    setup.height = options.height;
    setup.colour = has_colour(source_->info().format);
    setup.calibration = &calibration_;
    const Result<Pipeline> made = Pipeline::create(loaded_.configuration.pipeline, setup, arena_);
    EXPECT_TRUE(made.has_value());
    pipeline_.emplace(*made);
    record::BlackBox::Run run;
    run.about.source = "synthetic:eleven";
    run.about.program = "test";
    run.about.width = options.width;
    run.about.height = options.height;
    run.about.format = source_->info().format;
    run.about.period_ns = source_->info().period.count();
    run.about.rig = kRig;
    run.about.session = kSession;
    run.about.unit_m = 1;
    run.calibration = calibration_;
    run.configuration = config::to_text(loaded_.configuration);
    box.directory = folder;
    box.max_bytes = 1U << 30U;
    box.spare_bytes = 0;
    box_ = std::make_unique<record::BlackBox>(box, run, *pipeline_);
  }

  void run(std::uint64_t trigger_at) {
    telemetry::Encoder encoder({.rig = kRig, .session = kSession, .sequence = 0});
    FramePair pair;
    while (source_->next(pair) == capture::Next::kPair) {
      if (pair.ordinal % 17 == 5) continue;  // evicted
      box_->arm(pair);
      const auto shed = static_cast<EffortBits>(pair.ordinal / 10 % 4);
      const Result<FrameResult> result = pipeline_->run(pair, shed);
      ASSERT_TRUE(result.has_value());
      box_->capture(pair, *result, {.shed = shed});
      if (pair.ordinal == trigger_at) box_->trigger(record::kDeadlineMiss);
      while (box_->keyframe_step(*pipeline_)) {
      }
      frames_.emplace_back(pair.ordinal, std::vector<TrackReport>(result->tracks.begin(), result->tracks.end()));
      if (pair.ordinal % 13 != 0) send(encoder, pair, *result);
    }
    for (int i = 0; i < 50; ++i) {
      while (box_->service_step()) {
      }
    }
    ASSERT_EQ(box_->counters().recordings, 1U) << box_->last_error();
  }

  [[nodiscard]] const std::string& recording() const { return box_->last_recording(); }

  /// tracks.csv and telemetry.bin of the run's frames [first, last].
  void save_part(std::uint64_t first, std::uint64_t last) const {
    TracksFile tracks;
    telemetry::FileSink sink(folder_ / "telemetry.bin");
    for (const auto& [ordinal, reports] : frames_) {
      if (ordinal >= first && ordinal <= last) tracks.add(ordinal, reports);
    }
    for (const Message& message : messages_) {
      if (message.ordinal < first || message.ordinal > last) continue;
      for (const std::vector<std::byte>& datagram : message.datagrams) sink.send(datagram);
    }
    tracks.save(folder_ / "tracks.csv");
    ASSERT_TRUE(sink.commit());
  }

 private:
  void send(telemetry::Encoder& encoder, const FramePair& pair, const FrameResult& result) {
    const auto late = std::chrono::nanoseconds(static_cast<std::int64_t>(pair.ordinal) * 1237);
    telemetry::Message message;
    message.tracks = result.tracks;
    message.ordinal = pair.ordinal;
    message.capture_time = pair.capture_time;
    message.send_time = pair.capture_time + std::chrono::milliseconds(40) + late;
    message.latency = std::chrono::milliseconds(40) + std::chrono::microseconds(pair.ordinal % 7);
    message.flags = pair.ordinal % 17 == 6 ? telemetry::kFramesSkippedBefore : 0U;
    message.frames_skipped = static_cast<std::uint32_t>((pair.ordinal + 12) / 17);
    message.unit_m = 1;
    message.focal_x_px = calibration_.left.fx;
    message.focal_y_px = calibration_.left.fy;
    Message kept{pair.ordinal, {}};
    for (const std::span<const std::byte> datagram : encoder.encode(message, buffer_)) {
      kept.datagrams.emplace_back(datagram.begin(), datagram.end());
    }
    messages_.push_back(std::move(kept));
    record::OutputNote note = record::note_of(message, encoder.sequence());
    note.state_ordinal = pair.ordinal;
    box_->note(note);
  }

  fs::path folder_;
  config::Loaded loaded_;
  std::unique_ptr<capture::SyntheticSource> source_;
  StereoCalibration calibration_;
  Arena arena_;
  std::optional<Pipeline> pipeline_;
  std::unique_ptr<record::BlackBox> box_;
  std::array<std::byte, telemetry::kMaxMessageBytes> buffer_{};
  std::vector<std::pair<std::uint64_t, std::vector<TrackReport>>> frames_;
  std::vector<Message> messages_;
};

class RecordingOf : public testing::TestWithParam<const char*> {};

TEST_P(RecordingOf, ARunReplaysItsTracksAndTelemetryByteForByte) {
  const TempDir folder;
  LiveRun live({std::string("preset=") + GetParam(), "latency.output_ms=40"}, folder.path(),
               {.seconds = 2, .seconds_after = 0.7});
  live.run(85);
  if (HasFatalFailure()) return;
  const ProgramResult replay = stereotrack_command({"replay", live.recording(), "--out", (folder / "out").string()});
  ASSERT_EQ(replay.exit_code, 0) << replay.err;
  EXPECT_EQ(replay.err.find("anew"), std::string::npos) << replay.err;
  record::RecordingSource source(live.recording());
  FramePair pair;
  ASSERT_EQ(source.next(pair), capture::Next::kPair);
  const std::uint64_t first = pair.ordinal;
  std::uint64_t last = first;
  while (source.next(pair) == capture::Next::kPair) last = pair.ordinal;
  EXPECT_LE(first, 55U) << "half of the seconds before the trigger";
  EXPECT_GT(first, 1U) << "a keyframe from amid the run";
  EXPECT_GE(last, 105U) << "and those after it";
  live.save_part(first, last);
  const std::string tracks = read_text(folder / "out" / "tracks.csv");
  EXPECT_GT(std::count(tracks.begin(), tracks.end(), '\n'), 40);
  EXPECT_EQ(tracks, read_text(folder / "tracks.csv"));
  EXPECT_TRUE(read_text(folder / "out" / "telemetry.bin") == read_text(folder / "telemetry.bin"));
  EXPECT_GT(fs::file_size(folder / "telemetry.bin"), 4000U);
}

TEST(CommandInfo, TellsWhatARecordingHoldsAndWhatIsDamaged) {
  const TempDir folder;
  LiveRun live({}, folder.path(), {.seconds = 2, .seconds_after = 0.7});
  live.run(85);
  record::RecordingSource source(live.recording());
  std::vector<std::uint64_t> ordinals;
  for (FramePair pair; source.next(pair) == capture::Next::kPair;) ordinals.push_back(pair.ordinal);
  ASSERT_GT(ordinals.size(), 40U);
  const std::string size = std::to_string(ordinals.size());
  const std::uint64_t missing = ordinals.back() - ordinals.front() + 1 - ordinals.size();
  EXPECT_GT(missing, 1U);
  ProgramResult info = stereotrack_command({"info", live.recording()});
  EXPECT_EQ(info.exit_code, 0) << info.err;
  EXPECT_EQ(info.err, "");
  for (const std::string& said :
       {std::string("by test, cause deadline"), std::string("rig 41, session "), std::string("source synthetic:eleven"),
        std::string("320x240 bgr8, stereo"), size + ", pairs " + std::to_string(ordinals.front()) + " to ",
        std::to_string(missing) + " missing between them, 0 damaged", std::string("level_set corners"),
        std::string("messages   ") + std::to_string(source.outputs().size()) + ", of which 0 predicted",
        std::string("gives the run's bytes")}) {
    EXPECT_THAT(info.out, testing::HasSubstr(said));
  }
  EXPECT_THAT(info.out, testing::ContainsRegex("targets    [1-9][0-9]*, at most [1-9]"));

  fs::resize_file(live.recording(), fs::file_size(live.recording()) / 2);
  info = stereotrack_command({"info", live.recording()});
  EXPECT_EQ(info.exit_code, 1);
  EXPECT_THAT(info.out, testing::HasSubstr("cut or damaged after byte"));

  for (const char* other : {"nowhere.strec", "pictures.png"}) {
    info = stereotrack_command({"info", other});
    EXPECT_EQ(info.exit_code, 1);
    EXPECT_EQ(info.out, "");
    EXPECT_TRUE(is_one_line(info.err)) << info.err;
    EXPECT_THAT(info.err, testing::HasSubstr(other));
  }
}

INSTANTIATE_TEST_SUITE_P(Presets, RecordingOf, testing::Values("robust", "thesis"));

TEST(CommandRecording, AReducedOneSaysThatTracksBeginAnew) {
  const TempDir folder;
  LiveRun live({}, folder.path(), {.seconds = 2, .seconds_after = 0.7, .reduce = 2});
  live.run(85);
  const ProgramResult replay = stereotrack_command({"replay", live.recording(), "--out", (folder / "out").string()});
  EXPECT_EQ(replay.exit_code, 0) << replay.err;
  EXPECT_NE(replay.err.find("tracks begin anew: it was reduced"), std::string::npos) << replay.err;
}

TEST(CommandRecording, AnotherConfigurationBeginsAnewAndACutFileSaysWhereItEnds) {
  const TempDir folder;
  LiveRun live({}, folder.path(), {.seconds = 2, .seconds_after = 0.7});
  live.run(85);
  ProgramResult replay = stereotrack_command({"replay", live.recording(), "--set", "background.method=edges"});
  EXPECT_EQ(replay.exit_code, 0) << replay.err;
  EXPECT_NE(replay.err.find("its keyframe is of another configuration"), std::string::npos) << replay.err;
  replay = stereotrack_command({"replay", live.recording(), "--frames", "70:"});
  EXPECT_EQ(replay.exit_code, 0) << replay.err;
  EXPECT_NE(replay.err.find("tracks begin anew: frames were left out"), std::string::npos) << replay.err;
  fs::resize_file(live.recording(), fs::file_size(live.recording()) / 2);
  replay = stereotrack_command({"replay", live.recording()});
  EXPECT_EQ(replay.exit_code, 0) << replay.err;
  EXPECT_NE(replay.err.find("cut or damaged after byte"), std::string::npos) << replay.err;
  fs::resize_file(live.recording(), 100);
  replay = stereotrack_command({"replay", live.recording()});
  EXPECT_EQ(replay.exit_code, 1);
  EXPECT_TRUE(is_one_line(replay.err)) << replay.err;
}

}  // namespace
}  // namespace stereotrack::test
