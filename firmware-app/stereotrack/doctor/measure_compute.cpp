#include <algorithm>
#include <atomic>
#include <cmath>
#include <memory>
#include <stdexcept>

#include "config/error.hpp"
#include "drivers/capture/doorbell.hpp"
#include "drivers/capture/synthetic/synthetic_source.hpp"
#include "firmware-app/rig/rig.hpp"
#include "firmware-app/runtime/clock.hpp"
#include "firmware-app/runtime/large_pages.hpp"
#include "firmware-app/stereotrack/doctor/measure.hpp"
#include "firmware-app/stereotrack/doctor/threads.hpp"

namespace stereotrack::doctor {

namespace {

using std::chrono::nanoseconds;

constexpr std::uint64_t kMostDrawn = 60;   ///< pairs; then to and fro
constexpr std::uint64_t kLeastDrawn = 12;  ///< however long it takes
constexpr std::uint64_t kWarmUpFrames = 10;
constexpr std::size_t kLeastFrames = 20;  ///< however slow they are
constexpr std::chrono::milliseconds kNap{1};
constexpr std::size_t kMostNaps = 4'000'000;

struct Drawn {
  std::vector<std::uint8_t> left;
  std::vector<std::uint8_t> right;
};

/// Close together, in the pixel format that is wanted: kBgr8, or kGrey8 by ITU-R BT.601.
std::vector<std::uint8_t> copy_of(const Picture& picture, bool colour) {
  std::vector<std::uint8_t> copy(
      picture_bytes(colour ? PixelFormat::kBgr8 : PixelFormat::kGrey8, picture.width, picture.height));
  auto* to = copy.data();
  for (int y = 0; y < picture.height; ++y) {
    const std::uint8_t* from = picture.row(y);
    if (colour) {
      to = std::copy_n(from, 3 * picture.width, to);
      continue;
    }
    for (int x = 0; x < picture.width; ++x, from += 3) {
      *to++ = static_cast<std::uint8_t>((29 * from[0] + 150 * from[1] + 77 * from[2]) >> 8);
    }
  }
  return copy;
}

/// Wakes up, as the publisher does, until it is told that the pipeline is done.
void sleep_and_wake(const std::atomic<bool>& done, std::vector<std::int64_t>& late_ns) {
  capture::Doorbell bell;
  MonotonicTime due = runtime::monotonic_now() + kNap;
  while (!done.load(std::memory_order_relaxed)) {
    (void)bell.wait(bell.rings(), due);
    const MonotonicTime woke = runtime::monotonic_now();
    if (late_ns.size() < late_ns.capacity()) late_ns.push_back((woke - due).count());
    due += kNap;
    while (due <= woke) due += kNap;
  }
}

/// A film of the scene, played to and fro into a pipeline.
class Player {
 public:
  Player(const config::Configuration& configuration, bool colour, nanoseconds time) {
    const config::CameraConfig& camera = configuration.camera;
    const bool is_camera = configuration.source.name == "cameras" || configuration.source.name.empty();
    const int width = is_camera ? camera.width / (camera.side_by_side ? 2 : 1) : configuration.synthetic.width;
    const int height = is_camera ? camera.height : configuration.synthetic.height;
    capture::SyntheticOptions options;
    options.frames = kMostDrawn;
    options.width = std::clamp(width, 64, 4096);
    options.height = std::clamp(height, 48, 3072);
    options.fps = std::clamp(is_camera ? camera.fps : configuration.source.fps, 1.0, 1000.0);
    told_.stereo = !is_camera || camera.side_by_side || !camera.right.device.empty();
    told_.width = options.width;
    told_.height = options.height;
    told_.colour = colour;
    info_.name = "synthetic:eleven";
    info_.width = options.width;
    info_.height = options.height;
    info_.format = colour ? PixelFormat::kBgr8 : PixelFormat::kGrey8;
    info_.stereo = told_.stereo;
    info_.period = nanoseconds(std::llround(1e9 / options.fps));
    told_.period_ms = static_cast<double>(info_.period.count()) * 1e-6;
    draw(*capture::open_synthetic("eleven", options), time);
    PipelineConfig everywhere = configuration.pipeline;
    everywhere.zones = {};  // they are places of another scene
    pipeline_ =
        std::make_unique<Pipeline>(make_pipeline(everywhere, told_.stereo ? &calibration_ : nullptr, info_, arena_));
    told_.memory_mb = static_cast<double>(arena_.bytes_used()) / (1 << 20);
    arena_.seal();
    compute_ns_.reserve(static_cast<std::size_t>(time / info_.period) + kLeastFrames + 64);
  }

  void play(nanoseconds time) {
    const MonotonicTime begin = runtime::monotonic_now();
    MonotonicTime due = begin;
    for (std::uint64_t n = 0; compute_ns_.size() < compute_ns_.capacity(); ++n) {
      const MonotonicTime now = runtime::monotonic_now();
      if (now - begin >= time && compute_ns_.size() >= kLeastFrames) break;
      if (due > now) runtime::sleep_until(due);
      const FramePair pair = pair_of(n);
      const MonotonicTime began = runtime::monotonic_now();
      const Result<FrameResult> result = pipeline_->run(pair);
      const nanoseconds took = runtime::monotonic_now() - began;
      if (!result.has_value()) {
        refused_ = result.error();
        return;
      }
      if (n >= kWarmUpFrames) compute_ns_.push_back(took.count());
      due += info_.period;
      while (due <= began) due += info_.period;  // the pairs that came meanwhile are passed over
    }
  }

  [[nodiscard]] PipelineMeasure told() && {
    told_.drawn = static_cast<int>(drawn_.size());
    told_.compute = tail_of(std::move(compute_ns_));
    if (refused_) told_.problem = std::string("the pipeline refuses a pair: ") + to_string(*refused_);
    return std::move(told_);
  }

 private:
  /// As many as there is time for.
  void draw(capture::SyntheticSource& scene, nanoseconds time) {
    calibration_ = scene.calibration();
    const MonotonicTime began = runtime::monotonic_now();
    FramePair pair;
    while (scene.next(pair) == capture::Next::kPair) {
      drawn_.push_back({copy_of(pair.left, told_.colour),
                        told_.stereo ? copy_of(pair.right, told_.colour) : std::vector<std::uint8_t>()});
      if (drawn_.size() >= kLeastDrawn && runtime::monotonic_now() - began > time) break;
    }
  }

  [[nodiscard]] Picture picture_of(const std::vector<std::uint8_t>& pixels) const {
    if (pixels.empty()) return {};
    return {pixels.data(), info_.width, info_.height, static_cast<std::ptrdiff_t>(row_bytes(info_.format, info_.width)),
            info_.format};
  }

  /// 0 1 2 3 2 1 0 1 ...
  [[nodiscard]] FramePair pair_of(std::uint64_t n) const {
    const std::uint64_t last = drawn_.size() - 1;
    const std::uint64_t round = last > 0 ? n % (2 * last) : 0;
    const Drawn& drawn = drawn_[static_cast<std::size_t>(round <= last ? round : 2 * last - round)];
    FramePair pair;
    pair.ordinal = n + 1;
    pair.capture_time = CaptureTime(info_.period * static_cast<std::int64_t>(n + 1));
    pair.left = picture_of(drawn.left);
    pair.right = picture_of(drawn.right);
    return pair;
  }

  PipelineMeasure told_;
  capture::SourceInfo info_;
  StereoCalibration calibration_;
  std::vector<Drawn> drawn_;
  Arena arena_{runtime::advise_large_pages};
  std::unique_ptr<Pipeline> pipeline_;
  std::vector<std::int64_t> compute_ns_;
  std::optional<Fault> refused_;
};

int priority_of(const runtime::Thread& thread, const config::ThreadConfig& wanted, const RealTime& realtime) {
  return realtime.mode != config::RealTimeMode::kOff && thread.missing().empty() ? wanted.priority : 0;
}

}  // namespace

ComputeMeasures measure_compute(const config::Configuration& configuration, bool colour, nanoseconds time) {
  ComputeMeasures measures;
  const RealTime& realtime = configuration.realtime;
  std::unique_ptr<Player> player;
  try {
    player = std::make_unique<Player>(configuration, colour, time);
  } catch (const std::runtime_error& error) {
    measures.pipeline.problem = error.what();
  }
  std::vector<std::int64_t> late_ns;
  late_ns.reserve(std::min(kMostNaps, static_cast<std::size_t>(10 * (time / kNap)) + 1024));
  std::atomic<bool> done{false};
  runtime::Thread sleeper(plan_of("st-publisher", realtime.publisher), mode_of(realtime),
                          [&] { sleep_and_wake(done, late_ns); });
  runtime::Thread frames(plan_of("st-frames", realtime.frames), mode_of(realtime), [&] {
    if (player) {
      player->play(time);
    } else {
      runtime::sleep_until(runtime::monotonic_now() + time);
    }
  });
  sleeper.begin();
  frames.begin();
  frames.join();
  done.store(true);
  sleeper.join();
  measures.wake_up.thread = "st-publisher";
  measures.wake_up.priority = priority_of(sleeper, realtime.publisher, realtime);
  measures.wake_up.beside_pipeline = player != nullptr;
  measures.wake_up.latency = tail_of(std::move(late_ns));
  if (player) measures.pipeline = std::move(*player).told();
  return measures;
}

}  // namespace stereotrack::doctor
