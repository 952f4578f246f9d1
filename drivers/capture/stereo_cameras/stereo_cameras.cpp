#include "drivers/capture/stereo_cameras/stereo_cameras.hpp"

#include <poll.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <stdexcept>
#include <utility>

#include "drivers/capture/pixel_format_names.hpp"
#include "drivers/capture/side_by_side.hpp"

namespace stereotrack::capture {

namespace {

using trigger::Side;
using trigger::Verdict;

constexpr std::array<Side, 2> kSides{Side::kLeft, Side::kRight};
constexpr Side other(Side side) noexcept { return side == Side::kLeft ? Side::kRight : Side::kLeft; }
constexpr const char* name_of(Side side) noexcept { return side == Side::kLeft ? "left" : "right"; }

MonotonicTime read_monotonic() noexcept {
  timespec time{};
  (void)clock_gettime(CLOCK_MONOTONIC, &time);
  return MonotonicTime(std::chrono::seconds(time.tv_sec) + std::chrono::nanoseconds(time.tv_nsec));
}

timespec to_timespec(std::chrono::nanoseconds span) noexcept {
  const auto whole = std::chrono::floor<std::chrono::seconds>(span);
  return {static_cast<time_t>(whole.count()), static_cast<long>((span - whole).count())};
}

std::string seconds_text(std::chrono::nanoseconds span) {
  char text[32];
  (void)std::snprintf(text, sizeof text, "%.2f s", to_seconds(span));
  return text;
}

std::string off_text(std::chrono::nanoseconds off) {
  return std::to_string(std::chrono::abs(off).count() / 1000) + (off.count() < 0 ? " us before" : " us after") +
         " the nearest";
}

SourceNote astray_note(Side side, std::chrono::nanoseconds off, std::uint32_t frames, std::uint32_t unanswered) {
  const std::string of = std::to_string(frames);
  return {SourceNote::Weight::kError, "camera_astray", name_of(side),
          std::string(name_of(side)) + " camera: " +
              (unanswered == frames ? of + " frames, none answers a pulse"
                                    : std::to_string(unanswered) + " of " + of + " frames answer no pulse") +
              ", the last one began " + off_text(off) + ", and the " + name_of(other(side)) + " one's do; " +
              (side == Side::kRight ? "goes on in mono" : "outputs are predicted until it follows") +
              ": check the trigger's wire to it, and that it is set to expose on a pulse"};
}

void add(Counter& to, std::uint64_t before, std::uint64_t now) noexcept { to.set(before + now); }

}  // namespace

// ---- Main thread

std::string delivery_text(const CameraInfo& info) {
  return std::to_string(info.width) + 'x' + std::to_string(info.height) + ' ' + std::string(name_of(info.format));
}

SourceInfo source_info(const StereoCameras::Config& config, const CameraInfo& camera) {
  SourceInfo info;
  info.name = config.name;
  info.width = config.side_by_side ? camera.width / 2 : camera.width;
  info.height = camera.height;
  info.format = camera.format;
  info.stereo = config.stereo || config.side_by_side;
  info.has_time = true;
  info.period = config.period.count() > 0 ? config.period : camera.period;
  return info;
}

std::string split_refusal(const StereoCameras::Config& config, const CameraInfo& camera) {
  if (!config.side_by_side || splits_side_by_side(camera.format, camera.width, camera.height)) return {};
  return camera.name + ": " + delivery_text(camera) +
         " cannot be split into two views side by side: set camera.width to one whose half the format can have";
}

std::string difference_of(const CameraInfo& info, const CameraInfo& other) {
  if (info.width != other.width || info.height != other.height || info.format != other.format) {
    return info.name + " delivers " + delivery_text(info) + ", and " + other.name + " " + delivery_text(other) +
           ": want the same of both, set camera.width, camera.height and camera.format to what both can do";
  }
  if (info.buffers > StereoCameras::kMostBuffers) {
    return info.name + " has " + std::to_string(info.buffers) + " buffers: want " +
           std::to_string(StereoCameras::kMostBuffers) + " at most, lower camera.buffers";
  }
  return {};
}

StereoCameras::StereoCameras(Open open, const Config& config, std::unique_ptr<trigger::Trigger> trigger)
    : open_(std::move(open)), config_(config), trigger_(std::move(trigger)), phase_(std::chrono::seconds(1)) {
  if (config_.now == nullptr) config_.now = &read_monotonic;
  std::array<std::string, 2> failures;
  for (const Side side : kSides) {
    if (side == Side::kRight && !has_two()) continue;
    try {
      eye(side).camera = open_(side);
    } catch (const std::runtime_error& error) {
      failures[static_cast<std::size_t>(side)] = error.what();
    }
  }
  const Eye& left = eye(Side::kLeft);
  const Eye& right = eye(Side::kRight);
  if (!left.camera && !right.camera) throw std::runtime_error(failures[0]);
  wanted_ = left.camera ? left.camera->info() : right.camera->info();
  for (const Eye& each : eyes_) {
    if (!each.camera) continue;
    const std::string wrong = difference_of(each.camera->info(), wanted_);
    if (!wrong.empty()) throw std::runtime_error(wrong);
  }
  if (const std::string wrong = split_refusal(config_, wanted_); !wrong.empty()) throw std::runtime_error(wrong);
  info_ = source_info(config_, wanted_);
  if (info_.period.count() <= 0) {
    throw std::runtime_error(wanted_.name + ": does not say how many frames a second it delivers: set camera.fps");
  }
  for (const Side side : kSides) {
    Eye& each = eye(side);
    if (!each.camera) continue;
    each.buffers = each.camera->info().buffers;
    try {
      each.camera->start();
      each.serves = each.camera.get();
      each.joined = now();
    } catch (const std::runtime_error& error) {
      failures[static_cast<std::size_t>(side)] = error.what();
      each.camera.reset();
    }
  }
  if (!left.camera && !right.camera) throw std::runtime_error(failures[0]);
  config_.timeout = std::max(config_.timeout, kLeastTimeoutPeriods * info_.period);
  phase_ = PhaseEstimator(info_.period);
  const bool sequenced = wanted_.counts_lost && (!right.camera || right.camera->info().counts_lost);
  const auto pairer =
      trigger::Pairer::create({.period = info_.period, .tolerance = config_.tolerance, .sequenced = sequenced});
  if (!pairer.has_value()) throw std::runtime_error("camera.tolerance: want more than 0 and at most 0.5");
  pairer_ = *pairer;
  if (trigger_) {
    config_.triggered = true;
    const auto matcher = trigger::PulseMatcher::create(
        {.period = info_.period, .delay = config_.pulse_delay, .tolerance = std::min(config_.tolerance, 0.45)});
    if (!matcher.has_value()) throw std::runtime_error("the trigger's delay: want no less than 0");
    matcher_ = *matcher;
  }
  for (const Side side : kSides) {
    Eye& each = eye(side);
    if (side == Side::kRight && !has_two()) continue;
    each.back_off = config_.back_off_first;
    if (each.camera) continue;
    each.silent.store(true, std::memory_order_relaxed);
    each.losses.add();
    each.is_wanted = true;
    each.next_try = now() + each.back_off;
    each.last_refusal = failures[static_cast<std::size_t>(side)];
    first_notes_.push_back(
        {SourceNote::Weight::kWarning, "camera_missing", name_of(side),
         each.last_refusal + (side == Side::kRight ? "; goes on with the left camera alone, in mono, and tries again"
                                                   : "; no pair comes until the left camera does: tries again")});
  }
}

StereoCameras::~StereoCameras() {
  for (Eye& each : eyes_) {
    delete each.incoming.load(std::memory_order_acquire);
    delete each.retired.load(std::memory_order_acquire);
  }
}

// ---- Capture thread

void StereoCameras::tell(Change change, Side side, std::chrono::nanoseconds span) noexcept {
  (void)events_.push({change, side, span});  // a queue that is full counts
}

bool StereoCameras::is_out(Side side) const noexcept {
  const Eye& each = eyes_[static_cast<std::size_t>(side)];
  return !each.camera || each.ending || (each.late_comer && !each.heard);
}

void StereoCameras::give_back(Side side, std::uint32_t buffer) noexcept {
  Eye& each = eye(side);
  each.camera->give_back(buffer);
  --each.held;
}

void StereoCameras::give_back(Named& named) noexcept {
  if (named.left) give_back(Side::kLeft, *named.left);
  if (named.right) give_back(Side::kRight, *named.right);
  named = {};
}

void StereoCameras::requeue(PairOutlet& outlet) noexcept {
  std::uint32_t slot = 0;
  while (outlet.take_back(slot)) give_back(named_[slot]);
}

/// A camera that the service thread has opened.
void StereoCameras::adopt(PairOutlet& outlet) noexcept {
  for (const Side side : kSides) {
    Eye& each = eye(side);
    if (each.camera || each.incoming.load(std::memory_order_relaxed) == nullptr) continue;
    each.camera.reset(each.incoming.exchange(nullptr, std::memory_order_acquire));
    each.buffers = each.camera->info().buffers;
    each.ending = false;
    each.late_comer = true;
    each.heard.reset();
    each.joined = now();
    each.asked = each.last_asked = each.joined;
    settle(outlet, pairer_->restart());
    pairer_->set_sequenced(pulses_trusted_ || both_count());
    if (matcher_) matcher_->restart(side);
    each.watch = trigger::AnswerWatch();
    each.watch.begin(each.joined);
    if (trigger_unanswered_.load(std::memory_order_relaxed)) each.watch.go_astray();
    (void)distances_.push({CaptureTime(), {}, true});
    // What fits has to show first; until then left pictures go on alone.
    unmatched_ = true;
    patience_ = 1;
    last_pair_ = each.joined;
  }
}

/// The cameras that there are count what they lose.
bool StereoCameras::both_count() const noexcept {
  return std::all_of(eyes_.begin(), eyes_.end(),
                     [](const Eye& each) { return !each.camera || each.camera->info().counts_lost; });
}

void StereoCameras::trust_pulses(PairOutlet& outlet, bool trust) noexcept {
  if (trust == pulses_trusted_) return;
  pulses_trusted_ = trust;
  for (Eye& each : eyes_) {
    if (!each.watch.is_astray()) each.watch.begin(now());
  }
  // Numbers of pulses and of frames do not compare: what fits has to show anew.
  settle(outlet, pairer_->restart());
  last_pair_ = now();
  pairer_->set_sequenced(trust || both_count());
}

/// A frame is due from it: a pulse was told, or the other one has delivered.
void StereoCameras::ask(Side side, MonotonicTime at) noexcept {
  Eye& each = eye(side);
  if (at - each.last_asked > config_.timeout) each.asked = at;  // after a pause
  each.last_asked = at;
}

void StereoCameras::take_pulses(PairOutlet& outlet) noexcept {
  trigger::Trigger::Pulse pulse;
  while (trigger_ && trigger_->take(pulse)) {
    false_alarms_ = 0;
    last_pulse_ = now();
    for (const Side side : kSides) ask(side, last_pulse_);
    if (!armed_) armed_ = last_pair_ = last_pulse_;
    matcher_->pulse(pulse.number, CaptureTime(pulse.time.time_since_epoch()));
    pulses_.set(matcher_->pulses());
    if (!trigger_unanswered_.load(std::memory_order_relaxed)) trust_pulses(outlet, true);
    if (!trigger_silent_.load(std::memory_order_relaxed)) continue;
    trigger_silent_.store(false, std::memory_order_relaxed);
    tell(Change::kPulses, Side::kLeft);
  }
}

/// Frames come that nobody says to have asked for: better pairs by their times alone than none.
void StereoCameras::look_for_pulses(PairOutlet& outlet, MonotonicTime now) noexcept {
  if (!matcher_ || !armed_ || trigger_silent_.load(std::memory_order_relaxed)) return;
  const MonotonicTime since = std::max(last_pulse_, *armed_);
  const bool frames_come = std::any_of(
      eyes_.begin(), eyes_.end(), [&](const Eye& each) { return each.heard && *each.heard - since > config_.timeout; });
  if (!frames_come) return;
  trigger_silent_.store(true, std::memory_order_relaxed);
  for (Eye& each : eyes_) each.watch.begin(now);  // what none is told of nobody can answer
  trust_pulses(outlet, false);
  tell(Change::kNoPulses, Side::kLeft, now - since);
}

bool StereoCameras::is_astray(Side side) const noexcept {
  return pulses_trusted_ && eyes_[static_cast<std::size_t>(side)].watch.is_astray();
}

/// Of either camera.
MonotonicTime StereoCameras::last_answer() const noexcept {
  return std::max(eyes_[0].watch.last_answer(), eyes_[1].watch.last_answer());
}

void StereoCameras::call_astray(Side side) noexcept {
  Eye& each = eye(side);
  each.strayings.add();
  (void)events_.push({Change::kAstray, side, each.watch.off(), each.watch.frames(), each.watch.unanswered()});
  each.watch.go_astray();
}

/// Frames come and pulses, and those of both cameras, or of one, have nothing to do with them.
void StereoCameras::look_for_answers(PairOutlet& outlet) noexcept {
  if (!pulses_trusted_) return;
  const MonotonicTime last = last_answer();
  const auto strays = [&](const Eye& each, MonotonicTime since) {
    return each.camera && !each.ending && !each.watch.is_astray() && each.heard &&
           *each.heard - since > config_.timeout && each.watch.unanswered_in_row() >= trigger::AnswerWatch::kFewest;
  };
  const auto* neither = std::find_if(eyes_.begin(), eyes_.end(), [&](const Eye& each) { return strays(each, last); });
  if (neither != eyes_.end() && last_pulse_ - last > config_.timeout / 2) {
    trigger_unanswered_.store(true, std::memory_order_relaxed);
    tell(Change::kNoAnswers, Side::kLeft, neither->watch.off());
    for (Eye& each : eyes_) {
      if (each.camera && !each.ending) each.watch.go_astray();
    }
    trust_pulses(outlet, false);
    return;
  }
  if (!has_two() || is_out(Side::kLeft) || is_out(Side::kRight)) return;
  for (const Side side : kSides) {
    const Eye& each = eye(side);
    const trigger::AnswerWatch& partner = eye(other(side)).watch;
    if (each.watch.is_astray() || partner.is_astray()) continue;
    const MonotonicTime since = each.watch.last_answer();
    const bool none = strays(each, since) && partner.last_answer() - since > config_.timeout / 2;
    if (none || (each.watch.mostly_strays() && !partner.mostly_strays())) call_astray(side);
  }
}

/// It has answered often enough while it was astray.
void StereoCameras::believe(PairOutlet& outlet, Side side) noexcept {
  eye(side).watch.begin(now());
  if (!trigger_unanswered_.load(std::memory_order_relaxed)) {
    last_pair_ = now();
    tell(Change::kFollows, side);
    return;
  }
  // The other one is as far, but for its next frames, or is the one that does not follow.
  Eye& partner = eye(other(side));
  const bool has_to_show = partner.watch.frames() >= trigger::AnswerWatch::kFewest;
  if (partner.watch.half_convinces() || !has_to_show) partner.watch.begin(now());
  trigger_unanswered_.store(false, std::memory_order_relaxed);
  tell(Change::kAnswers, Side::kLeft);
  trust_pulses(outlet, true);
  if (is_astray(other(side))) call_astray(other(side));
}

/// Whether a frame may go to the pairer, and by which number: that of its pulse, while pulses are trusted.
bool StereoCameras::answers(PairOutlet& outlet, Side side, CaptureTime mid_exposure, const SensorFrame& frame,
                            std::uint64_t& sequence) noexcept {
  if (!matcher_ || !(pulses_trusted_ || trigger_unanswered_.load(std::memory_order_relaxed))) return true;
  const CaptureTime begin = mid_exposure - frame.settings.exposure.value_or(config_.exposure) / 2;
  const trigger::PulseMatcher::Found found = matcher_->frame(side, begin);
  const bool is_answer = found.kind == trigger::PulseMatcher::Kind::kAnswer;
  trigger::AnswerWatch& watch = eye(side).watch;
  watch.frame(found, now());
  if (watch.convinces()) believe(outlet, side);
  if (trigger_unanswered_.load(std::memory_order_relaxed)) return true;
  if (!is_answer || watch.is_astray()) return false;
  sequence = found.number;
  return true;
}

/// The camera is given up: nothing is taken from it any more. Its frames that wait for a partner are handed back.
void StereoCameras::end(PairOutlet& outlet, Side side, std::chrono::nanoseconds silence) noexcept {
  Eye& each = eye(side);
  each.ending = true;
  each.retired_was_heard = each.heard.has_value() || !each.late_comer;
  each.retired_silence = silence;
  each.silent.store(true, std::memory_order_relaxed);
  each.losses.add();
  each.watch.begin(now());
  settle(outlet, pairer_->restart());
}

/// Those that were given up go once no slot names their buffers: a lease may still be read.
void StereoCameras::retire() noexcept {
  for (Eye& each : eyes_) {
    if (!each.ending || !each.camera || each.held > 0) continue;
    const Camera::Counters counters = each.camera->counters();
    each.before.frames += counters.frames;
    each.before.damaged += counters.damaged;
    each.before.lost += counters.lost;
    each.before.late += counters.late;
    // The place is empty: another camera comes only after this one was fetched.
    each.retired.store(each.camera.release(), std::memory_order_release);
  }
}

void StereoCameras::wait(MonotonicTime until) noexcept {
  std::array<pollfd, 3> fds{};
  nfds_t count = 0;
  std::chrono::nanoseconds most = until - now();
  for (const Eye& each : eyes_) {
    if (!each.camera || each.ending) continue;
    fds[count++] = {each.camera->descriptor(), POLLIN, 0};
    // A driver without buffers has no frame to wake us with when the frame loop gives some back.
    if (each.held + 1 >= each.buffers) most = std::min(most, info_.period / 4);
  }
  if (trigger_ && trigger_->descriptor() >= 0) fds[count++] = {trigger_->descriptor(), POLLIN, 0};
  if (most.count() < 0) most = {};
  // A descriptor that is readable and has nothing must not take the core.
  if (false_alarms_ > 2) {
    const timespec pause = to_timespec(std::min(most, info_.period / 4));
    (void)clock_nanosleep(CLOCK_MONOTONIC, 0, &pause, nullptr);
    most = {};
  }
  const timespec span = to_timespec(most);
  const int ready = ppoll(fds.data(), count, &span, nullptr);
  false_alarms_ = ready > 0 ? false_alarms_ + 1 : 0;  // unless a frame comes
}

void StereoCameras::put(PairOutlet& outlet, const trigger::Settled& settled, bool both) noexcept {
  Eye& left = eye(Side::kLeft);
  Eye& right = eye(Side::kRight);
  Named named;
  FramePair pair;
  SensorSettings of_right;
  pair.ordinal = settled.ordinal;
  pair.capture_time = settled.left->mid_exposure;
  pair.left = left.camera->picture(settled.left->buffer);
  named.left = settled.left->buffer;
  if (both) {
    pair.skew = settled.skew();
    pair.right = right.camera->picture(settled.right->buffer);
    named.right = settled.right->buffer;
    of_right = right.settings[settled.right->buffer];
  } else if (config_.side_by_side) {
    const SideBySide views = split_side_by_side(pair.left);
    pair.left = views.left;
    pair.right = views.right;
    of_right = left.settings[settled.left->buffer];
  } else {
    if (settled.right) give_back(Side::kRight, settled.right->buffer);
    if (has_two()) mono_pairs_.add();
  }
  const PairOutlet::Put outcome = outlet.put(pair, left.settings[settled.left->buffer], of_right);
  if (!outcome.waits) {
    give_back(named);
    return;
  }
  give_back(named_[outcome.slot]);
  named_[outcome.slot] = named;
}

void StereoCameras::settle(PairOutlet& outlet, const trigger::Pairer::Outcome& outcome) noexcept {
  for (const trigger::Settled& settled : outcome) {
    if (settled.verdict == Verdict::kPaired) {
      if (unmatched_is_told_) tell(Change::kMatched, Side::kLeft);
      unmatched_ = unmatched_is_told_ = false;
      patience_ = 1;
      last_pair_ = now();
      put(outlet, settled, true);
      continue;
    }
    if (settled.verdict == Verdict::kLate && unmatched_) ++patience_;
    const bool alone = settled.left && settled.ordinal != 0 && goes_alone() && !is_out(Side::kLeft);
    if (alone) {
      put(outlet, settled, false);
      continue;
    }
    if (settled.left) give_back(Side::kLeft, settled.left->buffer);
    if (settled.right) give_back(Side::kRight, settled.right->buffer);
  }
}

void StereoCameras::arrived(PairOutlet& outlet, Side side, const SensorFrame& frame) noexcept {
  Eye& each = eye(side);
  const Eye& partner = eye(other(side));
  const MonotonicTime at = now();
  if (!armed_) armed_ = last_pair_ = at;
  if (!each.heard && each.late_comer) tell(Change::kHeard, side);
  // After a pause without triggers nothing can have fitted.
  if (each.heard && at - *each.heard > config_.timeout) last_pair_ = at;
  if (!each.heard && !each.watch.is_astray()) each.watch.begin(at);
  each.heard = at;
  each.asked = each.last_asked = at;
  ask(other(side), at);
  each.silent.store(false, std::memory_order_relaxed);
  each.settings[frame.buffer] = frame.settings;
  const CaptureTime time(each.camera->clock_map().to_monotonic(frame.mid_exposure).time_since_epoch());
  each.last = time;
  if (const std::chrono::nanoseconds ahead = time.time_since_epoch() - at.time_since_epoch();
      side == Side::kLeft && ahead.count() > 0 && !each.ahead_is_told) {
    each.ahead_is_told = true;
    tell(Change::kAhead, side, ahead);
  }
  if (side == Side::kRight && partner.heard && !is_out(Side::kLeft))
    (void)distances_.push({time, time - partner.last, false});

  std::uint64_t sequence = frame.sequence;
  if (!answers(outlet, side, time, frame, sequence)) {
    give_back(side, frame.buffer);
    return;
  }
  settle(outlet, pairer_->push(side, {time, sequence, frame.buffer}));
  if (is_out(other(side)) || is_astray(other(side))) {
    settle(outlet, pairer_->give_up_before(time + std::chrono::nanoseconds(1)));
    return;
  }
  // What waits keeps buffers from its driver, which needs two to go on: one that is written, one that comes next.
  const std::size_t spare = each.buffers > outlet.slots() + 2 ? each.buffers - outlet.slots() - 2 : 1;
  const std::size_t most = unmatched_ ? std::min(patience_, spare) : spare;
  if (pairer_->waiting() > most) {
    const auto old = std::chrono::nanoseconds(info_.period * static_cast<std::int64_t>(2 * most - 1)) / 2;
    settle(outlet, pairer_->give_up_before(time - old));
  }
}

/// False: nothing waits, or nothing ever will.
bool StereoCameras::take_one(PairOutlet& outlet, Side side) noexcept {
  Eye& each = eye(side);
  if (!each.camera || each.ending) return false;
  SensorFrame frame;
  switch (each.camera->take(frame)) {
    case Camera::Take::kNothing: return false;
    case Camera::Take::kLost: end(outlet, side, {}); return false;
    case Camera::Take::kFrame: break;
  }
  false_alarms_ = 0;
  ++each.held;
  if (frame.damaged || frame.buffer >= each.buffers) {
    give_back(side, frame.buffer);
  } else {
    arrived(outlet, side, frame);
  }
  return true;
}

void StereoCameras::look_for_silence(PairOutlet& outlet, MonotonicTime now) noexcept {
  if (!armed_) return;
  int quiet_ones = 0;
  int there = 0;
  std::chrono::nanoseconds longest{0};
  for (const Side side : kSides) {
    Eye& each = eye(side);
    if (!each.camera || each.ending) continue;
    ++there;
    const MonotonicTime since = each.heard ? *each.heard : std::max(each.joined, *armed_) + kStartUp;
    if (now - since <= config_.timeout) continue;
    ++quiet_ones;
    longest = std::max(longest, now - since);
    // Frames that the other one had meanwhile were triggered, as pulses say themselves; this one missed them. After a
    // pause the first of either says nothing: its own frame is on its way.
    const bool alone = each.last_asked - std::max(since, each.asked) > config_.timeout / 2;
    if (config_.triggered && !alone) {
      each.silent.store(true, std::memory_order_relaxed);
    } else {
      end(outlet, side, now - since);
    }
  }
  const bool both = config_.triggered && there > 0 && quiet_ones == there;
  if (both == both_silent_) return;
  both_silent_ = both;
  tell(both ? Change::kBothSilent : Change::kBothHeard, Side::kLeft, longest);
}

void StereoCameras::look_for_fits(MonotonicTime now) noexcept {
  const Eye& left = eye(Side::kLeft);
  const Eye& right = eye(Side::kRight);
  if (unmatched_is_told_ || is_out(Side::kLeft) || is_out(Side::kRight) || !left.heard || !right.heard) return;
  // While pulses are trusted, only what answers them can fit.
  const MonotonicTime left_had = pulses_trusted_ ? left.watch.last_answer() : *left.heard;
  const MonotonicTime right_had = pulses_trusted_ ? right.watch.last_answer() : *right.heard;
  if (std::min({left_had, right_had, now}) - last_pair_ <= config_.timeout) return;
  unmatched_ = unmatched_is_told_ = true;
  const std::chrono::nanoseconds apart = (right.last - left.last) % info_.period;
  const bool folds = std::chrono::abs(apart) > info_.period / 2;
  tell(Change::kUnmatched, Side::kLeft, folds ? apart - (apart.count() > 0 ? 1 : -1) * info_.period : apart);
}

void StereoCameras::count() noexcept {
  for (Eye& each : eyes_) {
    const Camera::Counters now = each.camera ? each.camera->counters() : Camera::Counters();
    add(each.frames, each.before.frames, now.frames);
    add(each.damaged, each.before.damaged, now.damaged);
    add(each.lost, each.before.lost, now.lost);
    add(each.late, each.before.late, now.late);
    if (!matcher_ || (&each != eyes_.data() && !has_two())) continue;  // nobody misses a camera that is not to be
    const trigger::PulseMatcher::Counters& exposures =
        matcher_->counters(&each == eyes_.data() ? Side::kLeft : Side::kRight);
    each.missed.set(exposures.missed);
    each.doubled.set(exposures.doubled);
    each.stray.set(exposures.stray);
    each.astray.store(each.watch.is_astray(), std::memory_order_relaxed);
  }
  const trigger::Pairer::Counters& c = pairer_->counters();
  const std::array<std::uint64_t, 9> pairing{c.paired,    c.missing_left, c.missing_right,
                                             c.late,      c.out_of_order, c.duplicate,
                                             c.disagreed, c.clock_steps,  c.waiting_high};
  for (std::size_t i = 0; i < pairing.size(); ++i) pairing_[i].set(pairing[i]);
}

LiveSource::Step StereoCameras::step(PairOutlet& outlet, MonotonicTime until) noexcept {
  requeue(outlet);
  retire();
  adopt(outlet);
  wait(until);
  requeue(outlet);
  take_pulses(outlet);  // before the frames that they asked for
  // In turns, so that neither side's frames pile up before the pairer.
  bool more = true;
  for (std::size_t round = 0; more && round < kMostBuffers; ++round) {
    const bool left = take_one(outlet, Side::kLeft);
    const bool right = take_one(outlet, Side::kRight);
    more = left || right;
  }
  const MonotonicTime at = now();
  look_for_silence(outlet, at);
  look_for_pulses(outlet, at);
  look_for_answers(outlet);
  look_for_fits(at);
  retire();
  count();
  return Step::kGoing;
}

// ---- Service thread

void StereoCameras::say(const Event& event, std::vector<SourceNote>& notes) {
  using Weight = SourceNote::Weight;
  switch (event.change) {
    case Change::kHeard: {
      Eye& each = eye(event.side);
      each.back_off = config_.back_off_first;
      each.back_off_ms.set(0);
      notes.push_back({Weight::kNotice, "camera_back", name_of(event.side),
                       std::string(name_of(event.side)) + " camera: is back and delivers frames"});
      break;
    }
    case Change::kAhead:
      notes.push_back(
          {Weight::kWarning, "camera_ahead", name_of(event.side),
           std::string(name_of(event.side)) + " camera: its frames bear times " +
               std::to_string(event.span.count() / 1000) +
               " us after they came, no result of theirs leaves on time: raise camera.readout_us by so much "
               "at least"});
      break;
    case Change::kBothSilent:
      notes.push_back({Weight::kWarning, "cameras_silent", "",
                       "cameras: no frame for " + seconds_text(event.span) + ": is the trigger alive?"});
      break;
    case Change::kBothHeard:
      notes.push_back({Weight::kNotice, "cameras_heard", "", "cameras: frames come again"});
      break;
    case Change::kUnmatched:
      notes.push_back({Weight::kWarning, "cameras_do_not_fit", "",
                       "cameras: no left and right picture fit for " + seconds_text(config_.timeout) +
                           ", the last ones were " + std::to_string(event.span.count() / 1000) +
                           " us apart; goes on with the left camera alone, in mono: synchronise them, or raise "
                           "camera.tolerance"});
      break;
    case Change::kNoPulses:
      notes.push_back({Weight::kWarning, "trigger_silent", "",
                       "trigger: frames come, and no pulse was told for " + seconds_text(event.span) +
                           ": pairs are formed without: check its line"});
      break;
    case Change::kPulses:
      notes.push_back({Weight::kNotice, "trigger_back", "", "trigger: pulses are told again"});
      break;
    case Change::kNoAnswers:
      notes.push_back({Weight::kWarning, "trigger_unanswered", "",
                       "trigger: no frame answers a pulse, the last one began " + off_text(event.span) +
                           ": pairs are formed without: do the cameras follow the trigger, and "
                           "are trigger.delay_us and trigger.edge theirs?"});
      break;
    case Change::kAnswers:
      notes.push_back({Weight::kNotice, "trigger_answered", "", "trigger: frames answer its pulses again"});
      break;
    case Change::kAstray: notes.push_back(astray_note(event.side, event.span, event.frames, event.unanswered)); break;
    case Change::kFollows:
      notes.push_back({Weight::kNotice, "camera_follows", name_of(event.side),
                       std::string(name_of(event.side)) + " camera: its frames answer pulses again"});
      break;
    case Change::kMatched:
      notes.push_back({Weight::kNotice, "cameras_fit", "", "cameras: left and right pictures fit again"});
      break;
  }
}

/// Destroys a camera that was given up, and says why it was.
bool StereoCameras::bury(Side side, std::vector<SourceNote>& notes) {
  Eye& each = eye(side);
  const std::unique_ptr<Camera> dead(each.retired.exchange(nullptr, std::memory_order_acquire));
  if (!dead) return false;
  each.serves = nullptr;
  phase_.restart();
  each.is_wanted = true;
  each.next_try = now() + each.back_off;
  each.back_off_ms.set(static_cast<std::uint64_t>(each.back_off.count() / 1'000'000));
  if (!each.retired_was_heard) return true;  // it had not come back: nothing has changed
  const bool silent = each.retired_silence.count() > 0;
  const std::string why = silent ? dead->info().name + ": no frame for " + seconds_text(each.retired_silence) +
                                       ": check its cable, supply and trigger"
                                 : dead->failure();
  notes.push_back({SourceNote::Weight::kError, silent ? "camera_silent" : "camera_lost", name_of(side),
                   std::string(name_of(side)) + " camera: " + why +
                       (side == Side::kRight ? "; goes on in mono and tries to open it again"
                                             : "; outputs are predicted until it is open again")});
  return true;
}

bool StereoCameras::reopen(Side side, std::vector<SourceNote>& notes) {
  Eye& each = eye(side);
  if (!each.is_wanted || now() < each.next_try) return false;
  std::string wrong;
  try {
    std::unique_ptr<Camera> camera = open_(side);
    const CameraInfo& info = camera->info();
    if (!difference_of(info, wanted_).empty()) {
      wrong = info.name + ": came back with " + delivery_text(info) + ", the pipeline was made for " +
              delivery_text(wanted_) + ": refused, plug in the camera that was there, or start anew";
    } else {
      camera->start();
      each.reopened.add();
      each.is_wanted = false;
      each.last_refusal.clear();
      each.serves = camera.get();
      each.incoming.store(camera.release(), std::memory_order_release);
    }
  } catch (const std::exception& error) {
    wrong = error.what();
  }
  // Kept until a frame comes: a camera that opens and stays silent is not opened without end.
  each.back_off = std::min(2 * each.back_off, config_.back_off_most);
  if (wrong.empty()) return true;
  each.open_failures.add();
  each.next_try = now() + each.back_off;
  each.back_off_ms.set(static_cast<std::uint64_t>(each.back_off.count() / 1'000'000));
  if (wrong == each.last_refusal) return true;
  each.last_refusal = wrong;
  notes.push_back({SourceNote::Weight::kWarning, "camera_open", name_of(side),
                   std::string(name_of(side)) + " camera: " + wrong + "; tries again"});
  return true;
}

void StereoCameras::estimate_phase() noexcept {
  Distance distance;
  while (distances_.pop(distance)) {
    if (distance.anew) {
      phase_.restart();
    } else {
      phase_.add(distance.time, distance.distance);
    }
  }
  const auto phase = phase_.phase();
  const auto drift = phase_.drift();
  phase_ns_.store(phase ? phase->count() : kUnknown, std::memory_order_relaxed);
  drift_ppb_.store(drift ? std::llround(*drift * 1e9) : kUnknown, std::memory_order_relaxed);
}

void StereoCameras::say_steering(std::vector<SourceNote>& notes) {
  using State = RateSteering::State;
  using Weight = SourceNote::Weight;
  const State state = steering_.state();
  if (state == told_steering_) return;
  const State before = std::exchange(told_steering_, state);
  const auto text = [](const char* format, double value) {
    char line[160];
    (void)std::snprintf(line, sizeof line, format, value);
    return std::string(line);
  };
  const double phase_ms = to_seconds(std::chrono::nanoseconds(phase_ns_.load(std::memory_order_relaxed))) * 1e3;
  switch (state) {
    case State::kOff:
    case State::kMeasuring: break;
    case State::kCannot: {
      std::string why = "its driver cannot set its rate while it streams";
      if (steering_.obstacle() == RateSteering::Obstacle::kNoRoom)
        why = "its rate is at the end of what its driver can set: change camera.fps by a hundredth";
      if (steering_.obstacle() == RateSteering::Obstacle::kCoarse)
        why = "its driver sets its rate in steps that are too large";
      notes.push_back({Weight::kNotice, "camera_not_steered", "right",
                       "right camera: its rate does not follow the left one's: " + why});
      break;
    }
    case State::kApproaching:
      if (before == State::kLocked) {
        notes.push_back({Weight::kWarning, "camera_off_rate", "right",
                         "right camera: is no longer together with the left one, its rate is steered anew"});
      } else {
        notes.push_back({Weight::kNotice, "camera_steered", "right",
                         text("right camera: its rate is made to follow the left one's, drift %.1f ppm",
                              steering_.natural() * 1e6) +
                             text(", phase %.2f ms", phase_ms)});
      }
      break;
    case State::kLocked:
      notes.push_back({Weight::kNotice, "camera_on_rate", "right",
                       text("right camera: its rate follows the left one's: phase %.2f ms", phase_ms)});
      break;
    case State::kGivenUp:
      notes.push_back({Weight::kWarning, "camera_not_steered", "right",
                       "right camera: does not do what its driver is asked for its rate, which stays as it was: "
                       "camera.steer = false, or a trigger"});
      break;
  }
}

/// The right camera's rate to the left one's.
void StereoCameras::steer(std::vector<SourceNote>& notes) {
  using State = RateSteering::State;
  if (!config_.steer || config_.triggered || !has_two()) return;
  Camera* const right = eye(Side::kRight).serves;
  const bool both = right != nullptr && eye(Side::kLeft).serves != nullptr;
  if (!both && steering_.state() != State::kOff) {
    // Nothing to follow: as it was opened.
    if (right != nullptr && steering_.period() != steering_.nominal()) (void)right->set_period(steering_.nominal());
    steering_.stop();
  }
  if (both && steering_.state() == State::kOff) {
    phase_.restart();
    steering_.begin(right->info().period, right->period_range());
  }
  const auto latest = phase_.latest();
  if (both && latest && latest->time != steered_by_) {
    steered_by_ = latest->time;
    steering_.measured(latest->time, latest->phase, phase_.drift());
    if (steering_.state() == State::kLocked && told_steering_ != State::kLocked) {
      phase_.restart();  // what it was on the way says nothing of what it is
      phase_ns_.store(latest->phase.count(), std::memory_order_relaxed);
    }
  }
  const bool hears = both && !eye(Side::kRight).silent.load(std::memory_order_relaxed);
  if (const auto wanted = hears ? steering_.next(now()) : std::nullopt) {
    if (const auto period = right->set_period(*wanted)) {
      steering_.made(now(), *period);
    } else {
      steering_.refused();
    }
  }
  say_steering(notes);
  steering_state_.store(steering_.state(), std::memory_order_relaxed);
  steered_period_ns_.store(steering_.state() >= State::kApproaching ? steering_.period().count() : kUnknown,
                           std::memory_order_relaxed);
}

void StereoCameras::tend(std::vector<SourceNote>& notes) {
  notes.insert(notes.end(), first_notes_.begin(), first_notes_.end());
  first_notes_.clear();
  Event event;
  while (events_.pop(event)) say(event, notes);
  estimate_phase();
  // A device that is slow keeps each of these for seconds: one a call, so that the caller comes to its signals, and to
  // its watchdog, between them.
  for (const Side side : kSides) {
    if (bury(side, notes) || reopen(side, notes)) break;
  }
  steer(notes);
  if (!trigger_) return;
  std::vector<trigger::Trigger::Note> of_trigger;
  trigger_->tend(now(), of_trigger);
  for (trigger::Trigger::Note& note : of_trigger) {
    notes.push_back({note.good ? SourceNote::Weight::kNotice : SourceNote::Weight::kWarning,
                     note.good ? "trigger_line_back" : "trigger_line", "", std::move(note.text)});
  }
}

SourceFigures StereoCameras::figures() const noexcept {
  SourceFigures out;
  out.of_cameras = true;
  for (std::size_t i = 0; i < eyes_.size(); ++i) {
    const Eye& each = eyes_[i];
    out.cameras[i] = {.silent = each.silent.load(std::memory_order_relaxed),
                      .frames = each.frames.get(),
                      .damaged = each.damaged.get(),
                      .lost = each.lost.get(),
                      .late = each.late.get(),
                      .losses = each.losses.get(),
                      .reopened = each.reopened.get(),
                      .open_failures = each.open_failures.get(),
                      .missed = each.missed.get(),
                      .doubled = each.doubled.get(),
                      .stray = each.stray.get(),
                      .astray = each.astray.load(std::memory_order_relaxed),
                      .strayings = each.strayings.get(),
                      .back_off_ms = each.back_off_ms.get()};
  }
  out.paired = pairing_[0].get();
  out.missing_left = pairing_[1].get();
  out.missing_right = pairing_[2].get();
  out.late = pairing_[3].get();
  out.out_of_order = pairing_[4].get();
  out.duplicate = pairing_[5].get();
  out.disagreed = pairing_[6].get();
  out.clock_steps = pairing_[7].get();
  out.waiting_high = pairing_[8].get();
  out.has_trigger = matcher_.has_value();
  out.trigger_silent = trigger_silent_.load(std::memory_order_relaxed);
  out.trigger_unanswered = trigger_unanswered_.load(std::memory_order_relaxed);
  out.pulses = pulses_.get();
  out.pulses_lost = trigger_ ? trigger_->lost() : 0;
  out.mono_pairs = mono_pairs_.get();
  out.notes_lost = events_.refused();
  const std::int64_t phase = phase_ns_.load(std::memory_order_relaxed);
  const std::int64_t drift = drift_ppb_.load(std::memory_order_relaxed);
  if (phase != kUnknown) out.phase = std::chrono::nanoseconds(phase);
  const std::int64_t period = steered_period_ns_.load(std::memory_order_relaxed);
  out.steering = steering_state_.load(std::memory_order_relaxed);
  if (period != kUnknown) out.steered_period = std::chrono::nanoseconds(period);
  if (drift != kUnknown) out.drift = static_cast<double>(drift) * 1e-9;
  return out;
}

}  // namespace stereotrack::capture
