#include "drivers/record/recording_source.hpp"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <stdexcept>

#include "drivers/record/calibration_text.hpp"
#include "pipeline/core/checksum.hpp"

namespace stereotrack::record {

namespace {

constexpr const char* kNotOurs = "no recording of ours, or of a version that is not known";

template <class T>
T value_at(std::span<const std::byte> bytes, std::size_t at = 0) noexcept {
  T value;
  std::memcpy(&value, bytes.data() + at, sizeof value);
  return value;
}

std::string text_of(std::span<const std::byte> bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

std::span<const std::byte> map_file(const std::string& path) {
  const auto unreadable = [&](int error) {
    return std::runtime_error(path + ": cannot be read: " + std::strerror(error) + "; check the path");
  };
  const auto too_large = [&] {
    return std::runtime_error(path + ": larger than a program can address here; replay it on a 64-bit machine");
  };
  const int file = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (file < 0) throw unreadable(errno);
  struct stat state {};
  const bool known = ::fstat(file, &state) == 0 && S_ISREG(state.st_mode);
  const auto bytes = known ? static_cast<std::uint64_t>(state.st_size) : 0;
  const auto size = static_cast<std::size_t>(bytes);  // of 32 bits on ARMv7
  const bool ours = bytes >= sizeof(FileHeader);
  void* memory = !ours || size != bytes ? MAP_FAILED : ::mmap(nullptr, size, PROT_READ, MAP_PRIVATE, file, 0);
  const int error = errno;
  ::close(file);
  if (!ours) throw std::runtime_error(path + ": " + kNotOurs + "; give a .strec file of this program");
  if (size != bytes || (memory == MAP_FAILED && error == ENOMEM)) throw too_large();
  if (memory == MAP_FAILED) throw unreadable(error);
  return {static_cast<const std::byte*>(memory), size};
}

}  // namespace

bool is_recording(const std::string& source) { return source.ends_with(".strec"); }

RecordingSource::RecordingSource(const std::string& path) : path_(path), file_(map_file(path)) {
  try {
    index();
  } catch (...) {
    ::munmap(const_cast<std::byte*>(file_.data()), file_.size());
    throw;
  }
}

RecordingSource::~RecordingSource() { ::munmap(const_cast<std::byte*>(file_.data()), file_.size()); }

// False: nothing whole at `at`.
bool RecordingSource::read_record(std::size_t& at, FileRecord& out) const noexcept {
  if (file_.size() - at < sizeof(RecordHeader)) return false;
  const std::span<const std::byte> header = file_.subspan(at, sizeof(RecordHeader));
  out.header = value_at<RecordHeader>(header);
  if (out.header.header_sum != checksum(header.first(offsetof(RecordHeader, header_sum)))) return false;
  const std::size_t payload = at + sizeof(RecordHeader);
  if (file_.size() - payload < out.header.bytes) return false;
  const auto bytes = static_cast<std::size_t>(out.header.bytes);
  out.payload = file_.subspan(payload, bytes);
  at = payload + bytes;
  return true;
}

void RecordingSource::take_text(const FileRecord& record) {
  if (checksum(record.payload) != record.header.sum) {
    throw std::runtime_error(path_ + ": damaged at its beginning; take another copy of the file");
  }
  const std::string text = text_of(record.payload);
  if (record.header.kind == RecordKind::kAbout) about_ = about_from_text(text, path_);
  if (record.header.kind == RecordKind::kCalibration) calibration_ = calibration_from_text(text, path_);
  if (record.header.kind == RecordKind::kConfiguration) configuration_ = text;
}

void RecordingSource::index() {
  const auto header = value_at<FileHeader>(file_);
  if (header.magic != FileHeader().magic || header.version != kFormatVersion) {
    throw std::runtime_error(path_ + ": " + kNotOurs + "; give a .strec file of this program");
  }
  std::size_t at = sizeof header;
  FileRecord record;
  bool whole = false;
  bool keyframe_damaged = false;
  int outputs_damaged = 0;
  std::uint32_t number = 0;
  while (!whole && read_record(at, record)) {
    if (record.header.number != ++number) break;
    switch (record.header.kind) {
      case RecordKind::kAbout:
      case RecordKind::kCalibration:
      case RecordKind::kConfiguration: take_text(record); break;
      case RecordKind::kKeyframe:
        keyframe_damaged =
            record.payload.size() < sizeof(KeyframeMeta) || checksum(record.payload) != record.header.sum;
        if (!keyframe_damaged && frames_.empty()) keyframe_ = record.payload.subspan(sizeof(KeyframeMeta));
        break;
      case RecordKind::kFrame: frames_.push_back(record); break;
      case RecordKind::kOutput:
        if (record.payload.size() == sizeof(OutputNote) && checksum(record.payload) == record.header.sum) {
          outputs_.push_back(value_at<OutputNote>(record.payload));
        } else {
          ++outputs_damaged;
        }
        break;
      case RecordKind::kEnd:
        whole = record.payload.size() == sizeof(EndMeta) && checksum(record.payload) == record.header.sum &&
                value_at<EndMeta>(record.payload).frames == frames_.size();
        if (!whole) at = file_.size();
        break;
    }
  }
  if (about_.width == 0) {
    throw std::runtime_error(path_ + ": cut before its first frame; take another copy of the file");
  }
  const std::size_t picture = picture_bytes(about_.format, about_.width, about_.height);
  const std::size_t pictures = picture * (about_.stereo ? 2 : 1);
  std::erase_if(frames_, [&](const FileRecord& frame) { return frame.payload.size() != kFrameHead + pictures; });
  if (frames_.empty()) throw std::runtime_error(path_ + ": holds no frame; take another copy of the file");
  if (about_.stereo && !calibration_) throw std::runtime_error(path_ + ": holds no calibration; take another copy");
  const std::uint64_t last = value_at<FrameMeta>(frames_.back().payload).ordinal;
  if (!whole) {
    warning_ = path_ + ": cut or damaged after byte " + std::to_string(at) + " of " + std::to_string(file_.size()) +
               ": read up to frame " + std::to_string(last) + " (" + std::to_string(frames_.size()) + " frames)";
  } else if (keyframe_damaged) {
    warning_ = path_ + ": its keyframe is damaged";
  } else if (outputs_damaged > 0) {
    warning_ = path_ + ": " + std::to_string(outputs_damaged) + " of its messages are damaged and left out";
  }
  info_.name = path_;
  info_.width = about_.width;
  info_.height = about_.height;
  info_.format = about_.format;
  info_.stereo = about_.stereo;
  info_.has_time = true;
  info_.period = std::chrono::nanoseconds(about_.period_ns);
}

capture::Next RecordingSource::next(FramePair& out) noexcept {
  if (at_ == frames_.size()) return capture::Next::kEnd;
  const FileRecord& record = frames_[at_++];
  const auto meta = value_at<FrameMeta>(record.payload);
  out = {};
  out.ordinal = meta.ordinal;
  out.capture_time = CaptureTime(std::chrono::nanoseconds(meta.capture_ns));
  if (checksum(record.payload) != record.header.sum) {
    skip_reason_ = path_ + ": frame " + std::to_string(meta.ordinal) + " is damaged";
    return capture::Next::kSkipped;
  }
  if (meta.has_skew != 0) out.skew = std::chrono::nanoseconds(meta.skew_ns);
  decisions_.shed = static_cast<std::uint8_t>(meta.shed);
  decisions_.stage_us = meta.stage_us;
  track_notes_.clear();
  for (std::size_t i = 0; i < std::min<std::size_t>(meta.tracks, kMostTrackNotes); ++i) {
    track_notes_.push_back(value_at<TrackNote>(record.payload, sizeof(FrameMeta) + i * sizeof(TrackNote)));
  }
  const auto* pixels = reinterpret_cast<const std::uint8_t*>(record.payload.data() + kFrameHead);
  const auto picture = [&](const std::uint8_t* data) {
    const auto stride = static_cast<std::ptrdiff_t>(row_bytes(about_.format, about_.width));
    return Picture{data, about_.width, about_.height, stride, about_.format};
  };
  out.left = picture(pixels);
  // Where the run had no right picture, what lies in its place means nothing.
  const bool both = about_.stereo && (meta.flags & kFlagMono) == 0;
  if (both) out.right = picture(pixels + picture_bytes(about_.format, about_.width, about_.height));
  return capture::Next::kPair;
}

void RecordingSource::skip_to(std::uint64_t ordinal) noexcept {
  while (at_ < frames_.size() && value_at<FrameMeta>(frames_[at_].payload).ordinal <= ordinal) ++at_;
}

}  // namespace stereotrack::record
