#include "firmware-app/stereotrackd/service.hpp"

#include <poll.h>
#include <sys/signalfd.h>
#include <systemd/sd-daemon.h>
#include <unistd.h>

#include <cerrno>
#include <cmath>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <stdexcept>
#include <string_view>
#include <utility>

#include "firmware-app/runtime/clock.hpp"
#include "firmware-app/stereotrackd/log.hpp"
#include "firmware-app/stereotrackd/metrics.hpp"

namespace stereotrack::daemon {

namespace {

constexpr std::chrono::milliseconds kRound{100};
constexpr int kTargetLines = 20;  // a second: a swarm must not fill a disk

sigset_t signals_of_the_service() {
  sigset_t wanted;
  sigemptyset(&wanted);
  for (const int signal : {SIGTERM, SIGINT, SIGHUP, SIGUSR1}) sigaddset(&wanted, signal);
  return wanted;
}

std::string efforts_text(std::uint64_t bits) {
  std::string text;
  for (std::size_t i = 0; i < kEfforts; ++i) {
    const auto effort = static_cast<Effort>(i);
    if (!leaves_out(static_cast<EffortBits>(bits), effort)) continue;
    text += (text.empty() ? "" : ", ") + std::string(to_string(effort));
  }
  return text.empty() ? "nothing" : text;
}

}  // namespace

Service::Service(const Config& config) : config_(config) {
  const sigset_t wanted = signals_of_the_service();
  // A telemetry or metrics peer that goes away must not end the daemon.
  (void)std::signal(SIGPIPE, SIG_IGN);
  if (pthread_sigmask(SIG_BLOCK, &wanted, nullptr) != 0) throw std::runtime_error("signals cannot be blocked");
  signals_ = signalfd(-1, &wanted, SFD_CLOEXEC | SFD_NONBLOCK);
  if (signals_ < 0) throw std::runtime_error(std::string("signals cannot be read: ") + std::strerror(errno));
  if (!config_.metrics.listen.empty()) server_ = std::make_unique<MetricsServer>(config_.metrics.listen);
  std::uint64_t us = 0;
  if (sd_watchdog_enabled(0, &us) > 0) watchdog_ = std::chrono::microseconds(us);
}

Service::~Service() {
  if (signals_ >= 0) (void)close(signals_);
}

bool Service::take_signals() {
  // All of them first: SIGTERM counts, however many SIGHUPs came before it, and of these one is enough.
  signalfd_siginfo info{};
  bool wants_reload = false;
  bool wants_record = false;
  int ends = 0;
  while (read(signals_, &info, sizeof info) == sizeof info) {
    const int signal = static_cast<int>(info.ssi_signo);
    wants_reload = wants_reload || signal == SIGHUP;
    wants_record = wants_record || signal == SIGUSR1;
    if (signal == SIGTERM || signal == SIGINT) ends = signal;
  }
  if (ends != 0) {
    log(LogLevel::kInfo, std::string(strsignal(ends)) + ": ending");
    return false;
  }
  if (wants_record && config_.record) config_.record();
  if (wants_reload && config_.reload) {
    (void)sd_notify(0, "RELOADING=1");
    config_.reload();
    (void)sd_notify(0, "READY=1");
  }
  return true;
}

void Service::feed_watchdog(const Daemon& daemon) {
  if (!watchdog_ || Clock::now() - fed_ < *watchdog_ / 3) return;
  const Vitals& vitals = daemon.vitals();
  const std::array<std::uint64_t, 4> now{vitals.capture_beats.get(), vitals.frame_beats.get(),
                                         vitals.publisher_beats.get(), vitals.trigger_beats.get()};
  const std::size_t threads = daemon.train() == nullptr ? 3 : 4;
  for (std::size_t i = 0; i < threads; ++i) {
    if (now[i] == beats_[i]) return;  // not fed: systemd restarts the daemon if that goes on
  }
  beats_ = now;
  fed_ = Clock::now();
  (void)sd_notify(0, "WATCHDOG=1");
}

void Service::log_changes(const Daemon& daemon) {
  const Vitals& vitals = daemon.vitals();
  if (const std::uint64_t now = vitals.efforts_left_out.get(); now != efforts_) {
    efforts_ = now;
    log(LogLevel::kNotice, "frames leave out: " + efforts_text(now), {{"STEREOTRACK_CAUSE", "effort"}});
  }
  const std::uint64_t health = vitals.health.get();
  const auto log_alarm = [&](std::uint64_t bit, const char* cause, const char* begins, const char* ends) {
    if (((health ^ health_) & bit) == 0) return;
    const bool is_on = (health & bit) != 0;
    log(is_on ? LogLevel::kWarning : LogLevel::kNotice, is_on ? begins : ends, {{"STEREOTRACK_CAUSE", cause}});
  };
  log_alarm(telemetry::kHealthSkew, "skew", "cameras: pairs are further apart than camera.skew_limit_ms",
            "cameras: pairs are within camera.skew_limit_ms again");
  log_alarm(telemetry::kHealthExposuresDiffer, "exposure",
            "cameras: left and right are exposed differently, by more than camera.exposure_limit_percent",
            "cameras: left and right are exposed alike again");
  log_alarm(
      telemetry::kHealthWrongPairs, "wrong_pair",
      "cameras: what moves tells that left and right pictures are of different instants; is a frame lost on its way?",
      "cameras: left and right pictures are of one instant again");
  health_ = health;
  if (const record::BlackBox* box = daemon.black_box()) {
    const std::uint64_t recordings = box->counters().recordings.load();
    if (const std::uint64_t by = recordings - std::exchange(recordings_, recordings); by > 0) {
      log(LogLevel::kNotice, std::to_string(by) + " recording written", {{"STEREOTRACK_CAUSE", "record"}});
    }
  }
}

void Service::log_counts(const Daemon& daemon, bool last) {
  const MonotonicTime now = runtime::monotonic_now();
  const auto log_count = [&](PacedCount& paced, std::uint64_t total, LogLevel level, const char* before,
                             const char* what, const char* cause) {
    const auto told = paced.tell(total, now, last);
    if (!told) return;
    const std::string count = std::to_string(told->count);
    const auto seconds = std::llround(std::chrono::duration<double>(told->span).count());
    const std::string span = seconds > 1 ? std::to_string(seconds) + " s" : "second";
    log(level, std::string(before) + count + ' ' + what + " in the last " + span,
        {{"STEREOTRACK_CAUSE", cause}, {"STEREOTRACK_COUNT", count}});
  };
  const Vitals& vitals = daemon.vitals();
  for (std::size_t i = 0; i < kScheduleCounters.size(); ++i) {
    const char* const name = kScheduleCounters[i].name;
    if (std::string_view(name) == "on_time") continue;
    log_count(schedule_[i], vitals.schedule[i].get(), LogLevel::kWarning, "outputs: ", name, name);
  }
  log_count(allocations_, vitals.allocations(), LogLevel::kError, "", "heap calls in real-time threads", "heap");
  log_count(telemetry_failed_, vitals.telemetry_failed.get(), LogLevel::kWarning, "", "datagrams found no way",
            "telemetry");
  log_count(frames_refused_, vitals.frames_refused.get(), LogLevel::kError, "", "pairs were refused by the pipeline",
            "pipeline");
  if (const trigger::PulseTrain* train = daemon.train()) {
    log_count(pulses_skipped_, train->counters().skipped.get(), LogLevel::kWarning,
              "trigger: ", "pulses were slept over and skipped", "trigger");
  }
  if (const record::BlackBox* box = daemon.black_box()) {
    const record::BlackBox::Counters& counters = box->counters();
    log_count(recordings_lost_, counters.recordings_failed.load() + counters.triggers_dropped.load(),
              LogLevel::kWarning, "", "recordings were dropped, for one was being written, or failed", "record");
  }
}

void Service::tend(Daemon& daemon) {
  daemon.tend(runtime::monotonic_now());
  using Weight = capture::SourceNote::Weight;
  for (const capture::SourceNote& note : daemon.tend_source()) {
    const LogLevel level = note.weight == Weight::kError     ? LogLevel::kError
                           : note.weight == Weight::kWarning ? LogLevel::kWarning
                                                             : LogLevel::kNotice;
    if (*note.camera == '\0') {
      log(level, note.text, {{"STEREOTRACK_CAUSE", note.cause}});
    } else {
      log(level, note.text, {{"STEREOTRACK_CAUSE", note.cause}, {"STEREOTRACK_CAMERA", note.camera}});
    }
  }
}

void Service::log_targets(Daemon& daemon) {
  TargetNote note;
  while (daemon.target_notes().take(note)) {
    if (!config_.log_targets) continue;
    if (++target_lines_ > kTargetLines) {
      ++targets_not_told_;
      continue;
    }
    log(LogLevel::kInfo, text_of(note, config_.unit_m),
        {{"STEREOTRACK_CAUSE", "target"}, {"STEREOTRACK_TRACK", std::to_string(note.id)}});
  }
}

void Service::every_second(Daemon& daemon, bool last) {
  target_lines_ = 0;
  log_targets(daemon);
  const std::uint64_t left_out = daemon.target_notes().left_out();
  targets_not_told_ += config_.log_targets ? left_out - target_notes_left_out_ : 0;
  target_notes_left_out_ = left_out;
  if (targets_not_told_ > 0) {
    log(LogLevel::kInfo, "targets came or went " + std::to_string(targets_not_told_) + " times more",
        {{"STEREOTRACK_CAUSE", "target"}, {"STEREOTRACK_COUNT", std::to_string(targets_not_told_)}});
    targets_not_told_ = 0;
  }
  log_changes(daemon);
  log_counts(daemon, last);
  const Vitals& vitals = daemon.vitals();
  (void)sd_notifyf(0, "STATUS=%s; %llu pairs, %llu targets, compute p99 %.1f ms, send error p99 %.0f us, health %llu",
                   config_.summary.c_str(), static_cast<unsigned long long>(vitals.frames.get()),
                   static_cast<unsigned long long>(vitals.targets.get()),
                   static_cast<double>(vitals.compute.percentile_ns(0.99)) * 1e-6,
                   static_cast<double>(vitals.send_error.percentile_ns(0.99)) * 1e-3,
                   static_cast<unsigned long long>(vitals.health.get()));
  if (!server_ && config_.metrics.file.empty()) return;
  std::string text = metrics_text(daemon, config_.session);
  if (!config_.metrics.file.empty()) {
    const bool written = write_metrics_file(config_.metrics.file, text);
    if (!written && !metrics_file_failed_) {
      log(LogLevel::kWarning, "metrics.file " + config_.metrics.file + ": " + std::strerror(errno) +
                                  ": goes on without, and tries again every second");
    }
    metrics_file_failed_ = !written;
  }
  if (server_) server_->show(std::move(text));
}

void Service::run(Daemon& daemon) {
  if (server_) {
    server_->show(metrics_text(daemon, config_.session));
    log(LogLevel::kInfo, "figures at http://" + server_->where() + "/metrics");
  }
  log(LogLevel::kInfo, config_.summary);
  (void)sd_notify(0, "READY=1");
  Clock::time_point next = Clock::now();
  while (take_signals() && !daemon.is_over()) {
    feed_watchdog(daemon);
    tend(daemon);
    log_targets(daemon);
    if (Clock::now() >= next) {
      every_second(daemon);
      next = std::max(next + std::chrono::seconds(1), Clock::now());
    }
    std::array<pollfd, 2> ready{{{signals_, POLLIN, 0}, {daemon.inputs().descriptor(), POLLIN, 0}}};
    (void)poll(ready.data(), ready.size(), static_cast<int>(kRound.count()));
  }
  (void)sd_notify(0, "STOPPING=1");
  const bool stopped = daemon.stop();
  every_second(daemon, true);
  if (!stopped) {
    // Nothing can end a write that hangs but the end of the process; all that matters has ended already.
    log(LogLevel::kWarning, "a recording hangs in its write and is lost: is the disk alive?",
        {{"STEREOTRACK_CAUSE", "record"}});
    std::_Exit(daemon.failure().empty() ? 0 : 1);
  }
  if (const std::string failure = daemon.failure(); !failure.empty()) throw std::runtime_error(failure);
}

}  // namespace stereotrack::daemon
