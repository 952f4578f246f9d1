#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "config/configuration.hpp"
#include "firmware-app/runtime/output_schedule.hpp"
#include "firmware-app/stereotrackd/daemon.hpp"
#include "firmware-app/stereotrackd/metrics_server.hpp"
#include "firmware-app/stereotrackd/paced_count.hpp"

namespace stereotrack::daemon {

/// What the main thread does while the others run: reads signals and edges of inputs, asks for GPIO chips that went,
/// logs what the counters say, serves figures, tells systemd that the daemon is ready and alive. It may block, allocate
/// and throw; nothing waits for it.
///
/// The watchdog is fed only while all three threads, and the trigger's, go round: their beats must have risen since the
/// last time.
class Service {
 public:
  struct Config {
    config::MetricsConfig metrics;
    std::uint64_t session = 0;
    bool log_targets = true;       ///< a line for each that comes or goes
    double unit_m = 0;             ///< metres in the calibration's unit; 0: not known
    std::string summary;           ///< one line for the log and systemd: what runs
    std::function<void()> reload;  ///< SIGHUP
    std::function<void()> record;  ///< SIGUSR1
  };

  /// Blocks the signals that it reads, in this thread and all that begin later. Throws std::runtime_error.
  explicit Service(const Config& config);
  Service(const Service&) = delete;
  Service& operator=(const Service&) = delete;
  ~Service();

  /// Until SIGTERM or SIGINT, or the daemon is over. Throws std::runtime_error where the source failed.
  void run(Daemon& daemon);

 private:
  using Clock = std::chrono::steady_clock;

  /// False: it is time to go.
  [[nodiscard]] bool take_signals();
  /// `last`: the daemon ends, so nothing waits for a later line.
  void every_second(Daemon& daemon, bool last = false);
  void log_changes(const Daemon& daemon);
  void log_counts(const Daemon& daemon, bool last);
  void tend(Daemon& daemon);
  void log_targets(Daemon& daemon);
  void feed_watchdog(const Daemon& daemon);

  Config config_;
  int signals_ = -1;
  std::unique_ptr<MetricsServer> server_;
  bool metrics_file_failed_ = false;
  std::optional<std::chrono::microseconds> watchdog_;
  Clock::time_point fed_{};
  std::array<std::uint64_t, 4> beats_{};
  std::array<PacedCount, kScheduleCounters.size()> schedule_{};
  int target_lines_ = 0;  // of this second
  std::uint64_t targets_not_told_ = 0;
  std::uint64_t target_notes_left_out_ = 0;
  std::uint64_t efforts_ = 0;
  std::uint64_t health_ = 0;
  PacedCount allocations_;
  PacedCount telemetry_failed_;
  PacedCount frames_refused_;
  PacedCount pulses_skipped_;
  PacedCount recordings_lost_;
  std::uint64_t recordings_ = 0;
};

}  // namespace stereotrack::daemon
