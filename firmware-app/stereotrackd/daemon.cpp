#include "firmware-app/stereotrackd/daemon.hpp"

#include <bit>
#include <chrono>
#include <cstring>
#include <new>
#include <stdexcept>
#include <thread>
#include <utility>

#include "config/error.hpp"
#include "config/milliseconds.hpp"
#include "config/schema.hpp"
#include "config/zones.hpp"
#include "firmware-app/rig/rig.hpp"
#include "firmware-app/runtime/clock.hpp"
#include "firmware-app/stereotrackd/log.hpp"
#include "firmware-app/stereotrackd/trigger_rt.hpp"

namespace stereotrack::daemon {

namespace {

constexpr std::chrono::milliseconds kRecorderPatience{500};
constexpr std::chrono::milliseconds kRecorderRound{20};

runtime::RealTimeMode mode_of(config::RealTimeMode mode) {
  switch (mode) {
    case config::RealTimeMode::kEnforce: return runtime::RealTimeMode::kEnforce;
    case config::RealTimeMode::kTry: return runtime::RealTimeMode::kTry;
    case config::RealTimeMode::kOff: break;
  }
  return runtime::RealTimeMode::kOff;
}

runtime::ThreadPlan plan_of(const char* name, const config::ThreadConfig& config) {
  return {name, config.priority, config.core};
}

runtime::OutputSchedule::Config schedule_config(const config::LatencyConfig& latency, std::chrono::nanoseconds period) {
  runtime::OutputSchedule::Config schedule;
  schedule.latency = config::from_ms(latency.output_ms);
  schedule.period = period;
  schedule.lead = config::from_ms(latency.lead_ms);
  // Under a period by nature: later than that, the next slot is due.
  schedule.grace = std::min<std::chrono::nanoseconds>(config::from_ms(latency.grace_ms), period / 2);
  schedule.oldest_state = config::from_ms(latency.output_ms + latency.stale_ms);
  schedule.missing_limit = latency.missing_limit;
  return schedule;
}

record::BlackBox::Config box_config(const config::RecordConfig& record, const std::string& recordings,
                                    const config::LatencyConfig& latency) {
  return {.seconds = record.seconds,
          .seconds_after = record.seconds_after,
          .reduce = record.reduce,
          .every = record.every,
          .directory = record.directory.empty() ? recordings : record.directory,
          .max_bytes = static_cast<std::uint64_t>(record.max_mb) << 20U,
          .patience = 20 + static_cast<int>(config::from_ms(latency.output_ms) / kRecorderRound)};
}

/// What the publisher may trigger; the others are the main thread's.
std::uint32_t causes_of(const config::RecordConfig& record) {
  return (record.on_deadline ? record::kDeadlineMiss : 0U) | (record.on_zone ? record::kTargetInZone : 0U);
}

}  // namespace

runtime::EffortController::Config effort_config(const config::ShedConfig& shed) {
  runtime::EffortController::Config made;
  made.shed_above = shed.above;
  made.restore_below = shed.below;
  made.shed_after = shed.after_frames;
  made.restore_after = shed.restore_frames;
  made.patience_most = std::max(made.patience_most, shed.restore_frames);
  for (const std::string& name : shed.order) {
    for (std::size_t i = 0; i < kEfforts; ++i) {
      if (name == to_string(static_cast<Effort>(i))) (void)made.order.push(static_cast<Effort>(i));
    }
  }
  return made;
}

Daemon::Daemon(Parts parts)
    : vitals_(std::make_unique<Vitals>()),
      source_(std::move(parts.source)),
      train_(std::move(parts.train)),
      pwm_(std::move(parts.pwm)),
      lines_(std::move(parts.lines)),
      inputs_(std::move(parts.inputs)),
      signer_(std::move(parts.signer)),
      pool_(parts.pool_slots),
      outlet_(pool_, notices_, bell_),
      mailbox_(std::make_unique<OutcomeMailbox>()) {
  const config::Configuration& configuration = *parts.configuration;
  const capture::SourceInfo& info = source_->info();
  Publisher::Config publishing;
  publishing.schedule = schedule_config(configuration.latency, info.period);
  if (publishing.schedule.latency / info.period > static_cast<int>(runtime::OutputSchedule::kMaxInFlight / 2)) {
    throw config::Error("latency.output_ms: more than " + std::to_string(runtime::OutputSchedule::kMaxInFlight / 2) +
                        " pairs would be on their way at once: shorten it, or lower the rate of the source");
  }
  if (publishing.schedule.lead > info.period / 2) {
    throw config::Error("latency.lead_ms: over half of the source's period of " +
                        std::to_string(info.period.count() / 1'000'000) +
                        " ms, decisions would overtake each other: shorten it");
  }
  publishing.encoder = {.rig = configuration.telemetry.rig_id, .session = parts.session, .signer = signer_.get()};
  publishing.extrapolation = {.width = info.width, .height = info.height};
  publishing.unit_m = parts.unit_m;
  if (parts.calibration != nullptr) {
    publishing.focal_x_px = parts.calibration->left.fx;
    publishing.focal_y_px = parts.calibration->left.fy;
  }
  publishing.heart_after = config::from_ms(configuration.latency.stale_ms);
  publishing.late_after = config::from_ms(configuration.latency.late_ms);
  publishing.awake = config::from_ms(configuration.latency.awake_ms);
  publishing.train = train_ ? &train_->counters() : nullptr;
  publishing.pool_slots = parts.pool_slots;
  publishing.skew_limit = config::from_ms(configuration.camera.skew_limit_ms);
  publishing.exposure_limit = configuration.camera.exposure_limit_percent / 100;
  auto publisher = Publisher::create(publishing, std::move(parts.plan), lines_, pool_, notices_, *mailbox_, bell_,
                                     *source_, *vitals_);
  if (!publisher.has_value()) {
    throw config::Error("latency: no schedule fits " + info.name + ": " + to_string(publisher.error()));
  }
  publisher_ = std::move(*publisher);
  awake_ = publishing.awake;

  const Result<runtime::EffortController> effort = runtime::EffortController::create(effort_config(configuration.shed));
  if (!effort.has_value()) throw config::Error(std::string("shed: ") + to_string(effort.error()));
  frames_ = std::make_unique<FrameLoop>(FrameLoop::Config{.latency = publishing.schedule.latency,
                                                          .lead = publishing.schedule.lead,
                                                          .period = info.period,
                                                          .also = parts.also},
                                        *effort, pool_, *mailbox_, bell_, *source_, *vitals_);
  frames_->tell(&target_notes_);
  pipeline_ = std::make_unique<Pipeline>(make_pipeline(config::pipeline_of(configuration, parts.unit_m),
                                                       parts.calibration, info, arena_, frames_->observer()));
  arena_.seal();
  if (configuration.record.on) {
    record::BlackBox::Run run;
    run.about.source = info.name;
    run.about.program = parts.program;
    run.about.width = info.width;
    run.about.height = info.height;
    run.about.format = info.format;
    run.about.stereo = info.stereo;
    run.about.period_ns = info.period.count();
    run.about.rig = configuration.telemetry.rig_id;
    run.about.session = parts.session;
    run.about.unit_m = parts.unit_m;
    if (parts.calibration != nullptr) run.calibration = *parts.calibration;
    run.configuration = config::to_text(configuration);
    box_ = std::make_unique<record::BlackBox>(box_config(configuration.record, parts.recordings, configuration.latency),
                                              std::move(run), *pipeline_);
    frames_->keep_in(box_.get());
    publisher_->keep_in(box_.get(), causes_of(configuration.record));
  }
}

Daemon::~Daemon() { stop(); }

std::vector<runtime::Missing> Daemon::start(const config::RealTimeConfig& real_time, bool missing_before) {
  const runtime::RealTimeMode mode = mode_of(real_time.mode);
  std::vector<runtime::Missing> missing;
  const auto make = [&](const char* name, const config::ThreadConfig& config, std::function<void()> body) {
    auto thread = std::make_unique<runtime::Thread>(plan_of(name, config), mode, std::move(body));
    missing.insert(missing.end(), thread->missing().begin(), thread->missing().end());
    return thread;
  };
  // Who takes before who gives.
  if (box_) {
    // A thread of its own: a disk that hangs must not keep the main thread from ending the daemon.
    recorder_ = make("st-recorder", real_time.service, [this] { record(); });
  }
  threads_.push_back(
      make("st-publisher", real_time.publisher, [this] { publisher_->run(capture_end_.ended, stop_publisher_); }));
  threads_.push_back(make("st-frames", real_time.frames, [this] { frames_->run(*pipeline_, stop_capture_); }));
  threads_.push_back(make("st-capture", real_time.capture,
                          [this] { capture(*source_, outlet_, pool_, *vitals_, capture_end_, stop_capture_); }));
  if (train_) {
    threads_.push_back(
        make("st-trigger", real_time.trigger, [this] { give_pulses(*train_, *vitals_, awake_, stop_trigger_); }));
  }
  // The caller is the service thread. Last: threads inherit.
  const auto of_service = runtime::set_up_this_thread(plan_of("service", real_time.service), mode);
  missing.insert(missing.end(), of_service.begin(), of_service.end());
  if (mode == runtime::RealTimeMode::kEnforce && !missing.empty()) {
    threads_.clear();
    recorder_.reset();
    return missing;
  }
  if (missing_before || !missing.empty()) publisher_->say_always(telemetry::kHealthNotRealTime);
  if (recorder_) recorder_->begin();
  for (const auto& thread : threads_) thread->begin();
  if (pwm_) pwm_->start();
  return missing;
}

void Daemon::record() {
  std::string told;
  while (!stop_recorder_.load(std::memory_order_relaxed)) {
    while (box_->service_step() && !stop_recorder_.load(std::memory_order_relaxed)) {
    }
    if (box_->last_error() != told) {
      told = box_->last_error();
      if (!told.empty()) log(LogLevel::kWarning, "recording: " + told, {{"STEREOTRACK_CAUSE", "record"}});
    }
    std::this_thread::sleep_for(kRecorderRound);
  }
}

void Daemon::tend(MonotonicTime now) {
  inputs_.take(box_.get());
  inputs_.tend(now);
  vitals_->inputs_gone.set(static_cast<std::uint64_t>(std::popcount(inputs_.gone())));
  look_after(lines_, outputs_care_, now);
  if (train_) look_after(train_->lines(), train_care_, now);
}

void Daemon::look_after(gpio::OutputLines& lines, LineCare& care, MonotonicTime now) {
  care.tell(
      lines.failing(), [&](std::size_t i) { return to_string(lines.name(i)); }, std::strerror(lines.last_error()), now);
  const gpio::LineBits gone = lines.gone();
  // Where nothing is gone it frees what was given up, and does nothing else.
  if (!care.is_due(gone, now) && gone != 0) return;
  std::string why;
  (void)lines.reopen(&why);
  if (!why.empty()) care.cannot(why);
}

bool Daemon::make_lines_safe() noexcept {
  // What people may stand beside first.
  const bool outputs = lines_.hold_safe();
  const bool pulses = !train_ || train_->lines().hold_safe();
  const bool pwm = !pwm_ || pwm_->hold_safe();
  return outputs && pulses && pwm;
}

bool Daemon::stop() noexcept {
  stop_trigger_.store(true, std::memory_order_relaxed);
  if (pwm_ && !pwm_->stop()) {
    log(LogLevel::kError, "PWM " + pwm_->name() + ": does not stop", {{"STEREOTRACK_CAUSE", "trigger"}});
  }
  stop_capture_.store(true, std::memory_order_relaxed);
  pool_.close();
  stop_publisher_.store(true, std::memory_order_relaxed);
  bell_.ring();
  stop_recorder_.store(true, std::memory_order_relaxed);
  for (const auto& thread : threads_) thread->join();
  threads_.clear();
  // Their threads could not drive a chip that was gone and may be back: its lines are requested in their safe states.
  for (gpio::OutputLines* lines : {&lines_, train_ ? &train_->lines() : nullptr}) {
    if (lines == nullptr || lines->gone() == 0) continue;
    try {
      (void)lines->reopen();
      (void)lines->set_safe(runtime::monotonic_now());
    } catch (const std::bad_alloc&) {
      log(LogLevel::kError, "GPIO outputs: no memory to ask for a chip that was gone: its lines stay as they are",
          {{"STEREOTRACK_CAUSE", "line"}});
    }
  }
  return !recorder_ || recorder_->join_for(kRecorderPatience);
}

bool Daemon::is_over() const noexcept {
  return publisher_->has_finished() || capture_end_.failed.load(std::memory_order_acquire);
}

std::string Daemon::failure() const {
  return capture_end_.failed.load(std::memory_order_acquire) ? source_->failure() : std::string();
}

}  // namespace stereotrack::daemon
