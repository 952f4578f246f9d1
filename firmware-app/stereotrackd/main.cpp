#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <csignal>
#include <cstdlib>
#include <exception>
#include <filesystem>
#include <iostream>

#include "config/error.hpp"
#include "drivers/capture/film/film.hpp"
#include "drivers/record/torn.hpp"
#include "drivers/telemetry/authentication.hpp"
#include "drivers/telemetry/endpoint.hpp"
#include "drivers/telemetry/session_file.hpp"
#include "firmware-app/formatted.hpp"
#include "firmware-app/rig/cameras.hpp"
#include "firmware-app/rig/rig.hpp"
#include "firmware-app/rig/trigger.hpp"
#include "firmware-app/runtime/real_time.hpp"
#include "firmware-app/signals/set_up.hpp"
#include "firmware-app/stereotrackd/daemon.hpp"
#include "firmware-app/stereotrackd/log.hpp"
#include "firmware-app/stereotrackd/panic.hpp"
#include "firmware-app/stereotrackd/plan.hpp"
#include "firmware-app/stereotrackd/reload.hpp"
#include "firmware-app/stereotrackd/safe_lines.hpp"
#include "firmware-app/stereotrackd/service.hpp"

namespace stereotrack {
namespace {

namespace fs = std::filesystem;
using daemon::log;
using daemon::LogLevel;

constexpr int kFailed = 1;
constexpr int kBadUsage = 2;

struct Arguments {
  std::string config;
  std::vector<std::string> set;
  bool check = false;
  bool safe_lines = false;
};

capture::Film::Repeat repeat_of(config::Repeat repeat) {
  switch (repeat) {
    case config::Repeat::kLoop: return capture::Film::Repeat::kLoop;
    case config::Repeat::kOnce: return capture::Film::Repeat::kOnce;
    case config::Repeat::kBounce: break;
  }
  return capture::Film::Repeat::kBounce;
}

// What a daemon would watch, for a check: nothing is drawn, no camera runs.
class Unopened final : public capture::LiveSource {
 public:
  explicit Unopened(const capture::SourceInfo& info) : info_(info) {}
  [[nodiscard]] const capture::SourceInfo& info() const noexcept override { return info_; }
  [[nodiscard]] Step step(capture::PairOutlet&, MonotonicTime) noexcept override { return Step::kEnded; }
  [[nodiscard]] ClockMap clock_map() const noexcept override { return {}; }
  [[nodiscard]] const std::string& failure() const noexcept override { return failure_; }

 private:
  capture::SourceInfo info_;
  std::string failure_;
};

void read_rig_calibration(Rig& rig, bool stereo) {
  const std::string& file = rig.configuration().calibration.file;
  if (!file.empty() && stereo) read_calibration(file, {}, rig);
}

std::unique_ptr<capture::LiveSource> open_live_cameras(Rig& rig, bool check, daemon::Daemon::Parts& parts) {
  const config::CameraConfig& camera = rig.configuration().camera;
  const bool stereo = camera.side_by_side || !camera.right.device.empty();
  if (stereo && rig.configuration().calibration.file.empty()) {
    throw config::error_at(rig.loaded.origins, "calibration.file",
                           "not set: two views need their calibration; or leave camera.right.device out for mono");
  }
  read_rig_calibration(rig, stereo);
  std::unique_ptr<capture::LiveSource> source;
  if (check) {
    const CameraCheck found = check_cameras(rig.loaded);
    for (const std::string& line : found.lines) std::cout << line << '\n';
    std::cout << check_trigger(rig.configuration()) << '\n';
    for (const std::string& note : found.notes) log(LogLevel::kWarning, note, {{"STEREOTRACK_CAUSE", "camera"}});
    for (std::size_t i = 1; i < found.failures.size(); ++i) log(LogLevel::kError, found.failures[i]);
    if (!found.failures.empty()) throw std::runtime_error(found.failures[0]);
    source = std::make_unique<Unopened>(found.info);
  } else {
    // Requested inactive; pulses begin with the threads.
    TriggerSetup trigger = open_trigger(rig.configuration());
    parts.train = std::move(trigger.train);
    parts.pwm = std::move(trigger.pwm);
    const auto say = [](const std::string& note) { log(LogLevel::kWarning, note, {{"STEREOTRACK_CAUSE", "camera"}}); };
    source = open_cameras(rig.loaded, say, std::move(trigger.told));
  }
  check_rig(rig, source->info());
  return source;
}

// Opens what source.name says, and of cameras their trigger, into `parts`; the film of it is drawn into memory, unless
// it is only to be checked.
std::unique_ptr<capture::LiveSource> open_source(Rig& rig, bool check, daemon::Daemon::Parts& parts) {
  const config::SourceConfig& source = rig.configuration().source;
  if (source.name == kCameras) return open_live_cameras(rig, check, parts);
  if (source.name.starts_with(kSynthetic)) {
    open_scene(source.name, rig);
  } else if (record::is_recording(source.name)) {
    open_recording(source.name, rig);
    if (!rig.recording->warning().empty()) log(LogLevel::kWarning, rig.recording->warning());
  } else {
    throw config::error_at(
        rig.loaded.origins, "source.name",
        source.name.empty()
            ? "not set: what is to be watched? For example \"synthetic:eleven\""
            : "\"" + source.name + "\" is no source: want cameras, synthetic:NAME, or a recording (.strec)");
  }
  read_rig_calibration(rig, rig.source->info().stereo);
  check_rig(rig);
  const capture::Film::Config config{.repeat = repeat_of(source.repeat),
                                     .most_bytes = static_cast<std::uint64_t>(source.memory_mb) << 20};
  if (check) {
    capture::SourceInfo info = rig.source->info();
    capture::Film::check(info, config);
    if (info.period.count() <= 0) info.period = std::chrono::nanoseconds(std::llround(1e9 / source.fps));
    return std::make_unique<Unopened>(info);
  }
  auto film = std::make_unique<capture::Film>(*rig.source, config);
  rig.recording = nullptr;
  rig.source.reset();
  return film;
}

fs::path state_directory(const config::Configuration& configuration) {
  if (!configuration.service.state_directory.empty()) return configuration.service.state_directory;
  // Of systemd: one or several, colons between.
  if (const char* given = std::getenv("STATE_DIRECTORY")) {
    const std::string all = given;
    return all.substr(0, all.find(':'));
  }
  const char* home = std::getenv("HOME");
  if (home == nullptr) {
    throw config::Error("service.state_directory: not set, and neither are $STATE_DIRECTORY and $HOME: give it");
  }
  return fs::path(home) / ".local/state/stereotrack";
}

void log_missing(const std::vector<runtime::Missing>& missing) {
  for (const runtime::Missing& right : missing) {
    log(LogLevel::kWarning, "not real-time: " + right.what + "; to grant it: " + right.grant,
        {{"STEREOTRACK_CAUSE", "rights"}});
  }
}

[[noreturn]] void refuse(const runtime::Missing& missing) {
  throw std::runtime_error("realtime.mode = \"enforce\": " + missing.what + "; to grant it: " + missing.grant +
                           "; or set realtime.mode = \"try\"");
}

std::string summary_of(const capture::SourceInfo& info, const config::Configuration& configuration,
                       std::uint64_t session) {
  return formatted("%s %dx%d at %.1f pairs/s, latency %.1f ms, preset %s, session %llu", info.name.c_str(), info.width,
                   info.height, 1.0 / std::chrono::duration<double>(info.period).count(),
                   configuration.latency.output_ms, configuration.preset.c_str(),
                   static_cast<unsigned long long>(session));
}

// SIGUSR1.
void record_now(const config::Configuration& configuration, daemon::Daemon& daemon) {
  record::BlackBox* box = daemon.black_box();
  if (box == nullptr || !configuration.record.on_signal) {
    log(LogLevel::kWarning, "SIGUSR1: nothing is recorded: record.on or record.on_signal is false",
        {{"STEREOTRACK_CAUSE", "record"}});
    return;
  }
  box->trigger(record::kDemand);
  log(LogLevel::kInfo, "SIGUSR1: recording", {{"STEREOTRACK_CAUSE", "record"}});
}

int run(const Arguments& arguments) {
  if (arguments.safe_lines) {
    return daemon::make_lines_safe(arguments.config, arguments.set, state_directory) ? 0 : kFailed;
  }
  Rig rig;
  rig.loaded = load_configuration(arguments.config, arguments.set);
  // Until there is somebody to read them, they must not end the program; SIGTERM may.
  if (!arguments.check) {
    for (const int signal : {SIGHUP, SIGUSR1}) (void)std::signal(signal, SIG_IGN);
  }
  config::Configuration configuration = rig.configuration();

  // Before the source is opened, which may take long.
  daemon::Daemon::Parts parts;
  (void)telemetry::parse_endpoints(configuration.telemetry.destinations);
  if (!configuration.metrics.listen.empty()) {
    try {
      (void)telemetry::parse_endpoint(configuration.metrics.listen, true);
    } catch (const telemetry::EndpointError& error) {
      throw config::error_at(rig.loaded.origins, "metrics.listen", error.what());
    }
  }
  const config::SourceConfig& source = configuration.source;
  for (const auto& [key, is_set] : {std::pair{"source.flip", source.flip},
                                    {"source.swap", source.swap},
                                    {"source.shift_rows", source.shift_rows != 0}}) {
    if (!is_set) continue;
    throw config::error_at(rig.loaded.origins, key,
                           "only stereotrack replay does that: scenes and recordings of ours need none, leave it out");
  }
  if (!configuration.telemetry.key_file.empty()) {
    parts.signer =
        std::make_unique<telemetry::Signer>(telemetry::load_key_file(configuration.telemetry.key_file).front());
  }
  const daemon::Inputs::Setup inputs = daemon::input_setup(configuration);
  parts.configuration = &configuration;
  fs::path state;
  std::unique_ptr<daemon::TakenLines> taken;
  if (!arguments.check) {
    state = state_directory(configuration);
    fs::create_directories(state);
    // After a crash they are anywhere, and cameras and scenes take seconds: requested in their safe states before that.
    taken = std::make_unique<daemon::TakenLines>(state, configuration);
    parts.lines = gpio::open_lines(signals::line_specs(configuration), "stereotrackd");
  }
  parts.source = open_source(rig, arguments.check, parts);
  parts.calibration = rig.calibration && parts.source->info().stereo ? &*rig.calibration : nullptr;
  parts.unit_m = rig.unit_m;
  parts.plan = daemon::make_plan(configuration, rig.unit_m);
  parts.program = std::string("stereotrackd ") + STEREOTRACK_VERSION;
  const capture::SourceInfo info = parts.source->info();
  if (arguments.check) {
    const daemon::Daemon daemon(std::move(parts));
    std::cout << arguments.config << ": " << info.name << ' ' << info.width << 'x' << info.height << ' '
              << (has_colour(info.format) ? "colour" : "grey") << ' ' << (info.stereo ? "stereo" : "mono")
              << ", preset " << configuration.preset << ": configuration, calibration and source are fine\n";
    print_memory(std::cout, daemon.memory());
    return 0;
  }

  // Before inputs and sockets are taken: a rig that is not granted what it needs must not look alive.
  std::unique_ptr<runtime::RealTimeProcess> process;
  std::vector<runtime::Missing> missing;
  const bool enforce = configuration.realtime.mode == config::RealTimeMode::kEnforce;
  if (configuration.realtime.mode != config::RealTimeMode::kOff) {
    process = std::make_unique<runtime::RealTimeProcess>(
        runtime::RealTimeProcess::Config{.deep_sleep = configuration.realtime.deep_sleep, .until_exit = true});
    missing = process->missing();
    if (enforce && !missing.empty()) refuse(missing.front());
  }
  const std::string& named = configuration.record.directory;
  parts.recordings = named.empty() ? (state / "recordings").string() : named;
  if (configuration.record.on) {
    fs::create_directories(parts.recordings);
    for (const std::string& line : record::keep_torn(parts.recordings)) {
      log(LogLevel::kNotice, "recording: " + line, {{"STEREOTRACK_CAUSE", "record"}});
    }
  }
  parts.session = telemetry::next_session(state);
  parts.inputs = daemon::Inputs(inputs);

  const std::uint64_t session = parts.session;
  daemon::Daemon daemon(std::move(parts));
  const daemon::Panic panic(daemon, (state / "last_states.txt").string());
  daemon::Service service(
      {.metrics = configuration.metrics,
       .session = session,
       .log_targets = configuration.service.log_targets,
       .unit_m = rig.unit_m,
       .summary = summary_of(info, configuration, session),
       .reload = [&] { daemon::reload(arguments.config, arguments.set, rig.unit_m, configuration, daemon); },
       .record = [&] { record_now(configuration, daemon); }});
  const std::vector<runtime::Missing> of_threads = daemon.start(configuration.realtime, !missing.empty());
  if (enforce && !of_threads.empty()) refuse(of_threads.front());
  missing.insert(missing.end(), of_threads.begin(), of_threads.end());
  log_missing(missing);
  service.run(daemon);
  return 0;
}

int parse_and_run(int argc, char** argv) {
  CLI::App app("Tracks moving objects with a stereo rig, in real time.", "stereotrackd");
  app.set_version_flag("--version", std::string("stereotrackd ") + STEREOTRACK_VERSION);
  Arguments arguments;
  app.add_option("--config", arguments.config, "configuration (TOML)")->required();
  app.add_option("--set", arguments.set, "KEY=VALUE, wins over the file; may be given again")->allow_extra_args(false);
  app.add_flag("--check-config", arguments.check,
               "only checks configuration, calibration and source, and prints the memory by stage");
  app.add_flag("--safe-lines", arguments.safe_lines,
               "only drives all GPIO lines to their safe states, after a crash: ExecStopPost of the unit");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) return app.exit(error);
    std::cerr << "stereotrackd: " << error.what() << " (see stereotrackd --help)\n";
    return kBadUsage;
  }
  try {
    return run(arguments);
  } catch (const config::Error& error) {
    log(LogLevel::kError, error.what());
    return kBadUsage;
  } catch (const telemetry::EndpointError& error) {
    log(LogLevel::kError, error.what());
    return kBadUsage;
  } catch (const telemetry::KeyFileError& error) {
    log(LogLevel::kError, error.what());
    return kBadUsage;
  } catch (const std::exception& error) {
    log(LogLevel::kError, error.what());
    return kFailed;
  }
}

}  // namespace
}  // namespace stereotrack

int main(int argc, char** argv) { return stereotrack::parse_and_run(argc, argv); }
