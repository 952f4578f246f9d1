#include "firmware-app/stereotrack/monitor.hpp"

#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <chrono>
#include <cmath>
#include <cstdarg>
#include <cstdio>
#include <deque>
#include <map>
#include <ostream>
#include <string>

#include "drivers/telemetry/receiver.hpp"
#include "drivers/telemetry/udp_listener.hpp"
#include "firmware-app/stereotrack/interrupt.hpp"

namespace stereotrack {
namespace {

using telemetry::Datagram;
using telemetry::Header;
using telemetry::Outcome;
using telemetry::Pair;
using telemetry::Receiver;
using telemetry::Target;
using Clock = std::chrono::steady_clock;

constexpr auto kRedraw = std::chrono::milliseconds(100);
constexpr auto kRateSpan = std::chrono::seconds(2);
constexpr int kBurst = 64;  // datagrams taken before signals and the screen get their turn again

[[gnu::format(printf, 2, 3)]] void append(std::string& text, const char* format, ...) {
  std::array<char, 256> line{};
  va_list values;
  va_start(values, format);
  const int size = std::vsnprintf(line.data(), line.size(), format, values);
  va_end(values);
  if (size > 0) text.append(line.data(), std::min(static_cast<std::size_t>(size), line.size() - 1));
}

std::string flag_names(std::uint32_t flags) {
  static constexpr std::array<std::pair<telemetry::Flag, const char*>, 6> kNames{{
      {telemetry::kMono, "mono"},
      {telemetry::kNoColour, "no-colour"},
      {telemetry::kBackgroundLearning, "learning"},
      {telemetry::kLightChange, "light-change"},
      {telemetry::kFramesSkippedBefore, "skipped-before"},
      {telemetry::kLate, "late"},
  }};
  std::string text;
  for (const auto& [flag, name] : kNames) {
    if ((flags & flag) == 0) continue;
    if (!text.empty()) text += ',';
    text += name;
    flags &= ~static_cast<std::uint32_t>(flag);
  }
  if (flags != 0) append(text, "%s0x%x", text.empty() ? "" : ",", flags);
  return text.empty() ? "-" : text;
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
  append(json, ",\"%s\":[", name);
  bool first = true;
  for (const float value : values) {
    if (!first) json += ',';
    first = false;
    append_number(json, value);
  }
  json += ']';
}

void append_field(std::string& json, const char* name, float value) {
  append(json, ",\"%s\":", name);
  append_number(json, value);
}

std::string to_json(const Datagram& datagram) {
  const Header& h = datagram.header;
  std::string json;
  append(json, "{\"schema\":%u,\"rig\":%u,\"session\":%ju,\"sequence\":%ju,\"part\":%u,\"parts\":%u,\"ordinal\":%ju",
         telemetry::kSchemaVersion, h.rig, std::uintmax_t{h.session}, std::uintmax_t{h.sequence}, h.part, h.parts,
         std::uintmax_t{h.ordinal});
  append(json, ",\"capture_time_ns\":%jd,\"send_time_ns\":%jd,\"latency_ns\":%u,\"flags\":%u",
         std::intmax_t{h.capture_time_ns}, std::intmax_t{h.send_time_ns}, h.latency_ns, h.flags);
  append(json, ",\"frames_skipped\":%u,\"tracks_dropped\":%u,\"targets_dropped\":%u,\"targets_refused\":%u",
         h.frames_skipped, h.tracks_dropped, h.targets_dropped, h.targets_refused);
  if (h.unit_m > 0) append_field(json, "unit_m", h.unit_m);
  json += ",\"targets\":[";
  bool first = true;
  for (const Target& t : datagram.targets) {
    append(json, "%s{\"id\":%u,\"state\":\"%s\",\"measured\":%s,\"has_depth\":%s", first ? "" : ",", t.id,
           to_string(t.state), t.measured ? "true" : "false", t.has_depth ? "true" : "false");
    first = false;
    append_field(json, "age_s", t.age_s);
    append_field(json, "confidence", t.confidence);
    append(json, ",\"box\":[%d,%d,%d,%d]", t.box.left, t.box.top, t.box.width, t.box.height);
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

/// What is known of one rig.
struct RigView {
  Pair pair;
  std::uint64_t lost = 0;
  std::deque<Clock::time_point> arrivals;

  void add(const Pair& newest, Clock::time_point now) {
    pair = newest;
    arrivals.push_back(now);
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
  append(text, "%6u  %-9s %7.1f", t.id, to_string(t.state), static_cast<double>(t.age_s));
  if (t.has_depth) {
    const auto scaled = [scale](float value) { return static_cast<double>(value * scale); };
    append(text, " %9.2f %9.2f %9.2f %9.2f %9.2f", scaled(t.position.x()), scaled(t.position.y()),
           scaled(t.position.z()), scaled(t.distance), scaled(t.velocity.norm()));
  } else {
    append(text, " %9s %9s %9s %9s %9s", "-", "-", "-", "-", "-");
  }
  append(text, " %11.2f", static_cast<double>(t.confidence));
}

class Screen {
 public:
  explicit Screen(std::ostream& out) : out_(out) {}

  /// Writes over what stood there before.
  void draw(std::map<std::uint32_t, RigView>& rigs, const Receiver& receiver, const std::string& where,
            Clock::time_point now) {
    std::string text;
    lines_left_ = height() - 1;
    line(text, "stereotrack monitor on " + where + ", ctrl-C ends");
    if (rigs.empty()) line(text, "nothing received yet");
    for (auto& [rig, view] : rigs) {
      const Header& h = view.pair.header;
      const Unit unit(h);
      std::string head;
      append(head, "rig %u  session %ju  pair %ju  %.1f pairs/s  latency %.1f ms  lost %ju  refused %ju  flags ", rig,
             std::uintmax_t{h.session}, std::uintmax_t{h.ordinal}, view.rate(now), h.latency_ns * 1e-6,
             std::uintmax_t{view.lost}, std::uintmax_t{receiver.counters().refused_total()});
      line(text, head + flag_names(h.flags));
      std::string columns;
      append(columns, "%6s  %-9s %7s %7s[%s] %7s[%s] %7s[%s] %6s[%s] %5s[%s/s] %10s", "id", "state", "age[s]", "x",
             unit.name(), "y", unit.name(), "z", unit.name(), "dist", unit.name(), "speed", unit.name(), "confidence");
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
  std::string text;
  append(text, "rig %u  pair %ju  latency %.1f ms  lost %ju  targets %zu", h.rig, std::uintmax_t{h.ordinal},
         h.latency_ns * 1e-6, std::uintmax_t{lost}, pair.targets.size());
  if (h.flags != 0) text += "  flags " + flag_names(h.flags);
  for (const Target& t : pair.targets) {
    append(text, "  | %u %s", t.id, to_string(t.state));
    if (t.has_depth) {
      append(text, " %.2f %s %.2f %s/s", static_cast<double>(t.distance * unit.scale), unit.name(),
             static_cast<double>(t.velocity.norm() * unit.scale), unit.name());
    }
    append(text, " %.2f", static_cast<double>(t.confidence));
  }
  return text + '\n';
}

std::string summary_line(const Receiver& receiver) {
  const telemetry::ReceiverCounters& c = receiver.counters();
  std::string text = "received " + std::to_string(c.pairs) + " pairs in " + std::to_string(c.datagrams) +
                     " datagrams, lost " + std::to_string(receiver.lost()) + ", refused " +
                     std::to_string(c.refused_total());
  std::string reasons;
  for (std::size_t i = 0; i < c.refused.size(); ++i) {
    if (c.refused[i] == 0) continue;
    reasons += (reasons.empty() ? "" : ", ") + std::to_string(c.refused[i]) + ' ' +
               to_string(static_cast<telemetry::Refusal>(i));
  }
  if (!reasons.empty()) text += " (" + reasons + ")";
  return text + ", duplicates " + std::to_string(c.duplicates) + ", reordered " + std::to_string(c.reordered) +
         ", too late " + std::to_string(c.stale) + '\n';
}

}  // namespace

int run_monitor(const MonitorArguments& arguments, std::ostream& out, std::ostream& messages) {
  telemetry::UdpListener listener(telemetry::parse_endpoint(arguments.listen, true));
  const std::string where = to_string(listener.local());
  const Interrupts interrupts;
  const bool live = arguments.live && !arguments.json;
  const auto timeout = std::chrono::duration_cast<Clock::duration>(
      std::chrono::duration<double>(arguments.timeout_s > 0 ? std::min(arguments.timeout_s, 1e8) : 1e8));

  Receiver receiver;
  Screen screen(out);
  std::map<std::uint32_t, RigView> rigs;
  std::array<std::byte, 2048> buffer{};
  Clock::time_point last_valid = Clock::now();
  Clock::time_point last_draw{};
  bool timed_out = false;
  const auto enough = [&] { return arguments.count > 0 && receiver.counters().pairs >= arguments.count; };

  if (!live) messages << "listening on " << where << ", ctrl-C ends" << std::endl;
  while (!interrupts.asked() && !enough() && out) {
    for (int taken = 0; taken < kBurst && !enough(); ++taken) {
      const std::ptrdiff_t size = listener.receive(buffer);
      if (size < 0) break;
      const auto room = static_cast<std::ptrdiff_t>(buffer.size());
      const Outcome outcome = receiver.accept(std::span(buffer).first(static_cast<std::size_t>(std::min(size, room))));
      if (outcome != Outcome::kPart && outcome != Outcome::kPair) continue;
      last_valid = Clock::now();
      const Header& header = receiver.datagram().header;
      const std::uint64_t lost = receiver.lost(header.rig, header.session);
      if (arguments.json) out << to_json(receiver.datagram()) << std::flush;
      if (outcome != Outcome::kPair) continue;
      if (!live && !arguments.json) out << plain_line(receiver.pair(), lost) << std::flush;
      if (live) {
        // Anybody can send any rig number: the table stays as small as what the receiver follows.
        if (rigs.size() == Receiver::kStreams && !rigs.contains(header.rig)) rigs.clear();
        rigs[header.rig].add(receiver.pair(), last_valid);
        rigs[header.rig].lost = lost;
      }
    }
    const Clock::time_point now = Clock::now();
    if (live && now - last_draw >= kRedraw) {
      screen.draw(rigs, receiver, where, now);
      last_draw = now;
    }
    const Clock::duration left = last_valid + timeout - now;
    timed_out = left <= Clock::duration::zero();
    if (timed_out || enough()) break;
    interrupts.wait(listener.fd(), live ? std::min<Clock::duration>(left, kRedraw) : left);
  }

  if (live) screen.draw(rigs, receiver, where, Clock::now());
  (arguments.json ? messages : out) << summary_line(receiver) << std::flush;
  if (!timed_out) return 0;
  std::string line;
  append(line, "nothing valid received on %s for %g s: is a sender running, and does it send to this address?\n",
         where.c_str(), arguments.timeout_s);
  messages << line << std::flush;
  return 1;
}

}  // namespace stereotrack
