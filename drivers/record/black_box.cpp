#include "drivers/record/black_box.hpp"

#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <cstring>
#include <exception>
#include <stdexcept>
#include <system_error>
#include <utility>

#include "drivers/record/calibration_text.hpp"
#include "pipeline/core/state_block.hpp"

namespace stereotrack::record {

namespace fs = std::filesystem;

namespace {

constexpr std::size_t kNotes = 32768;  // messages that the service thread keeps: ten minutes at 50 a second
// Slots beyond the seconds asked for: the frames that come before the service thread looks. And the oldest one may hold
// pixels already of a frame whose run has failed.
constexpr std::uint64_t kSpareSlots = 8;
constexpr int kFramesAStep = 8;            // that service_step() writes
constexpr std::size_t kNoCopy = SIZE_MAX;  // of a keyframe: none goes on

void count(std::atomic<std::uint64_t>& counter) noexcept {
  counter.store(counter.load(std::memory_order_relaxed) + 1, std::memory_order_relaxed);
}

std::size_t up_to_line(std::size_t bytes) noexcept {
  return (bytes + Arena::kAlignment - 1) / Arena::kAlignment * Arena::kAlignment;
}

template <class T>
void put(std::span<std::byte> memory, std::size_t at, const T& value) noexcept {
  std::memcpy(memory.data() + at, &value, sizeof value);
}

std::int16_t short_of(int value) noexcept { return static_cast<std::int16_t>(std::clamp(value, -32768, 32767)); }

// The mean of n x n pixels of luma each. luma(row, x, y): that of a pixel.
template <class Luma>
void shrink_by(Luma luma, const std::uint8_t* from, const About& about, int n, std::uint8_t* to) noexcept {
  const std::size_t bytes = row_bytes(about.format, about.width);
  const int width = about.width / n;
  const int height = about.height / n;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      unsigned sum = 0;
      for (int v = y * n; v < (y + 1) * n; ++v) {
        const std::uint8_t* row = from + static_cast<std::size_t>(v) * bytes;
        for (int u = x * n; u < (x + 1) * n; ++u) sum += luma(row, u, v);
      }
      const auto area = static_cast<unsigned>(n * n);
      *to++ = static_cast<std::uint8_t>((sum + area / 2) / area);
    }
  }
}

// Of what has one sample a pixel; of a mosaic the green one, of the pixel or of the one beside it.
template <SampleLayout kLayout>
void shrink_samples(const std::uint8_t* from, const About& about, int n, std::uint8_t* to) noexcept {
  if (!is_bayer(about.format)) {
    return shrink_by([](const auto* row, int x, int) { return sample_of(kLayout, row, x); }, from, about, n, to);
  }
  const BayerRed red = bayer_red(about.format);
  shrink_by(
      [&](const auto* row, int x, int y) { return sample_of(kLayout, row, x - x % 2 + (1 + red.x + red.y + y) % 2); },
      from, about, n, to);
}

void shrink(const std::uint8_t* from, const About& about, int n, std::uint8_t* to) noexcept {
  switch (about.format) {
    case PixelFormat::kYuyv:
      return shrink_by([](const auto* row, int x, int) { return row[2 * x]; }, from, about, n, to);
    case PixelFormat::kUyvy:
      return shrink_by([](const auto* row, int x, int) { return row[2 * x + 1]; }, from, about, n, to);
    case PixelFormat::kBgr8:
    case PixelFormat::kRgb8:  // green, which is most of it
      return shrink_by([](const auto* row, int x, int) { return row[3 * x + 1]; }, from, about, n, to);
    default: break;
  }
  switch (sample_layout(about.format)) {
    case SampleLayout::kBytes: return shrink_samples<SampleLayout::kBytes>(from, about, n, to);
    case SampleLayout::kWords10: return shrink_samples<SampleLayout::kWords10>(from, about, n, to);
    case SampleLayout::kWords12: return shrink_samples<SampleLayout::kWords12>(from, about, n, to);
    case SampleLayout::kWords16: return shrink_samples<SampleLayout::kWords16>(from, about, n, to);
    case SampleLayout::kPacked10: return shrink_samples<SampleLayout::kPacked10>(from, about, n, to);
    case SampleLayout::kPacked12: return shrink_samples<SampleLayout::kPacked12>(from, about, n, to);
  }
}

// A camera whose pixels are n times as large; the centre of the first new one lies amid the first n.
CameraModel shrunk(CameraModel camera, int n) noexcept {
  camera.width /= n;
  camera.height /= n;
  camera.fx /= n;
  camera.fy /= n;
  camera.cx = (camera.cx - (n - 1) / 2.0) / n;
  camera.cy = (camera.cy - (n - 1) / 2.0) / n;
  return camera;
}

}  // namespace

BlackBox::BlackBox(Config config, Run run, const Pipeline& pipeline)
    : config_(std::move(config)), run_(std::move(run)) {
  const About& about = run_.about;
  const auto views = static_cast<std::size_t>(about.stereo ? 2 : 1);
  if (about.width < 1 || about.height < 1 || config_.reduce < 1 || config_.every < 1 || config_.seconds <= 0 ||
      config_.seconds_after < 0 || about.period_ns <= 0) {
    throw std::runtime_error("black box: contradicting configuration; see record.* of the sample configuration");
  }
  raw_bytes_ = picture_bytes(about.format, about.width, about.height);
  kept_bytes_ = is_exact() || config_.reduce == 1
                    ? raw_bytes_
                    : static_cast<std::size_t>(about.width / config_.reduce) * (about.height / config_.reduce);
  slot_bytes_ = up_to_line(kFrameHead + views * kept_bytes_);
  const double frames_a_second = 1e9 / static_cast<double>(about.period_ns) / config_.every;
  const auto frames_in = [&](double seconds) { return static_cast<std::uint64_t>(seconds * frames_a_second + 0.5); };
  frames_after_ = frames_in(config_.seconds_after);
  slots_ = std::max<std::uint64_t>(frames_in(config_.seconds) + frames_after_, 1) + kSpareSlots;
  keyframe_every_ = std::max<std::uint64_t>(frames_in(config_.seconds) / 2, 1);
  // Asked for more than there is, Linux would give it and end the program once it is touched.
  const auto page = static_cast<std::uint64_t>(::sysconf(_SC_PAGESIZE));
  const std::uint64_t most = static_cast<std::uint64_t>(::sysconf(_SC_PHYS_PAGES)) / 4 * 3 * page;
  const bool fits = slots_ <= std::min<std::uint64_t>(most, SIZE_MAX) / slot_bytes_;  // a 32-bit system may have 8 GB
  if (fits) memory_ = arena_.array<std::byte>(static_cast<std::size_t>(slots_) * slot_bytes_);
  if (config_.reduce > 1) scratch_ = arena_.array<std::byte>(views * raw_bytes_);
  if (is_exact()) {
    const std::size_t block = sizeof(KeyframeMeta) + pipeline.state_bytes();
    for (Keyframe& keyframe : keyframes_) keyframe.memory = arena_.array<std::byte>(block);
  }
  if (!fits || arena_.failed()) {
    throw std::runtime_error("black box: no memory for " + std::to_string(slots_) + " frames of " +
                             std::to_string(slot_bytes_) +
                             " bytes; lower record.seconds or record.seconds_after, or raise record.reduce");
  }
  arena_.seal();
  notes_.resize(kNotes);
  counters_.slots_free_low.store(slots_);
}

// ---- frame loop

bool BlackBox::is_free(std::uint64_t frame) noexcept {
  if (!frozen_) return true;
  // Acquire: the service thread has read what lies in the slots before.
  const std::uint64_t released = released_.load(std::memory_order_acquire);
  if (released >= being_written_.last) {
    frozen_ = false;
    return true;
  }
  return frame < slots_ || frame - slots_ < released || frame - slots_ >= being_written_.last;
}

// The frame that was run is not kept: what follows is no row with what was before.
void BlackBox::break_row() noexcept {
  row_begin_ = next_;
  keyframe_due_ = next_;
  // A keyframe from just before it leads to it. None of these is frozen: a frozen one has frames behind it.
  for (Keyframe& keyframe : keyframes_) {
    if (keyframe.before == next_) keyframe.bytes = 0;
  }
}

void BlackBox::arm(FramePair& pair) noexcept {
  copying_ = -1;
  if (copied_ != 0 && copied_ != kNoCopy) count(counters_.keyframes_given_up);
  copied_ = kNoCopy;
  pair.left_copy = pair.right_copy = nullptr;
  armed_ = seen_++ % static_cast<std::uint64_t>(config_.every) == 0;
  if (!armed_) return;
  if (!is_free(next_)) {
    count(counters_.frames_dropped);
    armed_ = false;
    return;
  }
  const std::span<std::byte> pixels = config_.reduce > 1 ? scratch_ : slot(next_).subspan(kFrameHead);
  pair.left_copy = reinterpret_cast<std::uint8_t*>(pixels.data());
  if (run_.about.stereo) pair.right_copy = pair.left_copy + raw_bytes_;
}

void BlackBox::reduce_into(std::span<std::byte> slot) const noexcept {
  const auto* from = reinterpret_cast<const std::uint8_t*>(scratch_.data());
  auto* to = reinterpret_cast<std::uint8_t*>(slot.data() + kFrameHead);
  shrink(from, run_.about, config_.reduce, to);
  if (run_.about.stereo) shrink(from + raw_bytes_, run_.about, config_.reduce, to + kept_bytes_);
}

void BlackBox::capture(const FramePair& pair, const FrameResult& result, const FrameDecisions& decisions) noexcept {
  last_ordinal_ = pair.ordinal;
  take_triggers();
  if (!armed_) {
    break_row();
    return;
  }
  armed_ = false;
  const std::span<std::byte> slot = this->slot(next_);
  FrameMeta meta;
  meta.ordinal = pair.ordinal;
  meta.capture_ns = pair.capture_time.time_since_epoch().count();
  meta.has_skew = pair.skew ? 1 : 0;
  meta.skew_ns = pair.skew ? pair.skew->count() : 0;
  meta.flags = result.flags;
  meta.shed = decisions.shed;
  meta.tracks = static_cast<std::uint32_t>(result.tracks.size());
  meta.stage_us = decisions.stage_us;
  put(slot, 0, meta);
  const std::size_t noted = std::min(result.tracks.size(), kMostTrackNotes);
  for (std::size_t i = 0; i < noted; ++i) {
    const TrackReport& track = result.tracks[i];
    TrackNote note;
    note.id = track.id;
    note.state = static_cast<std::uint8_t>(track.state);
    note.measured = track.measured ? 1 : 0;
    note.has_depth = track.has_depth ? 1 : 0;
    note.box = {short_of(track.box.left), short_of(track.box.top), short_of(track.box.width),
                short_of(track.box.height)};
    for (int k = 0; k < 3; ++k) note.position[static_cast<std::size_t>(k)] = static_cast<float>(track.position[k]);
    put(slot, sizeof meta + i * sizeof note, note);
  }
  if (config_.reduce > 1) reduce_into(slot);
  ++next_;
  count(counters_.frames);
  count_down();
}

void BlackBox::no_frame() noexcept {
  take_triggers();
  count_down();
}

void BlackBox::take_triggers() noexcept {
  // Relaxed: the bits are all that is handed over.
  if (pending_.load(std::memory_order_relaxed) == 0) return;
  const std::uint32_t causes = pending_.exchange(0, std::memory_order_relaxed);
  (void)is_free(next_);  // looks whether the service thread is done
  if (causes_ != 0) {
    causes_ |= causes;
    count(counters_.merged);
  } else if (frozen_) {
    count(counters_.triggers_dropped);
  } else {
    causes_ = causes;
    after_left_ = frames_after_ + 1;
    count(counters_.triggers);
  }
}

void BlackBox::count_down() noexcept {
  if (causes_ == 0) return;
  if (after_left_ > 0) --after_left_;
  if (after_left_ == 0) freeze();
}

int BlackBox::oldest_keyframe(std::uint64_t first) const noexcept {
  int found = -1;
  for (int i = 0; i < kKeyframes; ++i) {
    const Keyframe& keyframe = keyframes_[static_cast<std::size_t>(i)];
    // One that no frame follows yet leads nowhere.
    if (keyframe.bytes == 0 || keyframe.before < first || keyframe.before >= next_) continue;
    if (found < 0 || keyframe.before < keyframes_[static_cast<std::size_t>(found)].before) found = i;
  }
  return found;
}

// Of a recording that ends before `last`.
std::uint64_t BlackBox::first_kept(std::uint64_t last) const noexcept {
  const std::uint64_t most = slots_ - kSpareSlots;
  return last > most ? last - most : 0;
}

void BlackBox::freeze() noexcept {
  Frozen frozen;
  frozen.first = first_kept(next_);
  frozen.last = next_;
  frozen.causes = causes_;
  frozen.keyframe = oldest_keyframe(std::max(frozen.first, row_begin_));
  if (frozen.keyframe >= 0) frozen.first = keyframes_[static_cast<std::size_t>(frozen.keyframe)].before;
  causes_ = 0;
  if (frozen.first == frozen.last) return;  // nothing was kept yet
  being_written_ = frozen;
  // The service thread has given all back of the recording before, so nobody else writes this now; the push publishes
  // it. And the queue has room: there is at most this one in it.
  released_.store(frozen.first, std::memory_order_relaxed);
  if (!frozen_queue_.push(frozen)) return;
  frozen_ = true;
  // From here on they are given back: there are never fewer.
  const std::uint64_t free = slots_ - (frozen.last - frozen.first);
  if (free < counters_.slots_free_low.load(std::memory_order_relaxed)) {
    counters_.slots_free_low.store(free, std::memory_order_relaxed);
  }
}

bool BlackBox::keyframe_step(const Pipeline& pipeline) noexcept {
  if (!is_exact()) return false;
  if (copying_ < 0) {
    if (next_ < keyframe_due_) return false;
    // While the seconds after a trigger run, a newer keyframe would take the place of the one that is wanted.
    if (causes_ != 0 && oldest_keyframe(std::max(first_kept(next_ + after_left_), row_begin_)) >= 0) return false;
    (void)is_free(next_);
    // The oldest of those that are not frozen.
    for (int i = 0; i < kKeyframes; ++i) {
      if (frozen_ && i == being_written_.keyframe) continue;
      const auto age = [&](int k) {
        const Keyframe& keyframe = keyframes_[static_cast<std::size_t>(k)];
        return keyframe.bytes == 0 ? 0 : keyframe.before + 1;
      };
      if (copying_ < 0 || age(i) < age(copying_)) copying_ = i;
    }
    copied_ = 0;
    keyframes_[static_cast<std::size_t>(copying_)].bytes = 0;
  }
  Keyframe& keyframe = keyframes_[static_cast<std::size_t>(copying_)];
  const std::span<std::byte> block = keyframe.memory.subspan(sizeof(KeyframeMeta));
  const std::size_t wanted = std::min(kPart, block.size() - copied_);
  const std::size_t got = pipeline.copy_state_part(copied_, block.subspan(copied_, wanted));
  copied_ += got;
  if (got == kPart) return true;
  put(keyframe.memory, 0, KeyframeMeta{.after = last_ordinal_, .reserved = 0});
  keyframe.bytes = sizeof(KeyframeMeta) + copied_;
  keyframe.before = next_;
  keyframe_due_ = next_ + keyframe_every_;
  copying_ = -1;
  copied_ = kNoCopy;
  count(counters_.keyframes);
  return false;
}

// ---- publisher

void BlackBox::note(const OutputNote& output) noexcept {
  if (!outputs_.push(output)) count(counters_.outputs_dropped);
}

// ---- service thread

void BlackBox::take_notes() noexcept {
  for (OutputNote output; outputs_.pop(output);) {
    notes_[noted_++ % kNotes] = output;
    told_ordinal_ = std::max(told_ordinal_, output.ordinal);
  }
}

bool BlackBox::service_step() noexcept {
  take_notes();
  try {
    if (!writing_) {
      Frozen frozen;
      if (!frozen_queue_.pop(frozen)) return false;
      writing_ = frozen;
      write_next_ = frozen.first;
      begin(frozen);
    } else if (write_next_ < writing_->last) {
      write_some();
    } else if (is_told()) {
      end();
    } else {
      return false;
    }
  } catch (const std::exception& error) {
    drop(error.what());
  }
  return writing_.has_value();
}

// Messages leave after their frames: whether those of the last ones are there, or have not come for long.
bool BlackBox::is_told() noexcept {
  const bool told = noted_ == 0 || told_ordinal_ >= last_ordinal_written_;
  return told || ++rounds_waited_ > config_.patience;
}

// The recording is given up; its frames go back.
void BlackBox::drop(const std::string& why) noexcept {
  writer_.abandon();
  count(counters_.recordings_failed);
  try {
    last_error_ = why;
  } catch (const std::exception&) {
    last_error_.clear();
  }
  // Release: nothing of the slots is read any more.
  if (writing_ && write_next_ < writing_->last) released_.store(writing_->last, std::memory_order_release);
  writing_.reset();
}

About BlackBox::about_of(const Frozen& frozen) const {
  About about = run_.about;
  about.cause = cause_text(frozen.causes);
  about.exact = frozen.keyframe >= 0;
  about.reduce = config_.reduce;
  about.every = config_.every;
  about.period_ns *= config_.every;
  if (config_.reduce > 1) {
    about.width /= config_.reduce;
    about.height /= config_.reduce;
    about.format = PixelFormat::kGrey8;
  }
  return about;
}

// Deletes the oldest recordings of ours until `bytes` more fit. Throws where the disk has too little all the same.
void BlackBox::make_room(std::uint64_t bytes) {
  struct Old {
    fs::path path;
    std::uint64_t bytes;
  };
  std::vector<Old> old;
  std::uint64_t sum = 0;
  for (const fs::directory_entry& entry : fs::directory_iterator(config_.directory)) {
    const std::string name = entry.path().filename().string();
    if (!name.starts_with(kPrefix) || !name.ends_with(".strec")) continue;
    old.push_back({entry.path(), entry.file_size()});
    sum += old.back().bytes;
  }
  if (bytes > config_.max_bytes) {
    throw std::runtime_error(config_.directory.string() + ": a recording of " + std::to_string(bytes >> 20U) +
                             " MB is more than record.max_mb; raise it, or lower record.seconds");
  }
  // By session and frame, which only rise: the clock of a board without a battery goes back.
  std::sort(old.begin(), old.end(), [](const Old& a, const Old& b) { return a.path < b.path; });
  for (auto oldest = old.begin(); oldest != old.end() && sum + bytes > config_.max_bytes; ++oldest) {
    fs::remove(oldest->path);
    sum -= oldest->bytes;
  }
  if (fs::space(config_.directory).available < bytes + config_.spare_bytes) {
    throw std::runtime_error(config_.directory.string() + ": too little space on the disk for a recording of " +
                             std::to_string(bytes >> 20U) + " MB; free some, or set record.directory to another disk");
  }
}

void BlackBox::begin(const Frozen& frozen) {
  const About about = about_of(frozen);
  const auto ordinal_of = [&](std::uint64_t frame) {
    FrameMeta meta;
    std::memcpy(&meta, slot(frame).data(), sizeof meta);
    return meta.ordinal;
  };
  first_ordinal_ = ordinal_of(frozen.first);
  last_ordinal_written_ = ordinal_of(frozen.last - 1);
  rounds_waited_ = 0;
  std::array<char, 64> name{};
  (void)std::snprintf(name.data(), name.size(), "%s%016llx-%010llu-", kPrefix,
                      static_cast<unsigned long long>(about.session),
                      static_cast<unsigned long long>(last_ordinal_written_));
  make_room((frozen.last - frozen.first + 1) * slot_bytes_ +
            (frozen.keyframe < 0 ? 0 : keyframes_[static_cast<std::size_t>(frozen.keyframe)].bytes));
  const auto text = [&](RecordKind kind, const std::string& content) {
    if (!writer_.write(kind, std::as_bytes(std::span(content)))) throw std::runtime_error(writer_.status());
  };
  if (!writer_.open(config_.directory / (name.data() + about.cause + ".strec"))) {
    throw std::runtime_error(writer_.status());
  }
  last_recording_ = (config_.directory / (name.data() + about.cause + ".strec")).string();
  text(RecordKind::kAbout, to_text(about));
  if (run_.calibration) {
    StereoCalibration calibration = *run_.calibration;
    if (config_.reduce > 1) {
      calibration.left = shrunk(calibration.left, config_.reduce);
      calibration.right = shrunk(calibration.right, config_.reduce);
    }
    text(RecordKind::kCalibration, to_text(calibration));
  }
  text(RecordKind::kConfiguration, run_.configuration);
  if (frozen.keyframe < 0) return;
  const Keyframe& keyframe = keyframes_[static_cast<std::size_t>(frozen.keyframe)];
  const std::span<std::byte> payload = keyframe.memory.first(static_cast<std::size_t>(keyframe.bytes));
  if (!seal_state(payload.subspan(sizeof(KeyframeMeta)))) throw std::runtime_error("black box: a keyframe is torn");
  if (!writer_.write(RecordKind::kKeyframe, payload)) throw std::runtime_error(writer_.status());
}

void BlackBox::write_some() {
  const std::size_t bytes = kFrameHead + (run_.about.stereo ? 2 : 1) * kept_bytes_;
  for (int i = 0; i < kFramesAStep && write_next_ < writing_->last; ++i) {
    const std::span<std::byte> slot = this->slot(write_next_);
    if (!writer_.write(RecordKind::kFrame, slot.first(bytes))) throw std::runtime_error(writer_.status());
    // Release: the frame loop may write the slot again; it has been read.
    released_.store(++write_next_, std::memory_order_release);
  }
  // A power cut takes what lies in memory only: these frames stay.
  if (!writer_.flush()) throw std::runtime_error(writer_.status());
}

void BlackBox::end() {
  // What left with states of these frames, in its order; without any state only amid them.
  bool begun = false;
  for (std::uint64_t i = noted_ > kNotes ? noted_ - kNotes : 0; i < noted_; ++i) {
    const OutputNote& note = notes_[i % kNotes];
    if (note.state_ordinal > last_ordinal_written_) break;
    begun = begun || note.state_ordinal >= first_ordinal_;
    if (!begun) continue;
    writer_.write(RecordKind::kOutput, std::as_bytes(std::span(&note, 1)));
  }
  if (!writer_.commit()) throw std::runtime_error(writer_.status());
  count(counters_.recordings);
  last_error_.clear();
  writing_.reset();
}

}  // namespace stereotrack::record
