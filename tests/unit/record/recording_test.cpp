#include <gtest/gtest.h>
#include <sys/resource.h>

#include <fstream>
#include <numeric>
#include <stdexcept>
#include <vector>

#include "drivers/record/calibration_text.hpp"
#include "drivers/record/recording_source.hpp"
#include "drivers/record/recording_writer.hpp"
#include "drivers/record/torn.hpp"
#include "tests/support/temp_dir.hpp"

namespace stereotrack::record {
namespace {

namespace fs = std::filesystem;
using test::TempDir;

constexpr int kWidth = 6;
constexpr int kHeight = 4;
constexpr std::size_t kPicture = std::size_t{kWidth} * kHeight * 2;

std::vector<std::byte> frame_payload(std::uint64_t ordinal) {
  std::vector<std::byte> payload(kFrameHead + 2 * kPicture);
  FrameMeta meta;
  meta.ordinal = ordinal;
  meta.capture_ns = static_cast<std::int64_t>(ordinal) * 1000;
  meta.has_skew = 1;
  meta.skew_ns = -5;
  meta.shed = 3;
  meta.tracks = 1;
  std::memcpy(payload.data(), &meta, sizeof meta);
  const TrackNote note{.id = 9, .state = 1, .box = {1, 2, 3, 4}, .position = {0.5F, 1, 2}};
  std::memcpy(payload.data() + sizeof meta, &note, sizeof note);
  for (std::size_t i = 0; i < 2 * kPicture; ++i) payload[kFrameHead + i] = static_cast<std::byte>(ordinal * 97 + i);
  return payload;
}

void write_text(RecordingWriter& writer, RecordKind kind, const std::string& text) {
  ASSERT_TRUE(writer.write(kind, std::as_bytes(std::span(text))));
}

// Frames 11..14, a keyframe of 100 bytes before them, the outputs of 12 and 13.
void write_recording(const fs::path& path) {
  RecordingWriter writer;
  ASSERT_TRUE(writer.open(path));
  About about;
  about.source = "cams";
  about.width = kWidth;
  about.height = kHeight;
  about.format = PixelFormat::kYuyv;
  about.period_ns = 1000;
  about.exact = true;
  write_text(writer, RecordKind::kAbout, to_text(about));
  StereoCalibration calibration;
  calibration.left.fx = 0.1;
  write_text(writer, RecordKind::kCalibration, to_text(calibration));
  write_text(writer, RecordKind::kConfiguration, "preset = \"thesis\"\n");
  ASSERT_TRUE(writer.write(RecordKind::kKeyframe, std::vector<std::byte>(sizeof(KeyframeMeta) + 100, std::byte{4})));
  for (std::uint64_t ordinal = 11; ordinal <= 14; ++ordinal) {
    ASSERT_TRUE(writer.write(RecordKind::kFrame, frame_payload(ordinal)));
    const OutputNote note{.ordinal = ordinal, .state_ordinal = ordinal, .sequence = ordinal + 100, .send_ns = 77};
    if (ordinal == 12 || ordinal == 13) writer.write(RecordKind::kOutput, std::as_bytes(std::span(&note, 1)));
  }
  ASSERT_TRUE(writer.commit()) << writer.status();
}

std::vector<char> bytes_of(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

void put(const fs::path& path, const std::vector<char>& bytes) {
  std::ofstream(path, std::ios::binary).write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
}

int frames_of(RecordingSource& source) {
  int frames = 0;
  for (FramePair pair; source.next(pair) == capture::Next::kPair;) ++frames;
  return frames;
}

TEST(Recording, ReadsBackAsItWasWritten) {
  const TempDir folder;
  write_recording(folder / "x.strec");
  RecordingSource source((folder / "x.strec").string());
  EXPECT_EQ(source.warning(), "");
  EXPECT_EQ(source.info().width, kWidth);
  EXPECT_EQ(source.info().format, PixelFormat::kYuyv);
  EXPECT_TRUE(source.info().stereo);
  EXPECT_EQ(source.configuration(), "preset = \"thesis\"\n");
  EXPECT_EQ(source.calibration()->left.fx, 0.1);
  EXPECT_EQ(source.keyframe().size(), 100U);
  ASSERT_FALSE(source.outputs().empty());
  EXPECT_EQ(source.outputs().front().sequence, 112U);
  FramePair pair;
  for (std::uint64_t ordinal = 11; ordinal <= 14; ++ordinal) {
    ASSERT_EQ(source.next(pair), capture::Next::kPair);
    EXPECT_EQ(pair.ordinal, ordinal);
    EXPECT_EQ(pair.capture_time.time_since_epoch().count(), static_cast<std::int64_t>(ordinal) * 1000);
    EXPECT_EQ(pair.skew->count(), -5);
    EXPECT_EQ(source.decisions().shed, 3);
    ASSERT_EQ(source.track_notes().size(), 1U);
    EXPECT_EQ(source.track_notes()[0].box[3], 4);
    const std::vector<std::byte> payload = frame_payload(ordinal);
    EXPECT_EQ(std::memcmp(pair.left.data, payload.data() + kFrameHead, kPicture), 0);
    EXPECT_EQ(std::memcmp(pair.right.data, payload.data() + kFrameHead + kPicture, kPicture), 0);
  }
  ASSERT_EQ(source.outputs().size(), 2U);
  EXPECT_EQ(source.outputs()[0].ordinal, 12U);
  EXPECT_EQ(source.outputs()[1].ordinal, 13U);
  EXPECT_EQ(source.next(pair), capture::Next::kEnd);
  EXPECT_TRUE(source.keyframe().empty()) << "frames were taken: the state is another now";
}

TEST(Recording, SkippingLeavesNoKeyframe) {
  const TempDir folder;
  write_recording(folder / "x.strec");
  RecordingSource source((folder / "x.strec").string());
  source.skip_to(12);
  EXPECT_TRUE(source.keyframe().empty());
  FramePair pair;
  ASSERT_EQ(source.next(pair), capture::Next::kPair);
  EXPECT_EQ(pair.ordinal, 13U);
}

// A power cut leaves any length.
TEST(Recording, CutAnywhereIsReadUpToTheCutWithOneLineOrRefusedWithOne) {
  const TempDir folder;
  write_recording(folder / "x.strec");
  const std::vector<char> whole = bytes_of(folder / "x.strec");
  const std::string path = (folder / "cut.strec").string();
  int last_frames = 0;
  int refused = 0;
  for (std::size_t size = 0; size < whole.size(); size += 29) {
    put(path, {whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(size)});
    try {
      RecordingSource source(path);
      EXPECT_NE(source.warning().find(path + ": cut or damaged after byte "), std::string::npos) << size;
      EXPECT_EQ(std::count(source.warning().begin(), source.warning().end(), '\n'), 0);
      const int frames = frames_of(source);
      EXPECT_GE(frames, last_frames) << size;
      last_frames = frames;
    } catch (const std::runtime_error& error) {
      EXPECT_EQ(std::string(error.what()).find(path + ": "), 0U) << error.what();
      EXPECT_EQ(last_frames, 0) << size;
      ++refused;
    }
  }
  EXPECT_EQ(last_frames, 4);
  EXPECT_GT(refused, 0);
}

TEST(Recording, NoFlippedByteGetsThroughUnnoticed) {
  const TempDir folder;
  write_recording(folder / "x.strec");
  std::vector<char> bytes = bytes_of(folder / "x.strec");
  const std::string path = (folder / "flipped.strec").string();
  // The reserved word of the file's header is nobody's.
  for (std::size_t at = 0; at < bytes.size(); at += (at > 1500 ? 97 : 1)) {
    if (at >= 12 && at < 16) continue;
    bytes[at] = static_cast<char>(bytes[at] ^ 0x10);
    put(path, bytes);
    try {
      RecordingSource source(path);
      const int frames = frames_of(source);
      EXPECT_TRUE(!source.warning().empty() || frames < 4) << "byte " << at;
    } catch (const std::runtime_error&) {
    }
    bytes[at] = static_cast<char>(bytes[at] ^ 0x10);
  }
}

TEST(Recording, ADamagedFrameIsSkippedWithALineAndTheNextIsRead) {
  const TempDir folder;
  write_recording(folder / "x.strec");
  std::vector<char> bytes = bytes_of(folder / "x.strec");
  const std::vector<std::byte> second = frame_payload(12);
  const auto* pixels = reinterpret_cast<const char*>(second.data() + kFrameHead);
  const auto at = std::search(bytes.begin(), bytes.end(), pixels, pixels + kPicture);
  ASSERT_NE(at, bytes.end());
  *at = static_cast<char>(*at ^ 1);
  const std::string path = (folder / "damaged.strec").string();
  put(path, bytes);
  RecordingSource source(path);
  FramePair pair;
  ASSERT_EQ(source.next(pair), capture::Next::kPair);
  ASSERT_EQ(source.next(pair), capture::Next::kSkipped);
  EXPECT_EQ(source.skip_reason(), path + ": frame 12 is damaged");
  EXPECT_EQ(source.next(pair), capture::Next::kPair);
}

TEST(Recording, WhatIsNoneIsRefusedWithOneLine) {
  const TempDir folder;
  EXPECT_THROW(RecordingSource((folder / "none.strec").string()), std::runtime_error);
  EXPECT_THROW(RecordingSource(folder.path().string()), std::runtime_error);
  EXPECT_THROW(RecordingSource(folder.write("a.strec", "").string()), std::runtime_error);
  EXPECT_THROW(RecordingSource(folder.write("b.strec", std::string(10000, 'x')).string()), std::runtime_error);
}

// Larger than 32 bits tell, by as much as a small recording has: there it must not be taken for that.
TEST(Recording, WhatIsTooLargeToBeAddressedIsRefusedWithOneLine) {
  const TempDir folder;
  const fs::path path = folder / "x.strec";
  write_recording(path);
  const std::uintmax_t whole = fs::file_size(path);
  fs::resize_file(path, (std::uintmax_t{1} << 32) + whole);
  try {
    RecordingSource source(path.string());
    EXPECT_GT(sizeof(std::size_t), 4U);
    EXPECT_EQ(frames_of(source), 4);
  } catch (const std::runtime_error& error) {
    EXPECT_EQ(sizeof(std::size_t), 4U);
    EXPECT_EQ(error.what(), path.string() + ": larger than a program can address here; replay it on a 64-bit machine");
  }
}

TEST(RecordingWriter, AFileIsThereOnlyWhenItIsWhole) {
  const TempDir folder;
  {
    RecordingWriter writer;
    ASSERT_TRUE(writer.open(folder / "x.strec"));
    ASSERT_TRUE(writer.write(RecordKind::kFrame, frame_payload(1)));
    EXPECT_TRUE(fs::exists(folder / "x.strec.part"));
  }
  EXPECT_TRUE(fs::is_empty(folder.path()));
  write_recording(folder / "x.strec");
  EXPECT_TRUE(fs::exists(folder / "x.strec"));
  EXPECT_FALSE(fs::exists(folder / "x.strec.part"));
}

TEST(RecordingWriter, AFullDiskIsOneLineAndNothingStays) {
  const TempDir folder;
  fs::create_symlink("/dev/full", folder / "x.strec.part");
  RecordingWriter writer;
  EXPECT_FALSE(writer.open(folder / "x.strec") && writer.write(RecordKind::kFrame, frame_payload(1)) &&
               writer.commit());
  EXPECT_NE(writer.status().find("x.strec: not written: No space left on device; free space"), std::string::npos)
      << writer.status();
  writer.abandon();
  EXPECT_TRUE(fs::is_empty(folder.path()));
}

/// No file more is opened while it lives.
class NoMoreDescriptors {
 public:
  NoMoreDescriptors() {
    EXPECT_EQ(::getrlimit(RLIMIT_NOFILE, &before_), 0);
    const rlimit none{0, before_.rlim_max};
    EXPECT_EQ(::setrlimit(RLIMIT_NOFILE, &none), 0);
  }
  ~NoMoreDescriptors() { EXPECT_EQ(::setrlimit(RLIMIT_NOFILE, &before_), 0); }

 private:
  rlimit before_{};
};

TEST(RecordingWriter, AWholeFileWhoseFolderCannotBeSyncedIsKeptAndTold) {
  const TempDir folder;
  RecordingWriter writer;
  ASSERT_TRUE(writer.open(folder / "x.strec"));
  ASSERT_TRUE(writer.write(RecordKind::kFrame, frame_payload(1)));
  {
    const NoMoreDescriptors limit;
    EXPECT_FALSE(writer.commit());
  }
  EXPECT_EQ(writer.status(), (folder / "x.strec").string() +
                                 ": written, but a power cut may lose it: its folder cannot be synced: Too many open "
                                 "files; check the disk (record.directory)");
  writer.abandon();
  EXPECT_TRUE(fs::exists(folder / "x.strec"));
  EXPECT_FALSE(fs::exists(folder / "x.strec.part"));
  // The next one says nothing of it.
  ASSERT_TRUE(writer.open(folder / "y.strec"));
  EXPECT_EQ(writer.status(), "");
}

TEST(RecordingWriter, AFolderThatIsNotThereIsOneLine) {
  const TempDir folder;
  RecordingWriter writer;
  EXPECT_FALSE(writer.open(folder / "none" / "x.strec"));
  EXPECT_NE(writer.status().find("check the folder"), std::string::npos);
}

// What a process leaves that is killed: the file that it wrote, up to somewhere, without a lock.
TEST(Torn, IsKeptUpToItsLastWholeFrameUnderANameThatSaysSo) {
  const TempDir folder;
  write_recording(folder / "stereotrack-1.strec");
  const std::vector<char> whole = bytes_of(folder / "stereotrack-1.strec");
  fs::remove(folder / "stereotrack-1.strec");
  put(folder / "stereotrack-1.strec.part", {whole.begin(), whole.end() - 700});
  const std::vector<std::string> lines = keep_torn(folder.path());
  ASSERT_EQ(lines.size(), 1U);
  EXPECT_NE(lines[0].find("stereotrack-1-torn.strec: is cut"), std::string::npos) << lines[0];
  EXPECT_FALSE(fs::exists(folder / "stereotrack-1.strec.part"));
  RecordingSource source((folder / "stereotrack-1-torn.strec").string());
  EXPECT_NE(source.warning(), "");
  EXPECT_EQ(frames_of(source), 3);
  EXPECT_TRUE(keep_torn(folder.path()).empty()) << "once";
}

TEST(Torn, OneThatOnlyLacksItsNameGetsIt) {
  const TempDir folder;
  write_recording(folder / "stereotrack-1.strec");
  fs::rename(folder / "stereotrack-1.strec", folder / "stereotrack-1.strec.part");
  EXPECT_EQ(keep_torn(folder.path()).size(), 1U);
  RecordingSource source((folder / "stereotrack-1.strec").string());
  EXPECT_EQ(source.warning(), "");
  EXPECT_EQ(frames_of(source), 4);
}

TEST(Torn, WhatHasNoFrameGoes) {
  const TempDir folder;
  (void)folder.write("stereotrack-1.strec.part", "");
  (void)folder.write("stereotrack-2.strec.part", std::string(5000, '\0'));
  EXPECT_EQ(keep_torn(folder.path()).size(), 2U);
  EXPECT_TRUE(fs::is_empty(folder.path()));
}

TEST(Torn, WhatIsBeingWrittenAndWhatIsNotOursStays) {
  const TempDir folder;
  (void)folder.write("somebody-elses.strec.part", "x");
  RecordingWriter writer;
  ASSERT_TRUE(writer.open(folder / "stereotrack-1.strec"));
  EXPECT_TRUE(keep_torn(folder.path()).empty());
  EXPECT_TRUE(fs::exists(folder / "stereotrack-1.strec.part"));
  EXPECT_TRUE(fs::exists(folder / "somebody-elses.strec.part"));
}

TEST(Torn, AFolderThatIsNotThereHasNone) {
  const TempDir folder;
  EXPECT_TRUE(keep_torn(folder / "none").empty());
}

}  // namespace
}  // namespace stereotrack::record
