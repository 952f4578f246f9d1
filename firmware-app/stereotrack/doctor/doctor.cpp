#include "firmware-app/stereotrack/doctor/doctor.hpp"

#include <unistd.h>

#include <algorithm>
#include <array>
#include <memory>
#include <ostream>
#include <stdexcept>

#include "config/error.hpp"
#include "drivers/capture/pixel_format_names.hpp"
#include "drivers/gpio/line.hpp"
#include "firmware-app/rig/cameras.hpp"
#include "firmware-app/rig/rig.hpp"
#include "firmware-app/rig/trigger.hpp"
#include "firmware-app/stereotrack/doctor/judge.hpp"
#include "firmware-app/stereotrack/doctor/measure.hpp"
#include "firmware-app/stereotrack/doctor/probe.hpp"
#include "firmware-app/stereotrack/doctor/pulses.hpp"
#include "firmware-app/stereotrack/doctor/report.hpp"
#include "firmware-app/stereotrack/doctor/suggest.hpp"

namespace stereotrack::doctor {

namespace fs = std::filesystem;

namespace {

std::string host_name() {
  std::array<char, 256> name{};
  return ::gethostname(name.data(), name.size() - 1) == 0 ? name.data() : "";
}

std::chrono::nanoseconds span_of(double seconds) {
  return std::chrono::nanoseconds(static_cast<std::int64_t>(seconds * 1e9));
}

bool is_stereo(const config::CameraConfig& camera) { return camera.side_by_side || !camera.right.device.empty(); }

/// Reads it. Why it is none for such pictures; empty: it is one.
std::string check_calibration(Rig& rig, const std::string& file, int width, int height) {
  try {
    read_calibration(file, {}, rig);
    capture::SourceInfo info;
    info.width = width;
    info.height = height;
    check_rig(rig, info);
  } catch (const std::exception& error) {
    return error.what();
  }
  return {};
}

class Doctor {
 public:
  Doctor(const DoctorArguments& arguments, std::ostream& messages) : arguments_(arguments), messages_(messages) {
    f_.program = std::string("stereotrack ") + STEREOTRACK_VERSION;
    f_.host = host_name();
    f_.config = arguments.config.value_or("");
    rig_.loaded = load_configuration(arguments.config, {});
    f_.configuration = rig_.configuration();
    if (arguments.line) check_line_name(*arguments.line);
  }

  void look() {
    const fs::path& root = arguments_.root;
    f_.kernel = probe_kernel(root);
    f_.cpu = probe_cpu(root);
    f_.memory = probe_memory(root);
    f_.limits = probe_limits(root);
    f_.pwm = trigger::pwm_chips((root / "sys/class/pwm").string());
    f_.clocks = probe_clocks(root);
    f_.missing = ask_rights(f_.configuration);
    f_.gpio_interface = gpio::gpiod::interface();
    f_.chips = gpio::gpiod::list_chips();
    f_.lines = probe_lines(f_.configuration);
    f_.found = probe_cameras();
    if (arguments_.config) {
      f_.cameras_wanted = f_.configuration.source.name == kCameras;
      check_configuration();
    } else {
      suggest_cameras();
    }
  }

  void measure() {
    f_.seconds = arguments_.seconds;
    const config::Configuration& c = f_.configuration;
    const std::chrono::nanoseconds time = span_of(arguments_.seconds);
    std::unique_ptr<runtime::RealTimeProcess> process;
    if (c.realtime.mode != config::RealTimeMode::kOff) {
      process = std::make_unique<runtime::RealTimeProcess>(
          runtime::RealTimeProcess::Config{.deep_sleep = c.realtime.deep_sleep});
    }
    bool colour = capture::pixel_format_of(c.camera.format).has_value()
                      ? has_colour(*capture::pixel_format_of(c.camera.format))
                      : true;
    if (has_cameras()) {
      say("cameras");
      const Pulses pulses(c);
      // What the configuration's check has said already is not said again.
      if (!pulses.problem().empty() && std::find(f_.configuration_problems.begin(), f_.configuration_problems.end(),
                                                 pulses.problem()) == f_.configuration_problems.end()) {
        f_.configuration_problems.push_back(pulses.problem());
      }
      std::array<std::vector<std::string>, 2> notes;
      std::size_t side_opened = 0;
      const auto open = camera_opener(
          c.camera, [&](const std::string& note) { notes[side_opened].push_back(note); }, MissingReadout::kGuessed);
      CaptureMeasures measures = measure_capture(
          [&](trigger::Side side) {
            side_opened = side == trigger::Side::kLeft ? 0 : 1;
            return open(side);
          },
          !c.camera.right.device.empty(), c.realtime, time);
      f_.capture = std::move(measures.cameras);
      for (std::size_t i = 0; i < f_.capture.size(); ++i) f_.capture[i].notes = std::move(notes[i]);
      f_.pair = measures.pair;
      for (CaptureMeasure& camera : f_.capture) {
        if (!camera.delivers.empty()) colour = camera.colour;
        // Once is enough.
        std::erase(f_.configuration_problems, camera.failure);
      }
    } else if (!f_.cameras_wanted) {
      colour = true;  // scenes and recordings have it
    }
    if (arguments_.line) {
      say(*arguments_.line);
      f_.line = measure_line(*arguments_.line, c.realtime, time);
    }
    say("synthetic:eleven, which is drawn first");
    ComputeMeasures measures = measure_compute(c, colour, time);
    f_.pipeline = std::move(measures.pipeline);
    f_.wake_up = std::move(measures.wake_up);
    f_.latency = latency_of(f_);
  }

  [[nodiscard]] const Findings& findings() const { return f_; }
  [[nodiscard]] bool has_cameras() const { return f_.cameras_wanted && !f_.configuration.camera.left.device.empty(); }

 private:
  void say(const std::string& what) { messages_ << "measuring: " << what << std::endl; }

  static void check_line_name(const std::string& line) {
    try {
      (void)gpio::parse_line_name(line);
    } catch (const std::runtime_error& error) {
      throw config::Error(std::string("--line: ") + error.what());
    }
  }

  /// What stereotrackd --config FILE --check-config looks at.
  void check_configuration() {
    const config::Configuration& c = f_.configuration;
    if (!f_.cameras_wanted) return;
    if (is_stereo(c.camera) && c.calibration.file.empty()) {
      f_.configuration_problems.emplace_back(
          config::error_at(rig_.loaded.origins, "calibration.file",
                           "not set: two views need their calibration; or leave camera.right.device out for mono")
              .what());
    } else if (is_stereo(c.camera)) {
      const int width = c.camera.width / (c.camera.side_by_side ? 2 : 1);
      if (std::string what = check_calibration(rig_, c.calibration.file, width, c.camera.height); !what.empty()) {
        f_.configuration_problems.push_back(std::move(what));
      }
    }
    f_.has_calibration = rig_.calibration.has_value();
    const CameraCheck check = check_cameras(rig_.loaded);
    for (const std::string& failure : check.failures) f_.configuration_problems.push_back(failure);
    try {
      f_.trigger = check_trigger(c);
    } catch (const std::runtime_error& error) {
      f_.configuration_problems.emplace_back(error.what());
    }
  }

  /// Without a configuration: the cameras that there are, in the calibration's size where there is one.
  void suggest_cameras() {
    config::CameraConfig& camera = f_.configuration.camera;
    if (arguments_.calibration) {
      read_calibration(*arguments_.calibration, {}, rig_);
      if (rig_.calibration && rig_.calibration->left.width > 0) {
        camera.width = rig_.calibration->left.width;
        camera.height = rig_.calibration->left.height;
      }
      f_.has_calibration = true;
    }
    f_.suggestion = choose_cameras(f_.found.cameras, f_.configuration);
    if (!f_.suggestion || !arguments_.calibration || camera.right.device.empty()) return;
    if (std::string what = check_calibration(rig_, *arguments_.calibration, camera.width, camera.height);
        !what.empty()) {
      f_.configuration_problems.push_back(std::move(what));
    }
  }

  const DoctorArguments& arguments_;
  std::ostream& messages_;
  Rig rig_;
  Findings f_;
};

}  // namespace

}  // namespace stereotrack::doctor

namespace stereotrack {

namespace fs = std::filesystem;

int run_doctor(const DoctorArguments& arguments, std::ostream& out, std::ostream& messages) try {
  std::error_code ignored;
  if (arguments.write && fs::exists(*arguments.write, ignored)) {
    throw config::Error(arguments.write->string() +
                        ": is there already and stays as it is: give --write another name, or move it");
  }
  doctor::Doctor visit(arguments, messages);
  visit.look();
  if (arguments.measure) visit.measure();
  const doctor::Findings& findings = visit.findings();
  const std::vector<doctor::Item> items = judge(findings);
  out << (arguments.json ? doctor::json(findings, items) : report(findings, items)) << std::flush;
  if (arguments.write) {
    if (!findings.suggestion) {
      throw config::Error(arguments.write->string() + ": not written: there is no camera that can be used");
    }
    std::optional<std::string> calibration;
    if (arguments.calibration) calibration = fs::absolute(*arguments.calibration).lexically_normal().string();
    doctor::write_new_file(*arguments.write, suggest(findings, calibration));
    messages << arguments.write->string() << ": written; now: stereotrackd --config " << arguments.write->string()
             << " --check-config" << std::endl;
  }
  return doctor::exit_code(worst_of(items));
} catch (const config::Error&) {
  throw;
} catch (const std::exception& error) {
  // Exit code 1 would say that it works.
  throw config::Error(error.what());
}

}  // namespace stereotrack
