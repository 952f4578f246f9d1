// The latency contract in real time beside what the machine itself can do, and beside a naive construction.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <chrono>
#include <cstdio>
#include <exception>
#include <fstream>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <regex>
#include <stdexcept>
#include <thread>

#include "drivers/capture/film/film.hpp"
#include "drivers/telemetry/udp_sender.hpp"
#include "firmware-app/rig/rig.hpp"
#include "firmware-app/runtime/allocation_count.hpp"
#include "firmware-app/runtime/clock.hpp"
#include "firmware-app/stereotrackd/daemon.hpp"
#include "tests/bench/latency/arrivals.hpp"
#include "tests/bench/latency/naive_queue.hpp"
#include "tests/bench/latency/witness.hpp"
#include "tests/support/run_program.hpp"

namespace stereotrack::bench {
namespace {

using std::chrono::nanoseconds;
using std::chrono::seconds;

struct Arguments {
  std::string json = "latency.json";
  int duration_s = 60;
  double fps = 60;
  double latency_ms = 25;
  int film_pairs = 240;
  std::vector<std::string> set;
};

struct Tail {
  double p50 = 0;
  double p99 = 0;
  double p999 = 0;
  double max = 0;
  std::size_t count = 0;
};

/// [us]
Tail tail_of(std::vector<double> values) {
  Tail tail;
  tail.count = values.size();
  if (values.empty()) return tail;
  std::sort(values.begin(), values.end());
  const auto at = [&](double part) {
    return values[std::min(values.size() - 1, static_cast<std::size_t>(part * static_cast<double>(values.size())))];
  };
  tail.p50 = at(0.5);
  tail.p99 = at(0.99);
  tail.p999 = at(0.999);
  tail.max = values.back();
  return tail;
}

Tail tail_of(const runtime::Histogram& histogram) {
  const auto us = [](std::uint64_t ns) { return static_cast<double>(ns) * 1e-3; };
  return {us(histogram.percentile_ns(0.5)), us(histogram.percentile_ns(0.99)), us(histogram.percentile_ns(0.999)),
          us(histogram.max_ns()), histogram.count()};
}

nlohmann::json to_json(const Tail& tail) {
  return {{"p50_us", tail.p50}, {"p99_us", tail.p99}, {"p999_us", tail.p999}, {"max_us", tail.max}, {"n", tail.count}};
}

void row(const char* name, const Tail& tail) {
  std::printf("%-46s %10.1f %10.1f %10.1f %10.1f %8zu\n", name, tail.p50, tail.p99, tail.p999, tail.max, tail.count);
}

/// cyclictest in the same minute: its histogram of wake-up latencies at the publisher's own priority.
class Cyclictest {
 public:
  Cyclictest(int priority, int core, int duration_s)
      : program_({"/usr/bin/env", "cyclictest", "--quiet", "--mlockall", "--interval=1000",
                  "--policy=" + std::string(priority > 0 ? "fifo" : "other"), "--priority=" + std::to_string(priority),
                  "--affinity=" + std::to_string(core), "--duration=" + std::to_string(duration_s),
                  "--histogram=20000"}) {}

  /// Nothing: it is not installed, or has not the right to run so.
  Tail wait() {
    const test::ProgramResult done = program_.wait();
    std::vector<double> values;
    const std::regex line("^(\\d{6}) (\\d+)$");
    std::istringstream text(done.out);
    std::smatch found;
    for (std::string one; std::getline(text, one);) {
      if (!std::regex_match(one, found, line)) continue;
      values.insert(values.end(), std::stoul(found[2]), std::stod(found[1]));
    }
    Tail tail = tail_of(std::move(values));
    if (std::smatch longest; std::regex_search(done.out, longest, std::regex("# Max Latencies: 0*(\\d+)"))) {
      tail.max = std::stod(longest[1]);
    }
    return tail;
  }

 private:
  test::Program program_;
};

std::vector<double> send_errors(const std::vector<Arrival>& arrivals) {
  std::vector<double> errors;
  for (const Arrival& one : arrivals) {
    errors.push_back(std::abs(std::chrono::duration<double, std::micro>(one.came - one.due).count()));
  }
  return errors;
}

struct Miss {
  std::uint64_t ordinal = 0;
  MonotonicTime captured{};
  MonotonicTime due{};
  nanoseconds overslept{0};  ///< by the worse of the witnesses, between the two and shortly after
  bool excused = false;
};

struct Scene {
  config::Configuration configuration;
  StereoCalibration calibration;
  std::unique_ptr<capture::Film> film;
};

Scene draw(const Arguments& arguments) {
  std::vector<std::string> set{"source.fps=" + std::to_string(arguments.fps),
                               "synthetic.frames=" + std::to_string(arguments.film_pairs),
                               "latency.output_ms=" + std::to_string(arguments.latency_ms)};
  set.insert(set.end(), arguments.set.begin(), arguments.set.end());
  Rig rig;
  rig.loaded = load_configuration(std::nullopt, set);
  open_scene("synthetic:eleven", rig);
  check_rig(rig);
  return {rig.configuration(), *rig.calibration,
          std::make_unique<capture::Film>(*rig.source, capture::Film::Config{.most_bytes = std::uint64_t{4} << 30})};
}

int run(const Arguments& arguments) {
  const int cores = static_cast<int>(std::thread::hardware_concurrency());
  const int publisher_core = cores > 1 ? 1 : 0;
  const int frames_core = 0;
  std::printf("drawing %d pairs of synthetic:eleven\n", arguments.film_pairs);
  Scene scene = draw(arguments);
  config::RealTimeConfig& real_time = scene.configuration.realtime;
  real_time.publisher.core = publisher_core;
  real_time.capture.core = publisher_core;
  real_time.frames.core = frames_core;

  std::printf("%d s at %.0f pairs/s, latency %.1f ms\n", arguments.duration_s, arguments.fps, arguments.latency_ms);
  const runtime::RealTimeProcess process({});
  std::vector<runtime::Missing> missing = process.missing();
  Arrivals arrivals;
  daemon::Daemon::Parts parts;
  parts.configuration = &scene.configuration;
  parts.calibration = &scene.calibration;
  parts.unit_m = 1;
  parts.source = std::move(scene.film);
  signals::SignalRules::Config no_rules;
  no_rules.stale_after = seconds(1);
  parts.plan = std::make_unique<daemon::Plan>(daemon::Plan{std::make_unique<telemetry::UdpSender>(arrivals.here()),
                                                           *signals::SignalRules::create(no_rules), 0});
  parts.session = 1;
  daemon::Daemon daemon(std::move(parts));
  Witness on_publisher(publisher_core);
  Witness on_frames(frames_core);
  Cyclictest cyclictest(real_time.publisher.priority, publisher_core, arguments.duration_s);
  for (const auto& more : {daemon.start(real_time, !missing.empty()), on_publisher.missing(), on_frames.missing()}) {
    missing.insert(missing.end(), more.begin(), more.end());
  }
  std::this_thread::sleep_for(seconds(arguments.duration_s));
  daemon.stop();
  const Tail cyclic = cyclictest.wait();
  on_publisher.stop();
  on_frames.stop();
  arrivals.stop();

  const daemon::Vitals& vitals = daemon.vitals();
  const auto counter = [&](const std::string& name) -> std::uint64_t {
    for (std::size_t i = 0; i < daemon::kScheduleCounters.size(); ++i) {
      if (name == daemon::kScheduleCounters[i].name) return vitals.schedule[i].get();
    }
    throw std::logic_error(name);
  };
  // A deadline is missed where what left was not the pair's own result, or left after its time, or not at all. It is
  // excused where at least half of the time that would have been to spare went to what kept a witness asleep: that of
  // the publisher's core about the moment of leaving; for a result that came late, of either core since the capture.
  std::vector<Miss> misses;
  const auto ms = [](double value) { return nanoseconds(static_cast<std::int64_t>(value * 1e6)); };
  const config::LatencyConfig& latency = scene.configuration.latency;
  const auto miss = [&](std::uint64_t ordinal, MonotonicTime captured, MonotonicTime due, bool was_computed_late) {
    Miss one{.ordinal = ordinal, .captured = captured, .due = due};
    const MonotonicTime until = due + std::chrono::milliseconds(3);
    nanoseconds spare = ms(latency.grace_ms);
    one.overslept = on_publisher.overslept(due - ms(latency.lead_ms), until);
    if (was_computed_late) {
      const auto usual = nanoseconds(static_cast<std::int64_t>(vitals.capture_to_result.percentile_ns(0.5)));
      spare = std::chrono::duration_cast<nanoseconds>(due - captured) - usual;
      one.overslept = std::max(on_publisher.overslept(captured, until), on_frames.overslept(captured, until));
    }
    one.excused = one.overslept * 2 >= spare;
    misses.push_back(one);
  };
  std::uint64_t last = 0;
  constexpr std::uint32_t kMissed = telemetry::kPredicted | telemetry::kLate | telemetry::kPairMissing;
  for (const Arrival& one : arrivals.list()) {
    if (one.ordinal != 0) {
      // Pairs between that never left: the publisher overslept.
      const auto period = nanoseconds(static_cast<std::int64_t>(1e9 / arguments.fps));
      for (std::uint64_t lost = last + 1; last != 0 && lost < one.ordinal; ++lost) {
        const auto back = period * static_cast<std::int64_t>(one.ordinal - lost);
        miss(lost, one.captured - back, one.due - back, false);
      }
      last = one.ordinal;
    }
    const bool came_late = one.came - one.due > ms(latency.late_ms);
    if ((one.flags & kMissed) != 0 || came_late) {
      miss(one.ordinal, one.captured, one.due, (one.flags & telemetry::kPredicted) != 0);
    }
  }
  const auto excused = static_cast<std::size_t>(
      std::count_if(misses.begin(), misses.end(), [](const Miss& one) { return one.excused; }));

  std::printf("drawing them again for the naive queue\n");
  Scene again = draw(arguments);
  Arrivals naive_arrivals;
  Cyclictest naive_cyclictest(real_time.publisher.priority, publisher_core, arguments.duration_s);
  run_naive(again.configuration, again.calibration, *again.film, naive_arrivals.here(), seconds(arguments.duration_s));
  const Tail naive_cyclic = naive_cyclictest.wait();
  naive_arrivals.stop();
  const std::vector<double> naive_errors = send_errors(naive_arrivals.list());
  const auto late = [](const std::vector<double>& errors) {
    return std::count_if(errors.begin(), errors.end(), [](double us) { return us > 1000; });
  };

  const std::vector<double> errors = send_errors(arrivals.list());
  std::printf("\n%-46s %10s %10s %10s %10s %8s\n", "[us]", "p50", "p99", "p99.9", "max", "n");
  row("send error, own account", tail_of(vitals.send_error));
  row("send error, kernel's stamp at the receiver", tail_of(errors));
  row("  naive queue, the same stamp", tail_of(naive_errors));
  row("publisher's wake-up", tail_of(vitals.publisher_wake_up));
  row("cyclictest beside it", cyclic);
  row("  cyclictest beside the naive queue", naive_cyclic);
  row("witness on the publisher's core", tail_of(on_publisher.lateness()));
  row("witness on the pipeline's core", tail_of(on_frames.lateness()));
  row("compute", tail_of(vitals.compute));
  row("capture to result", tail_of(vitals.capture_to_result));
  std::printf(
      "\npairs %llu, messages %zu, on time %llu, missed deadlines %zu (excused by a witness: %zu), heap calls %llu\n",
      static_cast<unsigned long long>(daemon.pool().captured), arrivals.list().size(),
      static_cast<unsigned long long>(counter("on_time")), misses.size(), excused,
      static_cast<unsigned long long>(vitals.frame_allocations.get() + vitals.publisher_allocations.get()));
  std::printf("sent more than 1 ms off: %td of %zu; naive queue %td of %zu\n", late(errors), errors.size(),
              late(naive_errors), naive_errors.size());
  for (const Miss& one : misses) {
    std::printf("  missed: pair %llu, a witness overslept %.2f ms meanwhile: %s\n",
                static_cast<unsigned long long>(one.ordinal),
                std::chrono::duration<double, std::milli>(one.overslept).count(),
                one.excused ? "excused" : "NOT excused");
  }
  for (const runtime::Missing& right : missing) std::printf("not granted: %s\n", right.what.c_str());

  const double p50 = tail_of(vitals.send_error).p50;
  const std::uint64_t heap = vitals.frame_allocations.get() + vitals.publisher_allocations.get();
  const bool reached = misses.size() == excused && p50 <= 60 && heap == 0 && allocations_are_counted();
  nlohmann::json json{{"duration_s", arguments.duration_s},
                      {"fps", arguments.fps},
                      {"latency_ms", arguments.latency_ms},
                      {"rights_missing", missing.size()},
                      {"pairs", daemon.pool().captured},
                      {"messages", arrivals.list().size()},
                      {"on_time", counter("on_time")},
                      {"missed", misses.size()},
                      {"excused", excused},
                      {"heap_calls", heap},
                      {"send_error", to_json(tail_of(vitals.send_error))},
                      {"send_error_stamped", to_json(tail_of(errors))},
                      {"naive_send_error_stamped", to_json(tail_of(naive_errors))},
                      {"publisher_wake_up", to_json(tail_of(vitals.publisher_wake_up))},
                      {"cyclictest", to_json(cyclic)},
                      {"naive_cyclictest", to_json(naive_cyclic)},
                      {"compute", to_json(tail_of(vitals.compute))},
                      {"capture_to_result", to_json(tail_of(vitals.capture_to_result))},
                      {"reached", reached}};
  std::ofstream(arguments.json) << json.dump(2) << '\n';
  std::printf("to reach: no miss without excuse, send error p50 <= 60 us, no heap call: %s\n",
              reached ? "reached" : "MISSED");
  return reached ? 0 : 1;
}

}  // namespace
}  // namespace stereotrack::bench

int main(int argc, char** argv) {
  CLI::App app("The latency contract, measured in real time.", "stereotrack_latency");
  stereotrack::bench::Arguments arguments;
  app.add_option("--json", arguments.json, "file for the numbers")->capture_default_str();
  app.add_option("--duration", arguments.duration_s, "of each side [s]")->check(CLI::Range(1, 86400));
  app.add_option("--fps", arguments.fps, "pairs a second")->check(CLI::Range(1.0, 1000.0));
  app.add_option("--latency", arguments.latency_ms, "latency.output_ms")->check(CLI::Range(1.0, 1000.0));
  app.add_option("--film", arguments.film_pairs, "pairs that are drawn and played to and fro")
      ->check(CLI::Range(2, 100000));
  app.add_option("--set", arguments.set, "KEY=VALUE of the configuration")->allow_extra_args(false);
  CLI11_PARSE(app, argc, argv);
  try {
    return stereotrack::bench::run(arguments);
  } catch (const std::exception& error) {
    std::cerr << "stereotrack_latency: " << error.what() << '\n';
    return 1;
  }
}
