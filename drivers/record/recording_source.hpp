#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "drivers/capture/frame_source.hpp"
#include "drivers/record/format.hpp"
#include "pipeline/geometry/calibration.hpp"

namespace stereotrack::record {

/// Whether a SOURCE names a recording of ours: a path that ends in .strec.
[[nodiscard]] bool is_recording(const std::string& source);

/// A recording as a source of frame pairs, and all that it keeps of its run beside them. The file is mapped, not read:
/// a pair's pixels are views of it. What a pair of an exact recording gives in a replay is what it gave in the run, if
/// the pipeline has the recording's configuration and takes keyframe() before the first pair and decisions() with each.
///
/// A file that was cut, or is damaged where one record follows the next, is readable up to there: warning(). A frame
/// whose pixels are damaged is one kSkipped.
class RecordingSource final : public capture::FrameSource {
 public:
  /// Throws std::runtime_error, one line with the path and the way out.
  explicit RecordingSource(const std::string& path);
  ~RecordingSource() override;

  [[nodiscard]] const capture::SourceInfo& info() const noexcept override { return info_; }
  [[nodiscard]] capture::Next next(FramePair& out) noexcept override;
  [[nodiscard]] const std::string& skip_reason() const noexcept override { return skip_reason_; }
  void skip_to(std::uint64_t ordinal) noexcept override;

  [[nodiscard]] const About& about() const noexcept { return about_; }
  [[nodiscard]] const std::optional<StereoCalibration>& calibration() const noexcept { return calibration_; }
  /// TOML of all keys.
  [[nodiscard]] const std::string& configuration() const noexcept { return configuration_; }
  /// Empty, or one line: up to where the file could be read.
  [[nodiscard]] const std::string& warning() const noexcept { return warning_; }

  /// The block of state from which the first pair goes on; empty: there is none, or pairs were skipped.
  [[nodiscard]] std::span<const std::byte> keyframe() const noexcept {
    return at_ == 0 ? keyframe_ : std::span<const std::byte>{};
  }

  /// Of the pair that next() gave last.
  [[nodiscard]] const FrameDecisions& decisions() const noexcept { return decisions_; }
  [[nodiscard]] std::span<const TrackNote> track_notes() const noexcept { return track_notes_; }

  /// The run's messages that left with a state of one of these pairs, in the order in which they left; empty: they were
  /// not recorded.
  [[nodiscard]] std::span<const OutputNote> outputs() const noexcept { return outputs_; }

 private:
  struct FileRecord {
    RecordHeader header;
    std::span<const std::byte> payload;
  };
  [[nodiscard]] bool read_record(std::size_t& at, FileRecord& out) const noexcept;
  void index();
  void take_text(const FileRecord& record);

  std::string path_;
  std::span<const std::byte> file_;  // mapped
  capture::SourceInfo info_;
  About about_;
  std::optional<StereoCalibration> calibration_;
  std::string configuration_;
  std::string warning_;
  std::string skip_reason_;
  std::span<const std::byte> keyframe_;
  std::vector<FileRecord> frames_;
  std::vector<OutputNote> outputs_;
  std::size_t at_ = 0;
  FrameDecisions decisions_;
  std::vector<TrackNote> track_notes_;
};

}  // namespace stereotrack::record
