#include "firmware-app/stereotrack/doctor/judge.hpp"

#include <algorithm>
#include <cmath>
#include <string_view>

#include "drivers/capture/v4l2/v4l2.hpp"
#include "firmware-app/formatted.hpp"
#include "firmware-app/stereotrack/doctor/words.hpp"

namespace stereotrack::doctor {

namespace {

constexpr double kHot_c = 80;
constexpr std::int64_t kLittleMemory_mb = 200;  ///< pipelines of usual sizes, buffers of cameras and a black box

class Judge {
 public:
  explicit Judge(const Findings& findings) : f_(findings) {}

  std::vector<Item> all() && {
    kernel();
    cpu();
    memory();
    rights();
    clock();
    gpio();
    pwm();
    cameras();
    configuration();
    capture();
    sync();
    wake_up();
    line();
    compute();
    latency();
    return std::move(items_);
  }

 private:
  void ok(const char* topic, std::string text) { items_.push_back({topic, Verdict::kOk, std::move(text), {}, {}}); }
  void note(const char* topic, std::string text, std::string way_out, std::string command = {}) {
    items_.push_back({topic, Verdict::kNote, std::move(text), std::move(way_out), std::move(command)});
  }
  void problem(const char* topic, std::string text, std::string way_out, std::string command = {}) {
    items_.push_back({topic, Verdict::kProblem, std::move(text), std::move(way_out), std::move(command)});
  }

  void kernel() {
    const KernelFacts& k = f_.kernel;
    const std::string what = joined({k.release, k.architecture}, " ");
    switch (k.preemption) {
      case Preemption::kRealTime: ok("kernel", what + ", PREEMPT_RT"); return;
      case Preemption::kFull: ok("kernel", what + ", preemption " + to_string(k.preemption)); return;
      case Preemption::kUnknown:
        ok("kernel", what + ", preemption as it was started with: only root may read /sys/kernel/debug/sched/preempt");
        return;
      default: break;
    }
    note("kernel", what + ", preemption " + to_string(k.preemption) + ": threads may wait for milliseconds",
         "install a kernel with PREEMPT_RT and reboot", rt_kernel_command(k));
  }

  static std::string rt_kernel_command(const KernelFacts& kernel) {
    // Only Debian's own names are known; other builds have their packages under names of their own.
    const bool is_debian = kernel.version.find("Debian") != std::string::npos;
    if (is_debian && kernel.release.ends_with("-arm64")) return "sudo apt install linux-image-rt-arm64";
    if (is_debian && kernel.release.ends_with("-amd64")) return "sudo apt install linux-image-rt-amd64";
    return "apt-cache search linux-image | grep -e -rt";
  }

  void cpu() {
    const CpuFacts& c = f_.cpu;
    std::string what = count_text(c.cores, "core");
    if (c.max_mhz > 0) what += " to " + std::to_string(c.max_mhz) + " MHz";
    if (!c.isolated.empty()) what += ", isolated " + c.isolated;
    if (c.hottest_c) what += ", " + formatted("%.0f C", *c.hottest_c);
    const bool steady = std::all_of(c.governors.begin(), c.governors.end(),
                                    [](const std::string& governor) { return governor == "performance"; });
    if (steady) {
      ok("cpu", what + (c.governors.empty() ? ", nothing changes their frequency" : ", governor performance"));
    } else {
      note("cpu", what + ", governor " + joined(c.governors, ", ") + ": after each pause cores are slow at first",
           "keep the frequency high, at each boot anew",
           "echo performance | sudo tee /sys/devices/system/cpu/cpufreq/policy*/scaling_governor");
    }
    if (c.throttled.value_or(false)) {
      note("cpu", "was slowed down since power-on, by heat or low voltage",
           "take a stronger power supply or a heat sink; bits 0-3 are now, 16-19 since power-on",
           "vcgencmd get_throttled");
    } else if (c.hottest_c.value_or(0) >= kHot_c) {
      note("cpu", formatted("%.0f C: it will slow down by itself", *c.hottest_c), "cool it, and look again under load",
           "cat /sys/class/thermal/thermal_zone*/temp");
    }
  }

  void memory() {
    const MemoryFacts& m = f_.memory;
    std::string what = std::to_string(m.total_mb) + " MB, " + std::to_string(m.available_mb) + " free";
    if (m.cma_mb > 0) what += ", cma " + std::to_string(m.cma_mb);
    what += ", dma heaps " + (m.dma_heaps.empty() ? std::string("none") : joined(m.dma_heaps, " "));
    if (f_.pipeline && f_.pipeline->memory_mb > 0) what += formatted(", pipeline %.0f MB", f_.pipeline->memory_mb);
    if (m.total_mb > 0 && m.available_mb < kLittleMemory_mb) {
      note("memory", what + ": little is left", "stop what takes it", "ps axo rss,comm --sort -rss | head");
    } else {
      ok("memory", std::move(what));
    }
  }

  /// Threads that are refused for the same reason are one item.
  void rights() {
    const config::RealTimeConfig& wanted = f_.configuration.realtime;
    if (wanted.mode == config::RealTimeMode::kOff) {
      ok("rights", "none are asked for: realtime.mode = \"off\"");
      return;
    }
    if (f_.missing.empty()) {
      ok("rights", "priorities, locked memory and awake cores are granted to " + f_.limits.user);
      return;
    }
    const bool enforced = wanted.mode == config::RealTimeMode::kEnforce;
    const auto is_thread = [](const runtime::Missing& one) { return one.what.starts_with("thread "); };
    const auto threads = std::count_if(f_.missing.begin(), f_.missing.end(), is_thread);
    bool thread_told = false;
    for (const runtime::Missing& one : f_.missing) {
      if (is_thread(one) && std::exchange(thread_told, true)) continue;
      std::string what = one.what;
      if (is_thread(one) && threads > 1) what += ", and of " + count_text(static_cast<int>(threads) - 1, "other");
      items_.push_back({"rights", enforced ? Verdict::kProblem : Verdict::kNote, what + ", for user " + f_.limits.user,
                        one.grant, command_of(one)});
    }
  }

  static std::string command_of(const runtime::Missing& missing) {
    if (missing.what.starts_with("/dev/cpu_dma_latency")) return "sudo chmod o+w /dev/cpu_dma_latency";
    if (missing.what.find("priority") != std::string::npos || missing.what.find("memory") != std::string::npos) {
      return "sudo setcap cap_sys_nice,cap_ipc_lock+ep $(command -v stereotrackd)";
    }
    return {};
  }

  void clock() {
    const ClockFacts& c = f_.clocks;
    const auto has = [&c](const char* name) {
      return std::find(c.available.begin(), c.available.end(), name) != c.available.end();
    };
    // Read by a system call, up to a microsecond each.
    const bool slow = c.source == "hpet" || c.source == "acpi_pm" || c.source == "jiffies";
    const char* const better = has("arch_sys_counter") ? "arch_sys_counter" : has("tsc") ? "tsc" : nullptr;
    if (slow) {
      note("clock", c.source + ": slow to read",
           better != nullptr ? "take the better one" : "see why the kernel chose it",
           better != nullptr
               ? "echo " + std::string(better) + " | sudo tee /sys/devices/system/clocksource/*/current_clocksource"
               : "sudo dmesg | grep -i clocksource");
    }
    std::string what = c.source.empty() ? "source not told" : c.source;
    if (!c.ptp.empty()) what += ", " + joined(c.ptp, " ");
    if (c.tai_error_us) {
      ok("clock", what + formatted(", TAI within %.0f us", *c.tai_error_us));
    } else {
      note("clock", what + ": nobody sets it, or TAI - UTC is not known: telemetry has no absolute times",
           "let chrony keep it, with the line `leapsectz right/UTC` in /etc/chrony/chrony.conf",
           "sudo apt install chrony");
    }
  }

  void gpio() {
    std::vector<std::string> chips;
    chips.reserve(f_.chips.size());
    for (const gpio::gpiod::ChipListing& chip : f_.chips) {
      if (!chip.problem.empty()) {
        note("gpio", chip.problem, {}, {});
        continue;
      }
      std::vector<std::string> named;
      for (const gpio::LineFacts& each : chip.lines) {
        if (!each.name.empty() && !each.used) named.push_back(each.name);
      }
      const std::size_t all = named.size();
      if (all > 6) named.resize(6);
      chips.push_back(chip.chip.name + " (" + chip.chip.label + ", " + std::to_string(chip.chip.lines) + " lines" +
                      (named.empty() ? "" : ": " + joined(named, " ") + (all > 6 ? " ..." : "")) + ")");
    }
    if (!chips.empty()) ok("gpio", joined(chips, ", "));
    if (f_.chips.empty()) {
      ok("gpio", f_.gpio_interface == "none" ? "this build has no libgpiod: only lines of chip sim"
                                             : "no chip in /dev/gpiochip*: only lines of chip sim");
    }
    for (const LineFound& line : f_.lines) {
      const std::string what = line.key + ": " + line.line;
      if (!line.problem.empty()) {
        problem("gpio", line.key + ": " + line.problem, {}, {});
      } else if (line.consumer.starts_with("stereotrackd")) {
        ok("gpio", what + " is held by the stereotrackd that runs");
      } else if (!line.consumer.empty()) {
        problem("gpio", what + " is busy: held by \"" + line.consumer + "\"", "stop that, or take another line",
                "gpioinfo");
      } else {
        ok("gpio", what + (line.output ? " is free" : " is free, an input"));
      }
    }
  }

  void pwm() {
    std::vector<std::string> chips;
    chips.reserve(f_.pwm.size());
    for (const trigger::PwmChip& chip : f_.pwm) {
      chips.push_back(chip.name + " (" +
                      joined({chip.device, count_text(static_cast<int>(chip.channels), "channel")}, ", ") +
                      (chip.exported.empty() ? "" : ", " + std::to_string(chip.exported.size()) + " in use") + ")");
    }
    ok("pwm", chips.empty() ? "none: pulses come from lines or from outside" : joined(chips, ", "));
  }

  /// By one of its names.
  [[nodiscard]] static bool is_called(const CameraFound& camera, const std::string& device) {
    const capture::v4l2::CameraFacts& facts = camera.facts;
    return !device.empty() && (device == facts.path || device == "bus:" + facts.bus || device == "name:" + facts.card ||
                               std::find(facts.links.begin(), facts.links.end(), device) != facts.links.end());
  }

  [[nodiscard]] bool uses(const CameraFound& camera) const {
    const config::CameraConfig& wanted = f_.configuration.camera;
    return f_.cameras_wanted && (is_called(camera, wanted.left.device) || is_called(camera, wanted.right.device));
  }

  void cameras() {
    bool usable = false;
    std::vector<std::string> others;
    for (const CameraFound& camera : f_.found.cameras) {
      const capture::v4l2::CameraFacts& facts = camera.facts;
      const bool can = facts.problem.empty() && !formats_text(facts).empty();
      usable = usable || can;
      if (!facts.problem.empty()) {
        note("camera", facts.problem, {}, {});
      } else if (uses(camera)) {
        ok("camera", joined({facts.path + " " + facts.card, facts.bus}, ", ") + ": " +
                         (can ? formats_text(facts) : "no format that can be used") + controls_text(facts) + " <- " +
                         role_of(camera));
      } else {
        others.push_back(facts.path + " " + facts.card + (can ? "" : " (no format that can be used)"));
      }
    }
    if (!others.empty()) ok("camera", "besides: " + joined(others, ", "));
    libcamera();
    if (!f_.cameras_wanted) return;
    if (!usable && f_.config.empty()) {
      problem("camera", f_.found.cameras.empty() ? "there is none in /dev/video*" : "there is none that can be used",
              "plug it in; a sensor on a ribbon cable needs its overlay (dtoverlay=SENSOR in config.txt) and a reboot; "
              "what the kernel saw",
              "sudo dmesg | grep -iE 'video|uvc|csi|sensor|imx|ov[0-9]'");
    }
    const config::CameraConfig& camera = f_.configuration.camera;
    if (usable && f_.config.empty() && camera.right.device.empty()) {
      note("camera", "there is one that can be used: tracks in the picture alone, without distance",
           "plug a second one in, of the same kind, and run this again");
    } else if (usable && f_.config.empty() && !f_.has_calibration) {
      note("calibration", "none is given: without one two cameras run as one, without distance",
           "calibrate the rig (OpenCV, Kalibr or ROS do), then",
           "stereotrack doctor --calibration calibration.yml --write rig.toml");
    }
  }

  /// Without a module V4L2's cameras work: no limit, unless the configuration wants libcamera's.
  void libcamera() {
    const bool wanted = f_.cameras_wanted && f_.configuration.camera.driver == config::CameraDriver::kLibcamera;
    for (const std::string& told : f_.found.libcamera_problems) {
      if (wanted && f_.found.libcamera.empty()) {
        problem("camera", told, {}, {});
      } else {
        ok("camera", told);
      }
    }
    if (!f_.found.libcamera.empty()) ok("camera", f_.found.libcamera);
  }

  [[nodiscard]] std::string role_of(const CameraFound& camera) const {
    return is_called(camera, f_.configuration.camera.left.device) ? "left" : "right";
  }

  void configuration() {
    if (!f_.trigger.empty()) ok("config", f_.trigger);
    for (const std::string& what : f_.configuration_problems) {
      problem("config", what, {}, {});
    }
  }

  void capture() {
    for (const CaptureMeasure& m : f_.capture) {
      if (!m.failure.empty()) {
        problem("capture", m.side + ": " + m.failure, {}, {});
        continue;
      }
      const std::string what = m.side + " " + m.delivers +
                               formatted(": %llu frames, jitter p99 %s max %s, arrive after p50 %s p99.9 %s",
                                         static_cast<unsigned long long>(m.frames), us_text(m.jitter.p99_us).c_str(),
                                         us_text(m.jitter.max_us).c_str(), us_text(m.delay.p50_us).c_str(),
                                         us_text(m.delay.p999_us).c_str());
      const double expected = m.period_ms > 0 ? f_.seconds * 1e3 / m.period_ms : 0;
      const bool comes_early = m.delay.count > 0 && m.delay_min_us < 0;
      if (m.readout_is_guessed && !comes_early) {
        note("capture", m.side + ": the driver does not tell how long reading out takes",
             "have it from the sensor's data sheet, for the configuration; this much fits what was measured",
             readout_text(m));
      }
      if (comes_early) {
        note("capture", what + ": frames bear times after their arrival",
             "tell how long reading out takes, in the configuration", readout_text(m));
      } else if (m.damaged + m.lost > 0) {
        note("capture",
             what + formatted(": %llu lost (%llu without a buffer), %llu damaged",
                              static_cast<unsigned long long>(m.lost), static_cast<unsigned long long>(m.late),
                              static_cast<unsigned long long>(m.damaged)),
             "another USB port or cable, a smaller picture or a lower camera.fps", "sudo dmesg | tail");
      } else if (static_cast<double>(m.frames) < 0.8 * expected - 3) {
        note("capture", what + formatted(": fewer than the %.0f that %.1f a second make", expected, 1e3 / m.period_ms),
             "automatic exposure may take longer than a period in the dark: set it in the configuration",
             "camera.exposure_us = " + std::to_string(static_cast<long>(m.period_ms * 500)));
      } else if (m.jitter.p99_us > 0.1e3 * m.period_ms) {
        note("capture", what + ": stamps that jump by more than a tenth of the period",
             "cameras with stamps of their own hardware pair better; else camera.tolerance = 0.5");
      } else {
        ok("capture", what);
      }
      for (const std::string& told : m.notes) note("capture", told, {}, {});
    }
  }

  [[nodiscard]] static std::string readout_text(const CaptureMeasure& m) {
    return "camera.readout_us = " + std::to_string(std::lround(std::ceil(suggested_readout_us(m).value_or(0))));
  }

  void sync() {
    if (!f_.pair || !f_.pair->phase_ms) return;
    const config::CameraConfig& camera = f_.configuration.camera;
    std::string what = formatted("the right camera exposes %.2f ms after the left one", *f_.pair->phase_ms);
    if (f_.pair->drift_ppm) what += formatted(", drifting by %.1f in a million", *f_.pair->drift_ppm);
    const double limit_ms = camera.skew_limit_ms > 0 ? camera.skew_limit_ms : 5;
    const bool drifts = std::abs(f_.pair->drift_ppm.value_or(0)) > 2;  // less is measuring
    if (std::abs(*f_.pair->phase_ms) > limit_ms || drifts) {
      note("sync", what + ": nobody synchronises them",
           "wire a trigger (docs/CAMERAS.md); until then take what fits worst, in the configuration",
           "camera.tolerance = 0.5");
    } else {
      ok("sync", what + (f_.pair->drift_ppm ? "" : "; whether they drift shows after some seconds more: --seconds 10"));
    }
  }

  void wake_up() {
    if (!f_.wake_up || f_.wake_up->latency.count == 0) return;
    const WakeUpMeasure& m = *f_.wake_up;
    const std::string what =
        "wake-up p50 " + us_text(m.latency.p50_us) + " p99 " + us_text(m.latency.p99_us) + " max " +
        us_text(m.latency.max_us) + ", " +
        (m.priority > 0 ? "priority " + std::to_string(m.priority) : std::string("without a real-time priority")) +
        (m.beside_pipeline ? ", beside the pipeline" : "");
    const double late_us = f_.configuration.latency.late_ms * 1e3;
    if (m.latency.max_us > late_us) {
      note("wake-up", what + formatted(": over latency.late_ms = %g", late_us * 1e-3),
           "grant the rights, take a PREEMPT_RT kernel, keep other work off this core; who holds it up",
           "sudo cyclictest -m -p 82 -D 60");
    } else {
      ok("wake-up", what);
    }
  }

  void line() {
    if (!f_.line) return;
    const LineMeasure& m = *f_.line;
    if (!m.problem.empty()) {
      problem("line", m.line + ": " + m.problem, {}, {});
      return;
    }
    const std::string what = m.line + ": set in p50 " + us_text(m.latency.p50_us) + " p99 " +
                             us_text(m.latency.p99_us) + " max " + us_text(m.latency.max_us) + ", " +
                             std::to_string(m.latency.count) + " times";
    const double late_us = f_.configuration.latency.late_ms * 1e3;
    if (m.latency.p99_us > late_us) {
      note("line", what + ": slow, a chip behind I2C or USB?", "take a line of the processor's own chip", "gpiodetect");
    } else {
      ok("line", what);
    }
  }

  void compute() {
    if (!f_.pipeline) return;
    const PipelineMeasure& m = *f_.pipeline;
    if (!m.problem.empty()) {
      problem("pipeline", m.problem, {}, {});
      return;
    }
    const std::string what =
        formatted("%dx%d %s %s: p50 %s p99 %s max %s of %.1f ms, on synthetic:eleven", m.width, m.height,
                  m.colour ? "colour" : "grey", m.stereo ? "stereo" : "mono", us_text(m.compute.p50_us).c_str(),
                  us_text(m.compute.p99_us).c_str(), us_text(m.compute.max_us).c_str(), m.period_ms);
    if (m.compute.p99_us > m.period_ms * 1e3) {
      note("pipeline", what + ": pairs will be passed over", "smaller pictures or fewer of them, in the configuration",
           formatted("camera.fps = %.1f", std::max(0.1, std::floor(8e6 / m.compute.p99_us) / 10)));
    } else {
      ok("pipeline", what);
    }
  }

  void latency() {
    if (!f_.latency) return;
    const LatencyVerdict& v = *f_.latency;
    const std::string sum = formatted(
        "L = %.0f ms can be kept: arrival %.1f%s + compute %.1f + a quarter of it + wake-ups %.2f + lead %.1f",
        v.achievable_ms, v.arrival_ms, v.arrival_is_assumed ? " (a period, assumed)" : "", v.compute_ms, v.wake_ms,
        v.lead_ms);
    if (v.achievable_ms <= v.configured_ms) {
      ok("latency", sum + formatted("; latency.output_ms = %g", v.configured_ms));
    } else if (f_.config.empty()) {
      ok("latency", sum + "; that is what --write writes");
    } else {
      note("latency", sum + formatted("; latency.output_ms = %g is less: what leaves is predicted", v.configured_ms),
           "in " + f_.config, formatted("latency.output_ms = %.1f", v.achievable_ms));
    }
  }

  const Findings& f_;
  std::vector<Item> items_;
};

}  // namespace

const char* to_string(Verdict verdict) noexcept {
  switch (verdict) {
    case Verdict::kNote: return "NOTE";
    case Verdict::kProblem: return "PROBLEM";
    case Verdict::kOk: break;
  }
  return "OK";
}

std::vector<Item> judge(const Findings& findings) { return Judge(findings).all(); }

Verdict worst_of(const std::vector<Item>& items) noexcept {
  Verdict worst = Verdict::kOk;
  for (const Item& item : items) worst = std::max(worst, item.verdict);
  return worst;
}

int exit_code(Verdict verdict) noexcept { return static_cast<int>(verdict); }

}  // namespace stereotrack::doctor
