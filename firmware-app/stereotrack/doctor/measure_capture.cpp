#include <poll.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <memory>
#include <stdexcept>

#include "drivers/capture/stereo_cameras/phase.hpp"
#include "firmware-app/formatted.hpp"
#include "firmware-app/runtime/clock.hpp"
#include "firmware-app/stereotrack/doctor/measure.hpp"
#include "firmware-app/stereotrack/doctor/threads.hpp"

namespace stereotrack::doctor {

namespace {

using capture::Camera;
using std::chrono::nanoseconds;
using trigger::Side;

// The first frames of a stream come as the driver gets going.
constexpr std::uint64_t kWarmUpFrames = 3;
constexpr std::size_t kMostFrames = 1'000'000;

/// One camera while it streams. What is recorded has its room from the start: the thread takes no memory.
struct Eye {
  std::unique_ptr<Camera> camera;
  CaptureMeasure* told = nullptr;
  std::uint64_t taken = 0;
  std::vector<std::int64_t> jitter_ns;
  std::vector<std::int64_t> delay_ns;
  MonotonicTime last{};  ///< middle of the last exposure
  std::uint64_t last_sequence = 0;
  bool over = false;
};

double to_ms(nanoseconds span) { return static_cast<double>(span.count()) * 1e-6; }

void push(std::vector<std::int64_t>& to, std::int64_t value) {
  if (to.size() < to.capacity()) to.push_back(value);
}

/// Takes what waits; the distance of right frames to the left one before them goes to `phase`.
void take_all(Eye& eye, const Eye* left, capture::PhaseEstimator* phase) {
  capture::SensorFrame frame;
  for (;;) {
    const Camera::Take what = eye.camera->take(frame);
    if (what == Camera::Take::kNothing) return;
    if (what == Camera::Take::kLost) {
      eye.over = true;
      return;
    }
    const MonotonicTime arrived = runtime::monotonic_now();
    const MonotonicTime exposed = eye.camera->clock_map().to_monotonic(frame.mid_exposure);
    eye.camera->give_back(frame.buffer);
    if (frame.damaged) continue;
    if (eye.taken++ >= kWarmUpFrames) {
      push(eye.delay_ns, (arrived - exposed).count());
      if (frame.sequence == eye.last_sequence + 1) {
        push(eye.jitter_ns, std::abs(((exposed - eye.last) - eye.camera->info().period).count()));
      }
      if (phase != nullptr && left != nullptr && left->taken > kWarmUpFrames) {
        phase->add(CaptureTime(exposed.time_since_epoch()), exposed - left->last);
      }
    }
    eye.last = exposed;
    eye.last_sequence = frame.sequence;
  }
}

void stream(std::vector<Eye>& eyes, capture::PhaseEstimator* phase, MonotonicTime end) {
  for (MonotonicTime now = runtime::monotonic_now(); now < end; now = runtime::monotonic_now()) {
    std::array<pollfd, 2> fds{};
    nfds_t count = 0;
    for (const Eye& eye : eyes) {
      if (!eye.over) fds[count++] = {eye.camera->descriptor(), POLLIN, 0};
    }
    if (count == 0) return;
    const nanoseconds left = std::min<nanoseconds>(end - now, std::chrono::milliseconds(100));
    const timespec span{0, static_cast<long>(left.count())};
    (void)ppoll(fds.data(), count, &span, nullptr);
    for (Eye& eye : eyes) {
      const bool is_right = &eye != &eyes.front();
      if (!eye.over) take_all(eye, is_right ? &eyes.front() : nullptr, is_right ? phase : nullptr);
    }
  }
}

std::string no_frame(const CaptureMeasure& measure, nanoseconds time) {
  return "camera " + measure.name +
         formatted(": no frame came in %.3g s", std::chrono::duration<double>(time).count()) +
         ": does it wait for a trigger (then give it one, or switch its trigger mode off), is its cable in?";
}

}  // namespace

CaptureMeasures measure_capture(const capture::StereoCameras::Open& open, bool stereo, const RealTime& realtime,
                                nanoseconds time) {
  CaptureMeasures measures;
  measures.cameras.resize(stereo ? 2 : 1);
  std::vector<Eye> eyes;
  // All are opened before the first starts, as the daemon does: they may share a bus.
  for (std::size_t i = 0; i < measures.cameras.size(); ++i) {
    CaptureMeasure& told = measures.cameras[i];
    told.side = i == 0 ? "left" : "right";
    try {
      Eye eye;
      eye.camera = open(i == 0 ? Side::kLeft : Side::kRight);
      const capture::CameraInfo& info = eye.camera->info();
      told.name = info.name;
      told.delivers = capture::delivery_text(info);
      told.colour = has_colour(info.format);
      told.period_ms = to_ms(info.period);
      if (info.readout) told.readout_us = to_ms(*info.readout) * 1e3;
      told.readout_is_guessed = info.readout_is_guessed;
      const double frames = info.period.count() > 0 ? 2.0 * (time / std::chrono::duration<double>(info.period)) : 0;
      const auto room = static_cast<std::size_t>(std::min(frames + 64, static_cast<double>(kMostFrames)));
      eye.jitter_ns.reserve(room);
      eye.delay_ns.reserve(room);
      eye.told = &told;
      eyes.push_back(std::move(eye));
    } catch (const std::runtime_error& error) {
      told.failure = error.what();
    }
  }
  for (auto eye = eyes.begin(); eye != eyes.end();) {
    try {
      eye->camera->start();
      ++eye;
    } catch (const std::runtime_error& error) {
      eye->told->failure = error.what();
      eye = eyes.erase(eye);
    }
  }
  if (eyes.empty()) return measures;

  std::optional<capture::PhaseEstimator> phase;
  if (eyes.size() == 2 && eyes[0].camera->info().period.count() > 0) phase.emplace(eyes[0].camera->info().period);
  {
    runtime::Thread thread(plan_of("st-capture", realtime.capture), mode_of(realtime),
                           [&] { stream(eyes, phase ? &*phase : nullptr, runtime::monotonic_now() + time); });
    thread.begin();
    thread.join();
  }
  for (Eye& eye : eyes) {
    CaptureMeasure& told = *eye.told;
    const Camera::Counters counters = eye.camera->counters();
    told.frames = eye.taken;
    told.damaged = counters.damaged;
    told.lost = counters.lost;
    told.late = counters.late;
    if (!eye.delay_ns.empty()) {
      told.delay_min_us = static_cast<double>(*std::min_element(eye.delay_ns.begin(), eye.delay_ns.end())) * 1e-3;
    }
    told.jitter = tail_of(std::move(eye.jitter_ns));
    told.delay = tail_of(std::move(eye.delay_ns));
    if (eye.over) {
      told.failure = eye.camera->failure();
    } else if (eye.taken == 0) {
      told.failure = no_frame(told, time);
    }
  }
  if (phase && phase->phase()) {
    PairMeasure& pair = measures.pair.emplace();
    pair.phase_ms = to_ms(*phase->phase());
    if (phase->drift()) pair.drift_ppm = *phase->drift() * 1e6;
  }
  return measures;
}

}  // namespace stereotrack::doctor
