#pragma once

#include <array>
#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "drivers/record/format.hpp"
#include "drivers/record/recording_writer.hpp"
#include "pipeline/core/arena.hpp"
#include "pipeline/core/queue.hpp"
#include "pipeline/geometry/calibration.hpp"
#include "pipeline/pipeline.hpp"

namespace stereotrack::record {

/// The last seconds of a run in memory taken at start: frames, targets, timings, decisions, and keyframes of the
/// pipeline's state. When something happens (trigger()), what is there and what comes in the seconds after goes to a
/// recording, which the service thread writes while the frame loop goes on.
///
/// Who does what; nobody waits for anybody:
///
///     frame loop   arm(pair); Pipeline::run(pair); capture(pair, result, decisions)      each frame
///                  while (no pair has come and keyframe_step(pipeline)) {}                between two frames
///                  no_frame()                                                            when none came in its time
///     publisher    note(output)                                                          each message
///     any thread   trigger(cause)
///     service      while (service_step()) {}                                             again and again
///
/// **Slots.** Frame p (counted from 0) lies in slot p mod n. The frame loop writes the next and so gives up the oldest,
/// until a recording is frozen: its frames [first, last) then belong to the service thread, which gives each back as
/// soon as it is written. A frame whose slot is not back yet is not kept (frames_dropped): a slow disk costs frames of
/// the next recording, and never time.
///
/// **Keyframes.** A recording is exact, so that a replay gives the run's bytes, if it begins with the pipeline's state
/// and keeps each frame from there on: at least half of `seconds` before the trigger. There are three blocks: one may
/// be frozen, two take turns, half of `seconds` apart. One is several MB, a third of a frame's time: it is copied in
/// parts of kPart between two frames, when nothing changes it. Where a pair comes before the last part the attempt is
/// given up (keyframes_given_up) and begins anew after that frame. What was run and not kept (frames_dropped, or never
/// captured) breaks the row, and what follows is exact from the next keyframe on.
///
/// **Reduced** recordings (reduce > 1 or every > 1) have luma alone, the mean of reduce x reduce pixels, of every n-th
/// frame, no keyframes, and are not exact.
///
/// **Triggers** while the seconds after another one run are merged into its recording (merged); while a recording is
/// written they are dropped, counted (triggers_dropped).
///
/// Costs of the frame loop: capture() notes a kilobyte; the pixels are copied by ingest, which reads each row from the
/// copy then. No heap, lock or system call there.
class BlackBox {
 public:
  static constexpr std::size_t kPart = std::size_t{256} * 1024;  ///< of a keyframe, a step: 0.03 ms on a PC
  static constexpr int kKeyframes = 3;

  struct Config {
    double seconds = 10;                ///< before a trigger, 0.1..600
    double seconds_after = 2;           ///< after it, 0..600
    int reduce = 1;                     ///< 1, 2, 4
    int every = 1;                      ///< 1..100
    std::filesystem::path directory{};  ///< must exist; the recordings' names begin with kPrefix
    std::uint64_t max_bytes = 0;  ///< of all recordings in it; the oldest, by their names, go, where there are more
    int patience = 20;            ///< rounds of service_step() that wait for the messages of the last frames
    std::uint64_t spare_bytes = std::uint64_t{64} << 20U;  ///< stay free on the disk
  };
  static constexpr const char* kPrefix = "stereotrack-";

  /// What recordings say of the run: `about` without cause, exact and the picture's size, which follow.
  struct Run {
    About about;
    std::optional<StereoCalibration> calibration;
    std::string configuration;  ///< TOML of all keys
  };

  /// Each has one writer; any thread may read.
  struct Counters {
    std::atomic<std::uint64_t> frames{0};              ///< kept
    std::atomic<std::uint64_t> frames_dropped{0};      ///< their slots were still being written
    std::atomic<std::uint64_t> keyframes{0};           ///< whole
    std::atomic<std::uint64_t> keyframes_given_up{0};  ///< a pair came before they were
    std::atomic<std::uint64_t> triggers{0};            ///< that began a recording
    std::atomic<std::uint64_t> merged{0};              ///< that came in the seconds after one
    std::atomic<std::uint64_t> triggers_dropped{0};    ///< that came while a recording was written
    std::atomic<std::uint64_t> recordings{0};          ///< written
    std::atomic<std::uint64_t> recordings_failed{0};   ///< disk full, or it could not be written
    std::atomic<std::uint64_t> slots_free_low{0};      ///< fewest slots that no recording held; see slots()
    std::atomic<std::uint64_t> outputs_dropped{0};     ///< the service thread did not come to take them
  };

  /// Takes all memory, and touches it. `pipeline`: the one whose state is kept. Throws std::runtime_error, one line.
  BlackBox(Config config, Run run, const Pipeline& pipeline);
  BlackBox(const BlackBox&) = delete;
  BlackBox& operator=(const BlackBox&) = delete;
  ~BlackBox() = default;

  // Frame loop.

  /// Says where ingest puts the pair's pixels; nowhere, if the frame is not kept.
  void arm(FramePair& pair) noexcept;
  /// The frame was run: keeps the rest.
  void capture(const FramePair& pair, const FrameResult& result, const FrameDecisions& decisions) noexcept;
  /// One part of a keyframe, if one is due. True: there is more to do, if there is still time.
  bool keyframe_step(const Pipeline& pipeline) noexcept;
  /// A frame's time has passed without one: the seconds after a trigger go on.
  void no_frame() noexcept;

  // Any thread.

  void trigger(Cause cause) noexcept { pending_.fetch_or(cause, std::memory_order_relaxed); }
  [[nodiscard]] const Counters& counters() const noexcept { return counters_; }

  // Publisher.

  void note(const OutputNote& output) noexcept;

  // Service thread.

  /// Takes a small piece of work: some frames of a recording. May wait for the disk. True: there is more.
  bool service_step() noexcept;
  /// The path of the last recording, empty before the first; and what went wrong since the last that was written, empty
  /// or one line.
  [[nodiscard]] const std::string& last_recording() const noexcept { return last_recording_; }
  [[nodiscard]] const std::string& last_error() const noexcept { return last_error_; }

  /// Frames that there is memory for. Those of a recording that is being written are the service thread's until it
  /// gives them back, one by one; the others are free for frames to come.
  [[nodiscard]] std::uint64_t slots() const noexcept { return slots_; }
  [[nodiscard]] std::size_t memory_bytes() const noexcept { return arena_.bytes_used(); }
  [[nodiscard]] bool is_exact() const noexcept { return config_.reduce == 1 && config_.every == 1; }

 private:
  struct Keyframe {
    std::span<std::byte> memory;  // KeyframeMeta, block
    std::uint64_t bytes = 0;      // of both, once whole; 0 = not whole
    std::uint64_t before = 0;     // the frame that follows
  };
  /// What the frame loop gives to the service thread.
  struct Frozen {
    std::uint64_t first = 0;  // frames [first, last)
    std::uint64_t last = 0;
    int keyframe = -1;  // -1: none, not exact
    std::uint32_t causes = 0;
  };

  [[nodiscard]] std::span<std::byte> slot(std::uint64_t frame) const noexcept {
    return memory_.subspan(static_cast<std::size_t>(frame % slots_) * slot_bytes_, slot_bytes_);
  }
  [[nodiscard]] bool is_free(std::uint64_t frame) noexcept;
  void break_row() noexcept;
  void take_triggers() noexcept;
  void count_down() noexcept;
  void freeze() noexcept;
  [[nodiscard]] std::uint64_t first_kept(std::uint64_t last) const noexcept;
  [[nodiscard]] int oldest_keyframe(std::uint64_t first) const noexcept;
  void reduce_into(std::span<std::byte> slot) const noexcept;
  void take_notes() noexcept;
  [[nodiscard]] bool is_told() noexcept;
  void begin(const Frozen& frozen);
  void write_some();
  void end();
  void drop(const std::string& why) noexcept;
  void make_room(std::uint64_t bytes);
  [[nodiscard]] About about_of(const Frozen& frozen) const;

  Config config_;
  Run run_;
  Arena arena_;
  std::size_t raw_bytes_ = 0;   // of one picture as it comes
  std::size_t kept_bytes_ = 0;  // as it is kept
  std::size_t slot_bytes_ = 0;
  std::uint64_t slots_ = 0;
  std::uint64_t frames_after_ = 0;
  std::uint64_t keyframe_every_ = 0;  // frames
  std::span<std::byte> memory_;
  std::span<std::byte> scratch_;  // both pictures, where they are reduced
  Counters counters_;
  std::atomic<std::uint32_t> pending_{0};  // causes
  HandoverQueue<Frozen, 2> frozen_queue_;
  HandoverQueue<OutputNote, 1024> outputs_;
  std::atomic<std::uint64_t> released_{0};  // frames before it are the frame loop's again; service thread's

  // Frame loop's.
  std::uint64_t next_ = 0;       // frame to come
  std::uint64_t row_begin_ = 0;  // no frame is missing from here on
  std::uint64_t seen_ = 0;       // frames that were armed, kept or not
  std::uint64_t last_ordinal_ = 0;
  bool armed_ = false;
  bool frozen_ = false;  // a recording is being written
  Frozen being_written_;
  std::uint32_t causes_ = 0;  // of the recording to come; 0 = none
  std::uint64_t after_left_ = 0;
  std::array<Keyframe, kKeyframes> keyframes_;
  int copying_ = -1;  // index of the keyframe that is being copied
  std::size_t copied_ = 0;
  std::uint64_t keyframe_due_ = 0;  // frame before which one is wanted

  // Service thread's.
  std::optional<Frozen> writing_;
  std::uint64_t write_next_ = 0;
  std::uint64_t first_ordinal_ = 0;
  std::uint64_t last_ordinal_written_ = 0;
  int rounds_waited_ = 0;
  RecordingWriter writer_;
  std::vector<OutputNote> notes_;  // a ring of the last ones
  std::uint64_t noted_ = 0;
  std::uint64_t told_ordinal_ = 0;  // newest pair of which a message was noted
  std::string last_recording_;
  std::string last_error_;
};

}  // namespace stereotrack::record
