#include "firmware-app/stereotrack/monitor.hpp"

#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <deque>
#include <map>
#include <optional>
#include <ostream>
#include <span>
#include <string>
#include <vector>

#include "drivers/telemetry/receiver.hpp"
#include "drivers/telemetry/udp_listener.hpp"
#include "firmware-app/formatted.hpp"
#include "firmware-app/stereotrack/interrupt.hpp"
#include "pipeline/effort.hpp"

namespace stereotrack {
namespace {

using telemetry::Datagram;
using telemetry::Header;
using telemetry::Live;
using telemetry::Outcome;
using telemetry::Pair;
using telemetry::Receiver;
using telemetry::Status;
using telemetry::Target;
using Clock = std::chrono::steady_clock;

constexpr auto kRedraw = std::chrono::milliseconds(100);
constexpr auto kRateSpan = std::chrono::seconds(2);
constexpr auto kSave = std::chrono::seconds(5);
constexpr int kBurst = 64;  // datagrams taken before signals and the screen get their turn again

using BitName = std::pair<std::uint32_t, const char*>;

/// "a,b", "-" for none; what has no name as a number.
std::string bit_names(std::uint32_t bits, std::span<const BitName> names) {
  std::string text;
  for (const auto& [bit, name] : names) {
    if ((bits & bit) == 0) continue;
    if (!text.empty()) text += ',';
    text += name;
    bits &= ~bit;
  }
  if (bits != 0) text += formatted("%s0x%x", text.empty() ? "" : ",", bits);
  return text.empty() ? "-" : text;
}

std::string flag_names(std::uint32_t flags) {
  static constexpr std::array<BitName, 12> kNames{{
      {telemetry::kMono, "mono"},
      {telemetry::kNoColour, "no-colour"},
      {telemetry::kBackgroundLearning, "learning"},
      {telemetry::kLightChange, "light-change"},
      {telemetry::kFramesSkippedBefore, "skipped-before"},
      {telemetry::kLate, "late"},
      {telemetry::kPairMissing, "pair-missing"},
      {telemetry::kPredicted, "predicted"},
      {telemetry::kEffortShed, "effort-shed"},
      {telemetry::kClockStepped, "clock-stepped"},
      {telemetry::kStateAtOutput, "state-at-output"},
      {telemetry::kWrongPair, "wrong-pair"},
  }};
  return bit_names(flags, kNames);
}

std::string health_names(std::uint32_t health) {
  static constexpr std::array<BitName, 18> kNames{{
      {telemetry::kHealthNoPairs, "no-pairs"},
      {telemetry::kHealthLeftSilent, "left-silent"},
      {telemetry::kHealthRightSilent, "right-silent"},
      {telemetry::kHealthSkew, "skew"},
      {telemetry::kHealthExposuresDiffer, "exposures-differ"},
      {telemetry::kHealthClockUnsynchronised, "clock-unsynchronised"},
      {telemetry::kHealthDeadlinesMissed, "deadlines-missed"},
      {telemetry::kHealthEffortShed, "effort-shed"},
      {telemetry::kHealthRecordingDrops, "recording-drops"},
      {telemetry::kHealthLineFailed, "line-failed"},
      {telemetry::kHealthTelemetryDrops, "telemetry-drops"},
      {telemetry::kHealthNotRealTime, "not-real-time"},
      {telemetry::kHealthTriggerFailed, "trigger-failed"},
      {telemetry::kHealthAllocated, "allocated"},
      {telemetry::kHealthHot, "hot"},
      {telemetry::kHealthLeftAstray, "left-astray"},
      {telemetry::kHealthRightAstray, "right-astray"},
      {telemetry::kHealthWrongPairs, "wrong-pairs"},
  }};
  return health == 0 ? "good" : bit_names(health, kNames);
}

std::string effort_names(std::uint32_t efforts) {
  std::array<BitName, kEfforts> names{};
  for (std::size_t i = 0; i < names.size(); ++i) {
    const auto effort = static_cast<Effort>(i);
    names[i] = {bit_of(effort), to_string(effort)};
  }
  return bit_names(efforts, names);
}

/// Lengths are shown in metres where they are known, else in the calibration's unit.
struct Unit {
  explicit Unit(const Header& header) : scale(header.unit_m > 0 ? header.unit_m : 1.0F), metres(header.unit_m > 0) {}
  float scale;
  bool metres;
  [[nodiscard]] const char* name() const { return metres ? "m" : "u"; }
};

void append_number(std::string& json, float value) {
  std::array<char, 32> digits{};
  const auto [end, error] = std::to_chars(digits.data(), digits.data() + digits.size(), value);
  if (error == std::errc{}) json.append(digits.data(), end);
}

template <class Values>
void append_array(std::string& json, const char* name, const Values& values) {
  json += formatted(",\"%s\":[", name);
  bool first = true;
  for (const float value : values) {
    if (!first) json += ',';
    first = false;
    append_number(json, value);
  }
  json += ']';
}

void append_field(std::string& json, const char* name, float value) {
  json += formatted(",\"%s\":", name);
  append_number(json, value);
}

void append_live(std::string& json, const Live& live) {
  json += formatted(",\"live\":{\"tai_offset_ns\":%jd", std::intmax_t{live.tai_offset.count()});
  const auto optional = [&](const char* name, const std::optional<std::chrono::nanoseconds>& value) {
    if (value) json += formatted(",\"%s\":%jd", name, std::intmax_t{value->count()});
  };
  optional("tai_error_ns", live.tai_error);
  optional("pair_skew_ns", live.pair_skew);
  if (live.exposure_left_us != 0) json += formatted(",\"exposure_left_us\":%u", live.exposure_left_us);
  if (live.exposure_right_us != 0) json += formatted(",\"exposure_right_us\":%u", live.exposure_right_us);
  optional("send_error_ns", live.send_error);
  json += formatted(",\"efforts_shed\":%u,\"health\":%u}", unsigned{live.efforts_shed}, live.health);
}

/// Names and values, in the order of stereotrack.proto.
void append_status(std::string& json, const Status& s, std::uint64_t sequence) {
  json += formatted(",\"status\":{\"sequence\":%ju", std::uintmax_t{sequence});
  const auto field = [&](const char* name, std::uint64_t value) {
    json += formatted(",\"%s\":%ju", name, std::uintmax_t{value});
  };
  field("uptime_ms", s.uptime_ms);
  field("health", s.health);
  field("efforts_shed", s.efforts_shed);
  field("latency_us", s.latency_us);
  field("period_us", s.period_us);
  field("pairs_captured", s.pairs_captured);
  field("pairs_evicted", s.pairs_evicted);
  field("pairs_skipped", s.pairs_skipped);
  field("pairs_starved", s.pairs_starved);
  field("unpaired_left", s.unpaired_left);
  field("unpaired_right", s.unpaired_right);
  field("outputs_on_time", s.outputs_on_time);
  field("outputs_predicted", s.outputs_predicted);
  field("outputs_missing", s.outputs_missing);
  field("outputs_overslept", s.outputs_overslept);
  field("late_results", s.late_results);
  field("deadline_misses", s.deadline_misses);
  field("allocations", s.allocations);
  field("telemetry_sent", s.telemetry_sent);
  field("telemetry_dropped", s.telemetry_dropped);
  field("telemetry_failed", s.telemetry_failed);
  field("recordings_dropped", s.recordings_dropped);
  field("lines_failed", s.lines_failed);
  field("clock_steps", s.clock_steps);
  field("efforts_shed_count", s.efforts_shed_count);
  field("pair_buffers", s.pair_buffers);
  field("pair_buffers_free_low", s.pair_buffers_free_low);
  field("pairs_waiting_high", s.pairs_waiting_high);
  field("recorder_slots", s.recorder_slots);
  field("recorder_slots_free_low", s.recorder_slots_free_low);
  field("compute_p50_us", s.compute_p50_us);
  field("compute_p99_us", s.compute_p99_us);
  field("compute_max_us", s.compute_max_us);
  field("send_error_p50_us", s.send_error_p50_us);
  field("send_error_p99_us", s.send_error_p99_us);
  field("send_error_max_us", s.send_error_max_us);
  field("skew_max_us", s.skew_max_us);
  field("trigger_pulses", s.trigger_pulses);
  field("trigger_skipped", s.trigger_skipped);
  field("trigger_failed", s.trigger_failed);
  field("exposures_missed_left", s.exposures_missed_left);
  field("exposures_missed_right", s.exposures_missed_right);
  field("exposures_doubled_left", s.exposures_doubled_left);
  field("exposures_doubled_right", s.exposures_doubled_right);
  field("exposures_stray_left", s.exposures_stray_left);
  field("exposures_stray_right", s.exposures_stray_right);
  json += '}';
}

/// `key_id`: of a datagram that was verified.
std::string to_json(const Datagram& datagram, std::optional<std::uint32_t> key_id) {
  const Header& h = datagram.header;
  std::string json = formatted("{\"schema\":%u,\"rig\":%u,\"session\":%ju", telemetry::kSchemaVersion, h.rig,
                               std::uintmax_t{h.session});
  if (key_id) json += formatted(",\"key_id\":%u", *key_id);
  if (datagram.status) {
    json += formatted(",\"send_time_ns\":%jd", std::intmax_t{h.send_time_ns});
    if (datagram.live) append_live(json, *datagram.live);
    append_status(json, *datagram.status, datagram.status_sequence);
    return json + "}\n";
  }
  json += formatted(",\"sequence\":%ju,\"part\":%u,\"parts\":%u,\"ordinal\":%ju", std::uintmax_t{h.sequence}, h.part,
                    h.parts, std::uintmax_t{h.ordinal});
  json += formatted(",\"capture_time_ns\":%jd,\"send_time_ns\":%jd,\"latency_ns\":%u,\"flags\":%u",
                    std::intmax_t{h.capture_time_ns}, std::intmax_t{h.send_time_ns}, h.latency_ns, h.flags);
  json += formatted(",\"frames_skipped\":%u,\"tracks_dropped\":%u,\"targets_dropped\":%u,\"targets_refused\":%u",
                    h.frames_skipped, h.tracks_dropped, h.targets_dropped, h.targets_refused);
  if (h.unit_m > 0) append_field(json, "unit_m", h.unit_m);
  if (datagram.live) append_live(json, *datagram.live);
  json += ",\"targets\":[";
  bool first = true;
  for (const Target& t : datagram.targets) {
    json += formatted("%s{\"id\":%u,\"state\":\"%s\",\"measured\":%s,\"has_depth\":%s", first ? "" : ",", t.id,
                      to_string(t.state), t.measured ? "true" : "false", t.has_depth ? "true" : "false");
    first = false;
    append_field(json, "age_s", t.age_s);
    append_field(json, "confidence", t.confidence);
    json += formatted(",\"box\":[%d,%d,%d,%d]", t.box.left, t.box.top, t.box.width, t.box.height);
    if (t.has_depth) {
      append_array(json, "position", t.position);
      append_array(json, "velocity", t.velocity);
      append_field(json, "distance", t.distance);
      std::array<float, 21> upper{};
      std::size_t n = 0;
      for (int i = 0; i < 6; ++i) {
        for (int j = i; j < 6; ++j) upper[n++] = t.covariance(i, j);
      }
      append_array(json, "covariance", upper);
    }
    if (t.has_extent) append_array(json, "extent", std::array{t.width, t.height});
    json += '}';
  }
  json += "]}\n";
  return json;
}

std::string live_text(const Live& live) {
  std::string text;
  const auto micro = [](std::chrono::nanoseconds value) { return static_cast<double>(value.count()) * 1e-3; };
  if (live.pair_skew) text += formatted("skew %+.1f us  ", micro(*live.pair_skew));
  if (live.exposure_left_us != 0 || live.exposure_right_us != 0) {
    text += formatted("exposures %.1f %.1f ms  ", live.exposure_left_us * 1e-3, live.exposure_right_us * 1e-3);
  }
  if (live.send_error) text += formatted("send error %+.1f us  ", micro(*live.send_error));
  if (live.tai_error) {
    text += formatted("TAI +-%.1f us  ", micro(*live.tai_error));
  } else {
    text += "TAI unsynchronised  ";
  }
  if (live.efforts_shed != 0) text += "shed " + effort_names(live.efforts_shed) + "  ";
  return text + "health " + health_names(live.health);
}

/// Two lines' worth: what the outputs were, what it cost.
std::array<std::string, 2> status_text(const Status& s) {
  std::array<std::string, 2> text;
  const std::uint64_t up_s = s.uptime_ms / 1000;
  text[0] += formatted("up %jud %02u:%02u:%02u", std::uintmax_t{up_s / 86400}, static_cast<unsigned>(up_s / 3600 % 24),
                       static_cast<unsigned>(up_s / 60 % 60), static_cast<unsigned>(up_s % 60));
  const auto count = [&text](std::size_t line, const char* name, std::uint64_t value) {
    text[line] += formatted(" %s %ju", name, std::uintmax_t{value});
  };
  text[0] += "  pairs";
  count(0, "captured", s.pairs_captured);
  count(0, "evicted", s.pairs_evicted);
  count(0, "skipped", s.pairs_skipped);
  count(0, "starved", s.pairs_starved);
  text[0] += "  outputs";
  count(0, "on time", s.outputs_on_time);
  count(0, "predicted", s.outputs_predicted);
  count(0, "missing", s.outputs_missing);
  count(0, "overslept", s.outputs_overslept);
  text[0] += "  health " + health_names(s.health);
  text[1] += formatted("compute %.1f %.1f %.1f ms  send error %u %u %u us (p50 p99 max)  allocations %ju",
                       s.compute_p50_us * 1e-3, s.compute_p99_us * 1e-3, s.compute_max_us * 1e-3, s.send_error_p50_us,
                       s.send_error_p99_us, s.send_error_max_us, std::uintmax_t{s.allocations});
  text[1] += formatted("  buffers free at least %u of %u  shed %s", s.pair_buffers_free_low, s.pair_buffers,
                       effort_names(s.efforts_shed).c_str());
  text[1] += "  dropped";
  count(1, "telemetry", s.telemetry_dropped + s.telemetry_failed);
  count(1, "recording", s.recordings_dropped);
  count(1, "lines", s.lines_failed);
  return text;
}

/// What is known of one rig.
struct RigView {
  Pair pair;
  std::optional<Status> status;
  std::uint64_t lost = 0;
  std::deque<Clock::time_point> arrivals;

  void add(const Pair& newest, Clock::time_point now) {
    if (newest.header.session != pair.header.session) status.reset();
    pair = newest;
    arrivals.push_back(now);
  }
  void add(const Datagram& with_status) {
    if (with_status.header.session != pair.header.session) pair = {with_status.header, with_status.live, {}};
    status = with_status.status;
  }
  /// Pairs a second over the last kRateSpan.
  [[nodiscard]] double rate(Clock::time_point now) {
    while (!arrivals.empty() && now - arrivals.front() > kRateSpan) arrivals.pop_front();
    if (arrivals.size() < 2) return 0;
    const double span_s = std::chrono::duration<double>(arrivals.back() - arrivals.front()).count();
    return span_s > 0 ? static_cast<double>(arrivals.size() - 1) / span_s : 0;
  }
};

void append_target_row(std::string& text, const Target& t, float scale) {
  text += formatted("%6u  %-9s %7.1f", t.id, to_string(t.state), static_cast<double>(t.age_s));
  if (t.has_depth) {
    const auto scaled = [scale](float value) { return static_cast<double>(value * scale); };
    text += formatted(" %9.2f %9.2f %9.2f %9.2f %9.2f", scaled(t.position.x()), scaled(t.position.y()),
                      scaled(t.position.z()), scaled(t.distance), scaled(t.velocity.norm()));
  } else {
    text += formatted(" %9s %9s %9s %9s %9s", "-", "-", "-", "-", "-");
  }
  text += formatted(" %11.2f", static_cast<double>(t.confidence));
}

/// "7 (3 forged, 4 replayed)".
std::string refused_text(const Receiver& receiver) {
  const telemetry::ReceiverCounters& c = receiver.counters();
  std::string reasons;
  for (std::size_t i = 0; i < c.refused.size(); ++i) {
    if (c.refused[i] == 0) continue;
    reasons += (reasons.empty() ? "" : ", ") + std::to_string(c.refused[i]) + ' ' +
               to_string(static_cast<telemetry::Refusal>(i));
  }
  return std::to_string(c.refused_total()) + (reasons.empty() ? "" : " (" + reasons + ")");
}

class Screen {
 public:
  explicit Screen(std::ostream& out) : out_(out) {}

  /// Writes over what stood there before.
  void draw(std::map<std::uint32_t, RigView>& rigs, const Receiver& receiver, const std::string& where,
            Clock::time_point now) {
    std::string text;
    lines_left_ = height() - 1;
    const bool refused = receiver.counters().refused_total() > 0;
    line(text, "stereotrack monitor on " + where + ", ctrl-C ends" +
                   (refused ? "  refused " + refused_text(receiver) : std::string()));
    if (rigs.empty()) line(text, "nothing received yet");
    for (auto& [rig, view] : rigs) {
      const Header& h = view.pair.header;
      const Unit unit(h);
      std::string head = formatted("rig %u  session %ju  pair %ju  %.1f pairs/s  latency %.1f ms  lost %ju  flags ",
                                   rig, std::uintmax_t{h.session}, std::uintmax_t{h.ordinal}, view.rate(now),
                                   h.latency_ns * 1e-6, std::uintmax_t{view.lost});
      line(text, head + flag_names(h.flags));
      if (view.pair.live) line(text, "  " + live_text(*view.pair.live));
      if (view.status) {
        for (const std::string& one : status_text(*view.status)) line(text, "  " + one);
      }
      std::string columns = formatted("%6s  %-9s %7s %7s[%s] %7s[%s] %7s[%s] %6s[%s] %5s[%s/s] %10s", "id", "state",
                                      "age[s]", "x", unit.name(), "y", unit.name(), "z", unit.name(), "dist",
                                      unit.name(), "speed", unit.name(), "confidence");
      line(text, columns);
      std::size_t shown = 0;
      for (const Target& target : view.pair.targets) {
        if (lines_left_ <= 1) break;
        std::string row;
        append_target_row(row, target, unit.scale);
        line(text, row);
        ++shown;
      }
      if (shown < view.pair.targets.size()) {
        line(text, "        and " + std::to_string(view.pair.targets.size() - shown) + " farther ones");
      }
    }
    out_ << (drawn_ > 0 ? "\x1b[" + std::to_string(drawn_) + "A" : std::string()) << '\r' << text << "\x1b[J"
         << std::flush;
    drawn_ = height() - 1 - lines_left_;
  }

 private:
  void line(std::string& text, const std::string& content) {
    if (lines_left_ <= 0) return;
    --lines_left_;
    // Without line wrapping a long line stays one line, which moving the cursor up relies on.
    text += "\x1b[?7l" + content + "\x1b[K\x1b[?7h\n";
  }
  [[nodiscard]] static int height() {
    winsize size{};
    return ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_row > 4 ? size.ws_row : 24;
  }

  std::ostream& out_;
  int drawn_ = 0;
  int lines_left_ = 0;
};

std::string plain_line(const Pair& pair, std::uint64_t lost) {
  const Header& h = pair.header;
  const Unit unit(h);
  std::string text =
      formatted("rig %u  pair %ju  latency %.1f ms  lost %ju  targets %zu", h.rig, std::uintmax_t{h.ordinal},
                h.latency_ns * 1e-6, std::uintmax_t{lost}, pair.targets.size());
  if (h.flags != 0) text += "  flags " + flag_names(h.flags);
  if (pair.live) text += "  " + live_text(*pair.live);
  for (const Target& t : pair.targets) {
    text += formatted("  | %u %s", t.id, to_string(t.state));
    if (t.has_depth) {
      text += formatted(" %.2f %s %.2f %s/s", static_cast<double>(t.distance * unit.scale), unit.name(),
                        static_cast<double>(t.velocity.norm() * unit.scale), unit.name());
    }
    text += formatted(" %.2f", static_cast<double>(t.confidence));
  }
  return text + '\n';
}

std::string plain_line(const Datagram& with_status) {
  std::string text =
      formatted("rig %u  status %ju  ", with_status.header.rig, std::uintmax_t{with_status.status_sequence});
  const auto lines = status_text(*with_status.status);
  return text + lines[0] + "  " + lines[1] + '\n';
}

std::string summary_line(const Receiver& receiver) {
  const telemetry::ReceiverCounters& c = receiver.counters();
  return "received " + std::to_string(c.pairs) + " pairs" +
         (c.statuses > 0 ? " and " + std::to_string(c.statuses) + " statuses" : std::string()) + " in " +
         std::to_string(c.datagrams) + " datagrams, lost " + std::to_string(receiver.lost()) + ", refused " +
         refused_text(receiver) + ", duplicates " + std::to_string(c.duplicates) + ", reordered " +
         std::to_string(c.reordered) + ", too late " + std::to_string(c.stale) + '\n';
}

/// Keeps the receiver's marks in a file.
class MarksKeeper {
 public:
  MarksKeeper(std::string path, Receiver& receiver) : path_(std::move(path)), receiver_(receiver) {
    if (path_.empty()) return;
    saved_ = telemetry::load_marks(path_);
    receiver_.restore(saved_);
    telemetry::save_marks(path_, saved_);  // a file that cannot be written is said before anything is shown
  }

  /// Writes them if they have changed since. Empty, or the line to tell.
  [[nodiscard]] std::string save() {
    if (path_.empty() || std::ranges::equal(receiver_.marks(), saved_)) return {};
    try {
      telemetry::save_marks(path_, receiver_.marks());
    } catch (const telemetry::MarksFileError& error) {
      return error.what() + std::string("\n");
    }
    saved_.assign(receiver_.marks().begin(), receiver_.marks().end());
    return {};
  }

 private:
  std::string path_;
  Receiver& receiver_;
  std::vector<telemetry::Mark> saved_;
};

}  // namespace

int run_monitor(const MonitorArguments& arguments, std::ostream& out, std::ostream& messages) {
  const telemetry::Endpoint local = telemetry::parse_endpoint(arguments.listen, true);
  const bool keyed = !arguments.key_file.empty();
  Receiver receiver(keyed ? telemetry::load_key_file(arguments.key_file) : std::vector<telemetry::Key>{});
  MarksKeeper marks(arguments.state, receiver);
  telemetry::UdpListener listener(local);
  const std::string where = to_string(listener.local());
  const Interrupts interrupts;
  const bool live = arguments.live && !arguments.json;
  const auto timeout = std::chrono::duration_cast<Clock::duration>(
      std::chrono::duration<double>(arguments.timeout_s > 0 ? std::min(arguments.timeout_s, 1e8) : 1e8));

  Screen screen(out);
  std::map<std::uint32_t, RigView> rigs;
  std::array<std::byte, 2048> buffer{};
  Clock::time_point last_valid = Clock::now();
  Clock::time_point last_draw{};
  Clock::time_point last_save = last_valid;
  bool timed_out = false;
  bool told_unverified = live;  // a line would destroy the table
  const auto enough = [&] { return arguments.count > 0 && receiver.counters().pairs >= arguments.count; };

  if (!live) messages << "listening on " << where << ", ctrl-C ends" << std::endl;
  while (!interrupts.asked() && !enough() && out) {
    for (int taken = 0; taken < kBurst && !enough(); ++taken) {
      const std::ptrdiff_t size = listener.receive(buffer);
      if (size < 0) break;
      const auto room = static_cast<std::ptrdiff_t>(buffer.size());
      const auto bytes = std::span<const std::byte>(buffer).first(static_cast<std::size_t>(std::min(size, room)));
      const Outcome outcome = receiver.accept(bytes);
      if (outcome != Outcome::kPart && outcome != Outcome::kPair && outcome != Outcome::kStatus) continue;
      last_valid = Clock::now();
      const Datagram& datagram = receiver.datagram();
      const Header& header = datagram.header;
      const auto key_id = telemetry::key_id_of(bytes);
      if (!keyed && key_id && !told_unverified) {
        messages << "signed with key " << *key_id << ", which is not checked: give --key-file" << std::endl;
        told_unverified = true;
      }
      if (arguments.json) out << to_json(datagram, keyed ? key_id : std::nullopt) << std::flush;
      if (outcome == Outcome::kPart) continue;
      if (!live && !arguments.json) {
        out << (outcome == Outcome::kStatus ? plain_line(datagram)
                                            : plain_line(receiver.pair(), receiver.lost(header.rig, header.session)))
            << std::flush;
      }
      if (live) {
        // Anybody can send any rig number: the table stays as small as what the receiver follows.
        if (rigs.size() == Receiver::kStreams && !rigs.contains(header.rig)) rigs.clear();
        RigView& view = rigs[header.rig];
        if (outcome == Outcome::kStatus) {
          view.add(datagram);
        } else {
          view.add(receiver.pair(), last_valid);
        }
        view.lost = receiver.lost(header.rig, header.session);
      }
    }
    const Clock::time_point now = Clock::now();
    if (now - last_save >= kSave) {
      const std::string trouble = marks.save();
      if (!live) messages << trouble << std::flush;  // else the last one tells
      last_save = now;
    }
    if (live && now - last_draw >= kRedraw) {
      screen.draw(rigs, receiver, where, now);
      last_draw = now;
    }
    const Clock::duration left = last_valid + timeout - now;
    timed_out = left <= Clock::duration::zero();
    if (timed_out || enough()) break;
    // Marks that wait to be saved are not kept waiting by silence.
    const Clock::duration nap = arguments.state.empty() ? left : std::min<Clock::duration>(left, kSave);
    interrupts.wait(listener.fd(), live ? std::min<Clock::duration>(left, kRedraw) : nap);
  }

  if (live) screen.draw(rigs, receiver, where, Clock::now());
  (arguments.json ? messages : out) << summary_line(receiver) << std::flush;
  const std::string trouble = marks.save();
  messages << trouble << std::flush;
  if (!timed_out) return trouble.empty() ? 0 : 1;
  std::string line = formatted("nothing valid received on %s for %g s", where.c_str(), arguments.timeout_s);
  line += receiver.counters().refused_total() == 0
              ? ": is a sender running, and does it send to this address?\n"
              : ", refused " + refused_text(receiver) +
                    (keyed ? ": does the sender sign with a key of " + arguments.key_file + "?\n"
                           : ": is it stereotrack that sends to this address?\n");
  messages << line << std::flush;
  return 1;
}

}  // namespace stereotrack
