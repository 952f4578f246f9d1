#pragma once

#include <array>
#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "drivers/capture/camera.hpp"
#include "drivers/capture/live_source.hpp"
#include "drivers/capture/stereo_cameras/phase.hpp"
#include "drivers/capture/stereo_cameras/rate_steering.hpp"
#include "drivers/trigger/answer_watch.hpp"
#include "drivers/trigger/pairer.hpp"
#include "drivers/trigger/pulse_matcher.hpp"
#include "drivers/trigger/trigger.hpp"
#include "pipeline/core/counter.hpp"
#include "pipeline/core/queue.hpp"

namespace stereotrack::capture {

/// Pairs of two cameras, or the pictures of one. Pixels stay in the drivers' buffers: a table says which buffers each
/// slot of the pool names, and gives them back when the slot comes back or is used anew.
///
/// One clock: each stamp is moved to the monotonic clock by its own camera's map as the frame is taken, so the source's
/// capture clock is the monotonic one, cameras with different clocks pair, and none of them is asked for its clock once
/// it is gone.
///
/// What goes wrong, and what follows (policy is here alone, the same for every driver):
/// * damaged frame: given back, counted by its camera;
/// * a frame without a partner: given back by the pairer's rules, its slot in time leaves as missing;
/// * a camera is lost, or silent for `timeout`: it is given up. Without the right one, left pictures go on as pairs
/// with
///   an empty right one (the pipeline says mono); without the left one no pair comes. The dead camera goes to the
///   service thread once no slot names its buffers; tend() destroys it, opens another, with back-off, and hands that
///   one over. The daemon goes on meanwhile, whatever is gone;
/// * silence counts from the first frame that came from any camera on. Where frames come `triggered`, both silent is no
///   fault of theirs: it is told, and they are kept; one is at fault that is asked, by pulses or the other one's
///   frames, for half of `timeout` without a pause of all of it;
/// * both deliver and no two fit for `timeout`: likewise mono, until two fit. Late right frames make it more patient;
/// * with a trigger::Trigger, frames are counted against its pulses, and the number of a frame's pulse is what two must
///   have in common: a missed or doubled exposure breaks no pair. Frames that no pulse asked for are given back. While
///   no pulse is told and frames come, they pair without;
/// * no frame answers a pulse for `timeout`: the cameras do not follow the trigger, or with another delay. Frames pair
///   without pulses, until AnswerWatch::kConvincing in a row of a camera answer one;
/// * one camera answers and the other does not, or with under two thirds of its frames (trigger::AnswerWatch: its wire
///   is off, it runs free): as if it were lost, but it is kept. It is named; without the right one left pictures go on
///   in mono, without the left one no pair comes; its frames are given back, whatever they would fit, until it is
///   believed again;
/// * a left frame, whose time is its pair's, bears one after its arrival: told once a camera; no result leaves on time;
/// * a camera that comes back and delivers another size or format is refused;
/// * two that nobody triggers and that are to `steer`: tend() holds the right one's rate to the left one's
///   (RateSteering), where its driver can set the period while it streams. That driver's calls are made here, on the
///   service thread; a camera is closed by the same thread, so none is called once it is gone.
///
/// A lost camera is found within 0.1 s; pairs come again with the third frame of the one that is back, where sequences
/// must be learnt anew (trigger::Pairer), else with the first.
class StereoCameras final : public LiveSource {
 public:
  static constexpr std::size_t kMostBuffers = 64;             ///< of one camera
  static constexpr std::chrono::milliseconds kStartUp{2000};  ///< over `timeout`, for a camera's first frame
  static constexpr int kLeastTimeoutPeriods = 4;              ///< a shorter `timeout` is held to so many

  /// Opens the camera of that side; called by the constructor, then by tend(). Throws std::runtime_error, one line.
  using Open = std::function<std::unique_ptr<Camera>(trigger::Side)>;

  struct Config {
    std::string name = "cameras";
    bool stereo = true;         ///< false: the left one alone
    bool side_by_side = false;  ///< the left one alone, whose picture holds both views: see side_by_side.hpp
    double tolerance = 0.25;
    bool triggered = false;
    bool steer = false;  ///< not with `triggered`
    std::chrono::nanoseconds timeout{std::chrono::milliseconds(500)};
    std::chrono::nanoseconds back_off_first{std::chrono::milliseconds(500)};
    std::chrono::nanoseconds back_off_most{std::chrono::seconds(10)};
    std::chrono::nanoseconds period{0};         ///< of what triggers the cameras; 0: as the cameras tell
    std::chrono::nanoseconds pulse_delay{0};    ///< from a trigger's pulse to the beginning of the exposure it asks for
    std::chrono::nanoseconds exposure{0};       ///< of frames whose driver does not tell theirs: for their beginning
    MonotonicTime (*now)() noexcept = nullptr;  ///< null: CLOCK_MONOTONIC. Tests bring a time of their own
  };

  /// Opens and starts them. One that cannot be opened is tried again by tend(). Throws std::runtime_error: none can be,
  /// they do not deliver the same, or no rate is known.
  /// `trigger`: what tells of pulses; null: nobody.
  StereoCameras(Open open, const Config& config, std::unique_ptr<trigger::Trigger> trigger = nullptr);
  ~StereoCameras() override;
  StereoCameras(const StereoCameras&) = delete;
  StereoCameras& operator=(const StereoCameras&) = delete;

  [[nodiscard]] const SourceInfo& info() const noexcept override { return info_; }
  [[nodiscard]] Step step(PairOutlet& outlet, MonotonicTime until) noexcept override;
  [[nodiscard]] ClockMap clock_map() const noexcept override { return {}; }
  [[nodiscard]] const std::string& failure() const noexcept override { return failure_; }
  void tend(std::vector<SourceNote>& notes) override;
  [[nodiscard]] SourceFigures figures() const noexcept override;

 private:
  using Side = trigger::Side;

  /// What the capture thread tells the service thread; small, so that it is told without memory.
  enum class Change : std::uint8_t {
    kHeard,
    kAhead,
    kBothSilent,
    kBothHeard,
    kUnmatched,
    kMatched,
    kNoPulses,
    kPulses,
    kNoAnswers,
    kAnswers,
    kAstray,
    kFollows
  };
  struct Event {
    Change change{};
    Side side{};
    std::chrono::nanoseconds span{0};
    std::uint32_t frames = 0;      ///< kAstray, the two
    std::uint32_t unanswered = 0;  ///< of these
  };
  struct Distance {
    CaptureTime time{};
    std::chrono::nanoseconds distance{0};
    bool anew = false;  ///< a camera is another
  };

  struct Eye {
    // ---- Capture thread
    std::unique_ptr<Camera> camera;  ///< null: the service thread has it, or there is none
    bool ending = false;             ///< given up; its buffers are still named
    bool late_comer = false;         ///< not of those that it began with
    bool ahead_is_told = false;      ///< that its frames bear times after their arrival
    std::size_t held = 0;            ///< buffers that were taken
    std::size_t buffers = 0;
    MonotonicTime joined{};
    std::optional<MonotonicTime> heard;  ///< when its last good frame came
    CaptureTime last{};                  ///< of it
    MonotonicTime asked{};               ///< since when frames were asked of it without a pause
    MonotonicTime last_asked{};
    Camera::Counters before;     ///< of cameras that were
    trigger::AnswerWatch watch;  ///< with a trigger
    std::array<SensorSettings, kMostBuffers> settings{};

    // ---- Handed over. Release where it is put, acquire where it is taken: the camera, and the four below
    std::atomic<Camera*> incoming{nullptr};
    std::atomic<Camera*> retired{nullptr};
    bool retired_was_heard = false;
    std::chrono::nanoseconds retired_silence{0};  ///< 0: it was lost

    // ---- Capture thread writes, any reads
    std::atomic<bool> silent{false};
    std::atomic<bool> astray{false};
    Counter frames;
    Counter damaged;
    Counter lost;
    Counter late;
    Counter losses;
    Counter missed;
    Counter doubled;
    Counter stray;
    Counter strayings;

    // ---- Service thread
    Camera* serves = nullptr;  ///< for its service part alone: `camera`, `incoming` or `retired`; null: there is none
    bool is_wanted = false;
    MonotonicTime next_try{};
    std::chrono::nanoseconds back_off{0};
    std::string last_refusal;
    Counter reopened;
    Counter open_failures;
    Counter back_off_ms;
  };

  struct Named {
    std::optional<std::uint32_t> left;
    std::optional<std::uint32_t> right;
  };

  [[nodiscard]] Eye& eye(Side side) noexcept { return eyes_[static_cast<std::size_t>(side)]; }
  [[nodiscard]] MonotonicTime now() const noexcept { return config_.now(); }
  [[nodiscard]] bool has_two() const noexcept { return config_.stereo && !config_.side_by_side; }

  // Capture thread.
  void requeue(PairOutlet& outlet) noexcept;
  void give_back(Side side, std::uint32_t buffer) noexcept;
  void give_back(Named& named) noexcept;
  void adopt(PairOutlet& outlet) noexcept;
  void retire() noexcept;
  void end(PairOutlet& outlet, Side side, std::chrono::nanoseconds silence) noexcept;
  void wait(MonotonicTime until) noexcept;
  [[nodiscard]] bool take_one(PairOutlet& outlet, Side side) noexcept;
  void arrived(PairOutlet& outlet, Side side, const SensorFrame& frame) noexcept;
  void settle(PairOutlet& outlet, const trigger::Pairer::Outcome& outcome) noexcept;
  void put(PairOutlet& outlet, const trigger::Settled& settled, bool both) noexcept;
  void look_for_silence(PairOutlet& outlet, MonotonicTime now) noexcept;
  void ask(Side side, MonotonicTime at) noexcept;
  void take_pulses(PairOutlet& outlet) noexcept;
  void look_for_pulses(PairOutlet& outlet, MonotonicTime now) noexcept;
  void look_for_answers(PairOutlet& outlet) noexcept;
  [[nodiscard]] bool answers(PairOutlet& outlet, Side side, CaptureTime mid_exposure, const SensorFrame& frame,
                             std::uint64_t& sequence) noexcept;
  void trust_pulses(PairOutlet& outlet, bool trust) noexcept;
  void call_astray(Side side) noexcept;
  void believe(PairOutlet& outlet, Side side) noexcept;
  [[nodiscard]] MonotonicTime last_answer() const noexcept;
  [[nodiscard]] bool both_count() const noexcept;
  void look_for_fits(MonotonicTime now) noexcept;
  [[nodiscard]] bool is_out(Side side) const noexcept;
  [[nodiscard]] bool is_astray(Side side) const noexcept;
  [[nodiscard]] bool goes_alone() const noexcept {
    return is_out(Side::kRight) || is_astray(Side::kRight) || unmatched_;
  }
  void tell(Change change, Side side, std::chrono::nanoseconds span = {}) noexcept;
  void count() noexcept;

  // Service thread.
  /// These may wait for the device. False: there was nothing to do.
  bool bury(Side side, std::vector<SourceNote>& notes);
  bool reopen(Side side, std::vector<SourceNote>& notes);
  void say(const Event& event, std::vector<SourceNote>& notes);
  void estimate_phase() noexcept;
  void steer(std::vector<SourceNote>& notes);
  void say_steering(std::vector<SourceNote>& notes);

  Open open_;
  Config config_;
  SourceInfo info_;
  std::string failure_;
  std::array<Eye, 2> eyes_;
  CameraInfo wanted_;  ///< what a camera has to deliver

  // Capture thread's.
  std::optional<trigger::Pairer> pairer_;
  std::unique_ptr<trigger::Trigger> trigger_;
  std::optional<trigger::PulseMatcher> matcher_;     ///< with a trigger
  MonotonicTime last_pulse_{};                       ///< when one was told
  bool pulses_trusted_ = false;                      ///< frames are numbered by them
  std::array<Named, FramePool::kMaxSlots> named_{};  ///< by slot
  std::optional<MonotonicTime> armed_;               ///< when the first frame of all came
  MonotonicTime last_pair_{};
  bool unmatched_ = false;
  bool unmatched_is_told_ = false;
  bool both_silent_ = false;
  std::size_t patience_ = 1;
  int false_alarms_ = 0;

  HandoverQueue<Event, 32> events_;
  HandoverQueue<Distance, 256> distances_;

  std::array<Counter, 9> pairing_;
  Counter mono_pairs_;
  Counter pulses_;
  std::atomic<bool> trigger_silent_{false};
  std::atomic<bool> trigger_unanswered_{false};

  // Service thread's.
  std::vector<SourceNote> first_notes_;
  PhaseEstimator phase_;
  RateSteering steering_;
  CaptureTime steered_by_{};  ///< the last second that steering_ knows
  RateSteering::State told_steering_ = RateSteering::State::kOff;
  std::atomic<Steering> steering_state_{Steering::kOff};
  std::atomic<std::int64_t> steered_period_ns_{kUnknown};
  std::atomic<std::int64_t> phase_ns_{kUnknown};
  std::atomic<std::int64_t> drift_ppb_{kUnknown};
  static constexpr std::int64_t kUnknown = INT64_MIN;
};

/// "640x480 yuyv".
[[nodiscard]] std::string delivery_text(const CameraInfo& info);
/// Why the two cannot make pairs, with the way out; empty: they can.
[[nodiscard]] std::string difference_of(const CameraInfo& info, const CameraInfo& other);
/// Why its picture cannot be split, with the way out; empty: it can, or is not to be.
[[nodiscard]] std::string split_refusal(const StereoCameras::Config& config, const CameraInfo& camera);
/// What a source of cameras like this one is.
[[nodiscard]] SourceInfo source_info(const StereoCameras::Config& config, const CameraInfo& camera);

}  // namespace stereotrack::capture
