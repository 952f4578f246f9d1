// The black box of two cameras, one of which is unplugged meanwhile: its replay gives what the run had sent, to the
// byte.
#include <gtest/gtest.h>

#include <cstring>
#include <fstream>
#include <map>
#include <sstream>

#include "drivers/record/recording_source.hpp"
#include "drivers/telemetry/receiver.hpp"
#include "tests/support/camera_scene.hpp"
#include "tests/support/live_rig.hpp"
#include "tests/support/run_program.hpp"
#include "tests/support/temp_dir.hpp"

namespace stereotrack::test {
namespace {

using std::chrono::milliseconds;
using trigger::Side;

class CamerasRecording : public testing::TestWithParam<std::size_t> {};

TEST_P(CamerasRecording, OfALiveRunReplaysToTheByteMonoFramesIncluded) {
  const TempDir folder;
  const std::string recordings = folder.path().string();
  CameraScene scene(kSceneFormats[GetParam()], milliseconds(25));
  // All of the run is recorded, however long a slow machine takes from the unplugging to the end.
  LiveRig rig(scene.open(20),
              {"latency.output_ms=50", "record.on=true", "record.seconds=30", "record.seconds_after=0.2",
               "record.on_deadline=false", "record.directory=" + recordings});
  int stage = 0;
  const auto begun = std::chrono::steady_clock::now();
  rig.run([&] {
    if (std::chrono::steady_clock::now() - begun > std::chrono::minutes(2)) return true;
    const std::size_t pairs = rig.ear.pairs().size();
    const capture::SourceFigures figures = rig.daemon->figures();
    if (stage == 0 && pairs > 150) {
      scene.unplug(Side::kRight);
      ++stage;
    } else if (stage == 1 && figures.mono_pairs > 20) {
      scene.plug_in(Side::kRight);
      ++stage;
    } else if (stage == 2 && !figures.cameras[1].silent && pairs > 230) {
      rig.daemon->black_box()->trigger(record::kDemand);
      ++stage;
    }
    return rig.daemon->black_box()->counters().recordings.load() > 0;
  });
  ASSERT_EQ(stage, 3);
  const std::string written = rig.daemon->black_box()->last_recording();
  record::RecordingSource recording(written);
  ASSERT_TRUE(recording.about().exact);
  EXPECT_EQ(recording.info().format, kSceneFormats[GetParam()].format);
  ASSERT_GT(recording.outputs().size(), 30U);
  std::size_t mono = 0;
  std::size_t both = 0;
  FramePair pair;
  while (recording.next(pair) == capture::Next::kPair) ++(pair.right.empty() ? mono : both);
  EXPECT_GT(mono, 5U);
  EXPECT_GT(both, 5U);

  const ProgramResult replay = run_program(
      {std::string(STEREOTRACK_BIN_DIR) + "/stereotrack", "replay", written, "--out", (folder / "out").string()});
  ASSERT_EQ(replay.exit_code, 0) << replay.err;
  std::ifstream in(folder / "out" / "telemetry.bin", std::ios::binary);
  const std::string file((std::istreambuf_iterator<char>(in)), {});
  std::map<std::uint64_t, std::vector<std::byte>> replayed;
  std::size_t targets = 0;
  for (std::size_t at = 0; at + 4 <= file.size();) {
    std::uint32_t size = 0;
    std::memcpy(&size, file.data() + at, 4);
    const auto* bytes = reinterpret_cast<const std::byte*>(file.data() + at + 4);
    const auto datagram = telemetry::decode({bytes, size});
    ASSERT_TRUE(datagram.has_value());
    auto& parts = replayed[datagram->header.sequence];
    parts.insert(parts.end(), bytes, bytes + size);
    targets += datagram->targets.size();
    at += 4 + size;
  }
  EXPECT_GT(targets, 10U);
  EXPECT_EQ(replayed.size(), recording.outputs().size());
  for (const auto& [sequence, bytes] : replayed) {
    const auto live = rig.ear.messages().find(sequence);
    ASSERT_NE(live, rig.ear.messages().end()) << sequence;
    EXPECT_TRUE(live->second == bytes) << "message " << sequence;
  }
}

INSTANTIATE_TEST_SUITE_P(Formats, CamerasRecording, testing::Values(1, 2, 4),
                         [](const auto& one) { return std::string(kSceneFormats[one.param].name); });

}  // namespace
}  // namespace stereotrack::test
