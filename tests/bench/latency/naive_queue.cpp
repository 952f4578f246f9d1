#include "tests/bench/latency/naive_queue.hpp"

#include <array>
#include <cstdint>
#include <stdexcept>

#include "drivers/telemetry/encoder.hpp"
#include "drivers/telemetry/udp_sender.hpp"
#include "firmware-app/runtime/clock.hpp"
#include "pipeline/core/arena.hpp"
#include "pipeline/pipeline.hpp"
#include "pipeline/track/extrapolate.hpp"

namespace stereotrack::bench {

namespace {

struct CopiedPair {
  FramePair pair;
  std::vector<std::uint8_t> left;
  std::vector<std::uint8_t> right;
};

struct CopiedResult {
  std::uint64_t ordinal = 0;
  CaptureTime capture_time{};
  std::vector<TrackReport> tracks;
};

std::vector<std::uint8_t> copy_of(const Picture& picture) {
  const int rows = memory_rows(picture.format, picture.height);
  return {picture.data, picture.data + picture.stride_bytes * rows};
}

}  // namespace

void run_naive(const config::Configuration& configuration, const StereoCalibration& calibration, capture::Film& film,
               const std::vector<telemetry::Endpoint>& to, std::chrono::seconds duration) {
  const capture::SourceInfo& info = film.info();
  Arena arena;
  Result<Pipeline> pipeline = Pipeline::create(configuration.pipeline,
                                               {.width = info.width,
                                                .height = info.height,
                                                .colour = has_colour(info.format),
                                                .calibration = &calibration,
                                                .observer = {}},
                                               arena);
  if (!pipeline.has_value()) throw std::runtime_error("no pipeline");
  NaiveQueue<CopiedPair> pairs;
  NaiveQueue<CopiedResult> results;

  std::thread capturing([&] {
    capture::FramePool pool(2);
    capture::PairOutlet::Notices notices;
    capture::Doorbell bell;
    capture::PairOutlet outlet(pool, notices, bell);
    const MonotonicTime end = runtime::monotonic_now() + duration;
    while (runtime::monotonic_now() < end) {
      (void)film.step(outlet, end);
      capture::PairNotice notice;
      while (notices.pop(notice)) {
      }
      if (const capture::PairLease lease = pool.take_oldest()) {
        pairs.push({*lease, copy_of(lease->left), copy_of(lease->right)});
      }
    }
    pairs.close();
  });
  std::thread processing([&] {
    CopiedPair taken;
    while (pairs.pop(taken)) {
      taken.pair.left.data = taken.left.data();
      taken.pair.right.data = taken.right.data();
      const Result<FrameResult> result = pipeline->run(taken.pair);
      if (!result.has_value()) continue;
      results.push({result->ordinal, result->capture_time, {result->tracks.begin(), result->tracks.end()}});
    }
    results.close();
  });
  std::thread sending([&] {
    telemetry::UdpSender sender(to);
    telemetry::Encoder encoder({.rig = 1, .session = 1});
    std::vector<std::byte> buffer(telemetry::kMaxMessageBytes);
    const auto latency =
        std::chrono::nanoseconds(static_cast<std::int64_t>(configuration.latency.output_ms * 1e6 + 0.5));
    CopiedResult result;
    while (results.pop(result)) {
      const Extrapolation model{info.width, info.height};
      for (TrackReport& track : result.tracks) {
        extrapolate(model, to_seconds(latency), track);
      }
      telemetry::Message message;
      message.tracks = result.tracks;
      message.ordinal = result.ordinal;
      message.capture_time = result.capture_time;
      message.send_time = result.capture_time + latency;
      message.latency = latency;
      const auto parts = encoder.encode(message, std::span(buffer).first<telemetry::kMaxMessageBytes>());
      const auto due = std::chrono::steady_clock::time_point(message.send_time.time_since_epoch());
      std::this_thread::sleep_until(due);
      for (const auto part : parts) sender.send(part);
    }
  });
  capturing.join();
  processing.join();
  sending.join();
}

}  // namespace stereotrack::bench
