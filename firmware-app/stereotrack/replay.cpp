#include "firmware-app/stereotrack/replay.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <deque>
#include <filesystem>
#include <memory>
#include <opencv2/imgcodecs.hpp>
#include <ostream>
#include <stdexcept>
#include <thread>

#include "config/milliseconds.hpp"
#include "config/schema.hpp"
#include "config/zones.hpp"
#include "drivers/record/output_note.hpp"
#include "drivers/telemetry/authentication.hpp"
#include "drivers/telemetry/encoder.hpp"
#include "drivers/telemetry/file_sink.hpp"
#include "drivers/telemetry/frame_flags.hpp"
#include "drivers/telemetry/udp_sender.hpp"
#include "firmware-app/render/renderer.hpp"
#include "firmware-app/runtime/allocation_count.hpp"
#include "firmware-app/runtime/large_pages.hpp"
#include "firmware-app/runtime/output_schedule.hpp"
#include "firmware-app/stereotrack/interrupt.hpp"
#include "firmware-app/stereotrack/output_file.hpp"
#include "firmware-app/stereotrack/progress.hpp"
#include "firmware-app/stereotrack/summary.hpp"
#include "firmware-app/stereotrack/tracks_file.hpp"
#include "firmware-app/stereotrack/truth_file.hpp"
#include "pipeline/track/extrapolate.hpp"

namespace stereotrack {

namespace fs = std::filesystem;

namespace {

// Frames until caches and first pages are warm; heap calls count from then on.
constexpr std::uint64_t kWarmUpFrames = 10;
constexpr std::size_t kMostReasons = 100;
// Identities of a replay: fixed, so that the same file gives the same bytes.
constexpr std::uint64_t kReplaySession = 1;

// Holds each pair back until its capture time plus the latency has come, counted from the first pair.
class Pacer {
 public:
  // True if the moment was already over: a missed deadline.
  bool wait(CaptureTime send_time) {
    const auto now = std::chrono::steady_clock::now();
    if (!started_) {
      started_ = true;
      origin_ = now;
      first_ = send_time;
    }
    const auto due = origin_ + (send_time - first_);
    if (now > due) return true;
    std::this_thread::sleep_until(due);
    return false;
  }

 private:
  bool started_ = false;
  std::chrono::steady_clock::time_point origin_;
  CaptureTime first_;
};

// Where telemetry goes. Throws telemetry::EndpointError.
std::vector<telemetry::Endpoint> destinations_of(const config::Configuration& configuration) {
  std::vector<telemetry::Endpoint> destinations = telemetry::parse_endpoints(configuration.telemetry.destinations);
  if (destinations.empty()) {
    std::string loopback = "127.0.0.1:";
    loopback += std::to_string(telemetry::kDefaultPort);
    destinations.push_back(telemetry::parse_endpoint(loopback));
  }
  return destinations;
}

// Who the telemetry says it is: the run that an exact recording is of, message for message.
telemetry::Encoder::Config identity_of(const Rig& rig) {
  telemetry::Encoder::Config config{.rig = rig.configuration().telemetry.rig_id, .session = kReplaySession};
  if (rig.recording == nullptr || !rig.recording->about().exact) return config;
  config.rig = rig.recording->about().rig;
  config.session = rig.recording->about().session;
  const std::span<const record::OutputNote> outputs = rig.recording->outputs();
  if (!outputs.empty() && outputs.front().sequence > 0) config.sequence = outputs.front().sequence - 1;
  return config;
}

std::unique_ptr<Explanation> make_explanation(const std::optional<ExplainRequest>& request, const Rig& rig) {
  if (!request) return nullptr;
  return std::make_unique<Explanation>(*request, rig.configuration().pipeline, rig.unit_m);
}

render::ShownZone::Use use_of(const config::ZoneConfig& zone, const std::string& volume) {
  switch (zone.targets) {
    case config::ZoneTargets::kAll: break;
    case config::ZoneTargets::kNoneBegin: return render::ShownZone::Use::kNoneBegin;
    case config::ZoneTargets::kIgnore: return render::ShownZone::Use::kIgnored;
  }
  return zone.name == volume ? render::ShownZone::Use::kVolume : render::ShownZone::Use::kSignals;
}

std::vector<render::ShownZone> shown_zones(const config::Configuration& configuration) {
  std::vector<render::ShownZone> shown;
  for (const config::ZoneConfig& zone : configuration.zones) {
    shown.push_back({zone.name, config::zone_of(zone), use_of(zone, configuration.objects.volume), {}});
  }
  return shown;
}

// Everything that one replay carries from frame to frame.
class Replay {
 public:
  Replay(const ReplayArguments& arguments, const Interrupts& interrupts, std::ostream& out, std::ostream& messages)
      : arguments_(arguments),
        interrupts_(interrupts),
        out_(out),
        messages_(messages),
        rig_(open_rig(arguments.rig)),
        explanation_(make_explanation(arguments.explain, rig_)),
        pipeline_(make_pipeline(rig_, rig_.source->info(), arena_, times_.observer(),
                                explanation_ ? explanation_->observer() : DecisionObserver{})),
        encoder_(identity_of(rig_)) {
    arena_.seal();
    if (arguments.out) {
      make_output_folder(*arguments.out);
      file_ = std::make_unique<telemetry::FileSink>(fs::path(*arguments.out) / "telemetry.bin");
    }
    if (arguments.out && arguments.explain) {
      explanations_ = std::make_unique<OutputFile>(fs::path(*arguments.out) / "explain.txt");
    }
    if (arguments.real_time) {
      udp_ = std::make_unique<telemetry::UdpSender>(
          destinations_of(rig_.configuration()),
          telemetry::UdpSender::Config{.multicast_hops = rig_.configuration().telemetry.multicast_ttl});
    }
    if (arguments.render) {
      renderer_ = render::make_renderer(*arguments.render, rig_.source->info(), pipeline_.rectifier(), rig_.unit_m,
                                        shown_zones(rig_.configuration()));
    }
    summary_.source = arguments.rig.source;
    summary_.memory_bytes = arena_.bytes_used();
    summary_.configuration = config::to_text(rig_.configuration());
  }

  // False if it was interrupted.
  bool run() {
    const capture::SourceInfo& info = rig_.source->info();
    if (!has_colour(info.format)) messages_ << info.name << ": grey source, the chroma tests are skipped\n";
    if (!info.stereo) messages_ << info.name << ": mono source, 2-D tracks without distance\n";
    if (arguments_.frames.first > 1) rig_.source->skip_to(arguments_.frames.first - 1);
    if (rig_.recording != nullptr) begin_recording(*rig_.recording);
    std::optional<std::uint64_t> expected;
    if (info.pairs)
      expected = std::min(*info.pairs, arguments_.frames.last) - std::min(*info.pairs, arguments_.frames.first - 1);
    Progress progress(messages_, expected);
    FramePair pair;
    while (!interrupts_.asked()) {
      const capture::Next next = rig_.source->next(pair);
      if (next == capture::Next::kEnd || pair.ordinal > arguments_.frames.last) break;
      if (next == capture::Next::kSkipped) {
        skip(progress);
      } else {
        process(pair);
      }
      if (arguments_.rig.truth) truth_.add(pair.ordinal, *rig_.scene);
      progress.step();
    }
    progress.finish();
    return !interrupts_.asked();
  }

  void save() {
    if (summary_.frames == 0) {
      throw std::runtime_error(rig_.source->info().name + ": no pair could be read in the frames asked for (" +
                               std::to_string(summary_.skipped) + " skipped)");
    }
    if (explanation_ && !explained_) messages_ << "--explain: " << missing_explanation() << '\n';
    if (renderer_) renderer_->commit();
    summary_.tracks = tracks_.tracks();
    summary_.rows = tracks_.rows();
    summary_.pixels_hash = pixels_.hex();
    summary_.telemetry_hash = payloads_.hex();
    if (udp_) {
      summary_.telemetry_dropped = udp_->counters().dropped;
      summary_.telemetry_failed = udp_->counters().failed;
    }
    if (arguments_.rig.truth) truth_.save(*arguments_.rig.truth);
    if (!arguments_.out) return;
    const fs::path folder = *arguments_.out;
    try {
      tracks_.save(folder / "tracks.csv");
      if (!file_->commit()) throw std::runtime_error(file_->status());
      if (explanations_) explanations_->commit();
      save_summary(folder / "summary.json", summary_, &times_);
    } catch (const std::runtime_error&) {
      // All or none: some of them beside those of an earlier run would look like one run's.
      std::error_code ignored;
      for (const char* name : {"tracks.csv", "telemetry.bin", "explain.txt", "summary.json"})
        fs::remove(folder / name, ignored);
      throw;
    }
  }

  void print(std::ostream& out) const {
    char line[256];
    const auto whole = times_.whole();
    (void)std::snprintf(
        line, sizeof line,
        "%llu pairs, %llu skipped, %llu tracks, %llu rows; pipeline p50 %.2f ms, p99 %.2f ms, max %.2f ms\n",
        static_cast<unsigned long long>(summary_.frames), static_cast<unsigned long long>(summary_.skipped),
        static_cast<unsigned long long>(tracks_.tracks()), static_cast<unsigned long long>(tracks_.rows()), whole.p50,
        whole.p99, whole.max);
    out << line;
    out << "rejected candidates:";
    for (std::size_t i = 0; i < kRejections; ++i) {
      out << ' ' << to_string(static_cast<Rejection>(i)) << ' ' << summary_.rejections[i];
    }
    out << '\n';
    if (arguments_.out) out << "written: " << *arguments_.out << "/tracks.csv summary.json telemetry.bin\n";
    if (arguments_.render) out << "rendered: " << *arguments_.render << '\n';
  }

 private:
  [[nodiscard]] std::string missing_explanation() const {
    if (arguments_.explain->id == 0) return "none of these frames was replayed";
    return "no target had the id " + std::to_string(arguments_.explain->id) + "; ids stand in tracks.csv and --render";
  }

  // A recording's pairs go on from the state in which its run was, and with the decisions that were made.
  void begin_recording(const record::RecordingSource& recording) {
    if (!recording.warning().empty()) messages_ << recording.warning() << '\n';
    if (recording.keyframe().empty()) {
      messages_ << recording.info().name << ": tracks begin anew: "
                << (recording.about().exact ? "frames were left out\n" : "it was reduced, or holds no keyframe\n");
    } else if (!pipeline_.restore_state(recording.keyframe())) {
      messages_ << recording.info().name
                << ": tracks begin anew: its keyframe is of another configuration or version; replay without --config "
                   "and --set to go on from it\n";
    }
  }

  void skip(Progress& progress) {
    ++summary_.skipped;
    skipped_before_ = true;
    if (summary_.skip_reasons.size() < kMostReasons) summary_.skip_reasons.push_back(rig_.source->skip_reason());
    progress.message("skipped: " + rig_.source->skip_reason());
  }

  void process(const FramePair& pair) {
    pixels_.add(pair.left);
    if (!pair.right.empty()) pixels_.add(pair.right);
    times_.frame_begins();
    if (explanation_) explanation_->frame_begins();
    const std::uint64_t before = allocations_of_this_thread();
    const EffortBits leave_out = rig_.recording != nullptr ? rig_.recording->decisions().shed : EffortBits{0};
    const Result<FrameResult> result = pipeline_.run(pair, leave_out);
    if (!result.has_value()) {
      throw std::runtime_error(rig_.source->info().name + ": pair " + std::to_string(pair.ordinal) + ": " +
                               to_string(result.error()));
    }
    if (summary_.frames >= kWarmUpFrames) summary_.allocations_after_warmup += allocations_of_this_thread() - before;
    ++summary_.frames;
    if (pair.skew) {
      summary_.pair_skews_us.push_back(std::abs(std::chrono::duration<double, std::micro>(*pair.skew).count()));
    }
    summary_.flags |= result->flags;
    summary_.wrong_pairs += (result->flags & kFlagWrongPair) != 0 ? 1 : 0;
    for (std::size_t i = 0; i < kRejections; ++i) summary_.rejections[i] += result->rejections[i];
    summary_.hulls_reduced = result->hulls_reduced;
    tracks_.add(pair.ordinal, result->tracks);
    publish(pair, *result);
    const render::Annotation* said = explanation_ ? &explain(*result) : nullptr;
    if (renderer_) renderer_->draw(pair, *result, said);
    skipped_before_ = false;
  }

  const render::Annotation& explain(const FrameResult& result) {
    if (!first_time_) first_time_ = result.capture_time;
    const render::Annotation& said =
        explanation_->frame_ends(result, seconds_between(*first_time_, result.capture_time));
    for (const std::string& line : said.lines) {
      if (explanations_) {
        explanations_->write(line + "\n");
      } else {
        out_ << line << '\n';
      }
      explained_ = true;
    }
    return said;
  }

  void publish(const FramePair& pair, const FrameResult& result) {
    if (rig_.recording != nullptr && !rig_.recording->outputs().empty()) {
      publish_as_recorded(*rig_.recording, pair, result);
      return;
    }
    const auto latency = config::from_ms(rig_.configuration().latency.output_ms);
    telemetry::Message message;
    message.tracks = result.tracks;
    message.ordinal = pair.ordinal;
    message.capture_time = pair.capture_time;
    message.send_time = pair.capture_time + latency;
    message.latency = latency;
    message.flags = telemetry::flags_of_frame(result.flags);
    if (skipped_before_) message.flags |= telemetry::kFramesSkippedBefore;
    message.frames_skipped = static_cast<std::uint32_t>(summary_.skipped);
    send(message);
  }

  // What left in the run with the states up to this pair's, as the run's publisher predicted them.
  void publish_as_recorded(const record::RecordingSource& recording, const FramePair& pair, const FrameResult& result) {
    states_.push_back({pair.ordinal, {result.tracks.begin(), result.tracks.end()}});
    if (states_.size() > kMostStates) states_.pop_front();
    const capture::SourceInfo& info = recording.info();
    const Extrapolation model{info.width, info.height};
    const std::span<const record::OutputNote> outputs = recording.outputs();
    for (; next_output_ < outputs.size() && outputs[next_output_].state_ordinal <= pair.ordinal; ++next_output_) {
      const record::OutputNote& note = outputs[next_output_];
      const auto state = std::find_if(states_.begin(), states_.end(),
                                      [&](const State& one) { return one.ordinal == note.state_ordinal; });
      if (state == states_.end() && note.state_ordinal != 0) continue;  // its pair was left out of the replay
      std::vector<TrackReport> tracks;
      if (state != states_.end()) tracks = state->tracks;
      for (TrackReport& track : tracks) {
        extrapolate(model, to_seconds(std::chrono::nanoseconds(note.ahead_ns)), track);
        if (note.kind != static_cast<std::uint32_t>(runtime::OutputSchedule::Kind::kOnTime)) coast(track);
      }
      telemetry::Message message = record::message_of(note);
      message.tracks = tracks;
      encoder_.go_on_after(note.sequence - 1);  // a message may not have been recorded
      send(message);
    }
  }

  void send(telemetry::Message& message) {
    message.unit_m = rig_.unit_m;
    if (rig_.calibration) {
      message.focal_x_px = rig_.calibration->left.fx;
      message.focal_y_px = rig_.calibration->left.fy;
    }
    if (arguments_.real_time && pacer_.wait(message.send_time)) {
      ++summary_.deadline_misses;
      message.flags |= telemetry::kLate;
    }
    for (const std::span<const std::byte> datagram : encoder_.encode(message, buffer_)) {
      payloads_.add(telemetry::payload_of(datagram));
      ++summary_.telemetry_sent;
      if (file_) file_->send(datagram);
      if (udp_) udp_->send(datagram);
    }
  }

  const ReplayArguments& arguments_;
  const Interrupts& interrupts_;
  std::ostream& out_;
  std::ostream& messages_;
  Rig rig_;
  StageTimes times_;
  std::unique_ptr<Explanation> explanation_;
  std::unique_ptr<OutputFile> explanations_;
  std::optional<CaptureTime> first_time_;
  Arena arena_{runtime::advise_large_pages};
  Pipeline pipeline_;
  telemetry::Encoder encoder_;
  std::array<std::byte, telemetry::kMaxMessageBytes> buffer_{};
  std::unique_ptr<telemetry::FileSink> file_;
  std::unique_ptr<telemetry::UdpSender> udp_;
  std::unique_ptr<render::Renderer> renderer_;
  Pacer pacer_;
  Digest pixels_;
  Digest payloads_;
  TracksFile tracks_;
  TruthFile truth_;
  Summary summary_;
  bool skipped_before_ = false;
  bool explained_ = false;

  // Of a recording: states that messages may yet leave with, and how far they have left.
  struct State {
    std::uint64_t ordinal = 0;
    std::vector<TrackReport> tracks;
  };
  static constexpr std::size_t kMostStates = 64;
  std::deque<State> states_;
  std::size_t next_output_ = 0;
};

}  // namespace

int run_replay(const ReplayArguments& arguments, std::ostream& out, std::ostream& messages) {
  // First of all: no file may be open yet when ctrl-C would still end the program at once.
  const Interrupts interrupts;
  Replay replay(arguments, interrupts, out, messages);
  if (!replay.run()) {
    throw std::runtime_error(arguments.rig.source + ": interrupted; nothing was written");
  }
  replay.save();
  replay.print(out);
  return 0;
}

int check_replay(const ReplayArguments& arguments, std::ostream& out) {
  const Rig rig = open_rig(arguments.rig);
  (void)destinations_of(rig.configuration());
  Arena arena;
  const Pipeline pipeline = make_pipeline(rig, rig.source->info(), arena);
  const capture::SourceInfo& info = rig.source->info();
  out << info.name << ": " << info.width << 'x' << info.height << ' ' << (has_colour(info.format) ? "colour" : "grey")
      << ' ' << (info.stereo ? "stereo" : "mono") << ", preset " << rig.configuration().preset
      << ": configuration, calibration and source are fine\n";
  print_memory(out, pipeline.memory());
  out << "the arena took " << arena.capacity() << " bytes from the system and takes no more\n";
  return 0;
}

int run_masks(const MasksArguments& arguments, std::ostream& messages) {
  const Rig rig = open_rig(arguments.rig);
  Arena arena;
  Pipeline pipeline = make_pipeline(rig, rig.source->info(), arena);
  make_output_folder(arguments.out);
  const Interrupts interrupts;
  const capture::SourceInfo& info = rig.source->info();
  if (arguments.frames.first > 1) rig.source->skip_to(arguments.frames.first - 1);
  Progress progress(messages, info.pairs);
  FramePair pair;
  while (!interrupts.asked()) {
    const capture::Next next = rig.source->next(pair);
    if (next == capture::Next::kEnd || pair.ordinal > arguments.frames.last) break;
    cv::Mat picture = cv::Mat::zeros(info.height, info.width, CV_8UC1);
    if (next == capture::Next::kSkipped) {
      progress.message("skipped, mask left empty: " + rig.source->skip_reason());
    } else {
      const Result<FrameResult> result = pipeline.run(pair);
      if (!result.has_value()) {
        throw std::runtime_error(info.name + ": pair " + std::to_string(pair.ordinal) + ": " +
                                 to_string(result.error()));
      }
      for (int y = 0; y < info.height; ++y) std::copy_n(result->mask.row(y), info.width, picture.ptr(y));
    }
    char name[32];
    (void)std::snprintf(name, sizeof name, "%06llu.png", static_cast<unsigned long long>(pair.ordinal));
    std::vector<std::uint8_t> bytes;
    (void)cv::imencode(".png", picture, bytes);
    OutputFile file(fs::path(arguments.out) / name);
    file.write({reinterpret_cast<const char*>(bytes.data()), bytes.size()});
    file.commit();
    progress.step();
  }
  progress.finish();
  if (interrupts.asked()) throw std::runtime_error(arguments.rig.source + ": interrupted; the masks so far are whole");
  return 0;
}

}  // namespace stereotrack
