#include <unistd.h>

#include <CLI/CLI.hpp>
#include <exception>
#include <iostream>

#include "config/error.hpp"
#include "drivers/capture/synthetic/synthetic_source.hpp"
#include "drivers/telemetry/authentication.hpp"
#include "drivers/telemetry/endpoint.hpp"
#include "drivers/telemetry/replay_guard.hpp"
#include "firmware-app/formatted.hpp"
#include "firmware-app/stereotrack/disparity.hpp"
#include "firmware-app/stereotrack/doctor/doctor.hpp"
#include "firmware-app/stereotrack/eval.hpp"
#include "firmware-app/stereotrack/info.hpp"
#include "firmware-app/stereotrack/monitor.hpp"
#include "firmware-app/stereotrack/plan.hpp"
#include "firmware-app/stereotrack/replay.hpp"
#include "firmware-app/stereotrack/synth.hpp"
#include "pipeline/core/simd.hpp"

namespace {

constexpr int kFailed = 1;
constexpr int kBadUsage = 2;

/// CLI::Range also takes what is not a number.
CLI::Validator within(double low, double high) {
  const std::string range = stereotrack::formatted("%g to %g", low, high);
  const auto refuse = [low, high, range](const std::string& text) {
    double value = 0;
    const bool is_within = CLI::detail::lexical_cast(text, value) && value >= low && value <= high;
    return is_within ? std::string() : text + " is not within " + range;
  };
  return {refuse, "FLOAT in [" + range + "]"};
}

void add_rig_options(CLI::App& command, stereotrack::RigArguments& rig) {
  command
      .add_option("source", rig.source,
                  "mav0 folder, KITTI folder, folder with left/ right/, sbs:FILE, LEFT,RIGHT, mono:PATH, FILE.strec or "
                  "synthetic:NAME")
      ->required();
  command.add_option("--calibration", rig.calibration, "calibration file; else that of the source's folder");
  command.add_option("--config", rig.config, "configuration (TOML); else stereotrack.toml of the source's folder");
  command.add_option("--set", rig.set, "KEY=VALUE, wins over the file; may be given again")->allow_extra_args(false);
}

void add_synth_options(CLI::App& command, stereotrack::SynthArguments& arguments) {
  command.add_option("scene", arguments.scene, "name of the scene: " + stereotrack::capture::synthetic::scene_names())
      ->required();
  command.add_option("--out", arguments.out, "folder for left/ right/ masks/ disparity/ calibration.yml gt.csv")
      ->required();
  command.add_option("--seed", arguments.seed, "another seed, another drawing of the scene")->capture_default_str();
  command.add_option("--frames", arguments.frames, "how many pairs")->capture_default_str();
  command.add_option("--size", arguments.size, "WIDTHxHEIGHT of a picture")->capture_default_str();
}

void add_plan_options(CLI::App& command, stereotrack::PlanArguments& arguments) {
  const CLI::Validator positive = within(1e-6, 1e6);
  command.add_option("--range", arguments.range_m, "metres: the farthest that targets are to be measured")
      ->required()
      ->check(positive);
  command.add_option("--accuracy", arguments.accuracy_m, "metres: standard deviation of their distance there")
      ->required()
      ->check(positive);
  command.add_option("--size", arguments.size, "WIDTHxHEIGHT of the sensor")->capture_default_str();
  command.add_option("--view", arguments.view_deg, "degrees across that the lens sees; else usual ones")
      ->check(within(1, 170));
  command.add_option("--baseline", arguments.baseline_m, "metres that the rig has; else what is needed")
      ->check(positive);
  command
      .add_option("--disparity-error", arguments.disparity_error_px,
                  "pixels: standard deviation of a target's disparity")
      ->check(positive)
      ->capture_default_str();
  command.add_option("--target", arguments.target_m, "metres: width of the smallest target")
      ->check(positive)
      ->capture_default_str();
  command.add_option("--speed", arguments.speed_m_s, "metres a second: of the fastest target, across the view")
      ->check(positive)
      ->capture_default_str();
}

void add_doctor_options(CLI::App& command, stereotrack::DoctorArguments& arguments) {
  CLI::Option* config =
      command.add_option("--config", arguments.config, "checks its cameras, lines and rights; else what there is");
  CLI::Option* measure =
      command.add_flag("!--no-measure", arguments.measure, "only looks: opens no camera but to check");
  command.add_option("--seconds", arguments.seconds, "of each measurement")
      ->check(within(0.1, 3600))
      ->capture_default_str()
      ->excludes(measure);
  command
      .add_option("--line", arguments.line,
                  "CHIP:LINE: sets this output to and fro and tells how long that takes; no line is touched unasked")
      ->excludes(measure);
  command.add_flag("--json", arguments.json, "one JSON object, keys as in docs/DOCTOR.md");
  command.add_option("--write", arguments.write, "writes a configuration for this board to a new file")
      ->excludes(config);
  command.add_option("--calibration", arguments.calibration, "calibration of the two cameras, for that configuration")
      ->excludes(config);
  command.footer("Exit code: 0 ready, 1 works with limits, which are named, 2 cannot run.");
}

// Kernels use the best instruction set of the machine unless one is named; results are the same with each.
void choose_simd(const std::string& name) {
  std::string known = "best";
  for (const stereotrack::SimdTarget target : stereotrack::simd_targets()) {
    if (name == to_string(target) && use_simd(target)) return;
    known += std::string(", ") + to_string(target);
  }
  if (name != "best") throw stereotrack::config::Error("--simd " + name + ": this machine has " + known);
}

int run(int argc, char** argv) {
  CLI::App app("Tracks moving objects in stereo recordings.", "stereotrack");
  app.set_version_flag("--version", std::string("stereotrack ") + STEREOTRACK_VERSION);
  app.require_subcommand(1);
  app.fallthrough();
  std::string simd = "best";
  app.add_option("--simd", simd, "instruction set of the kernels: best, scalar, sse4, avx2, avx512, neon");

  stereotrack::ReplayArguments replay;
  std::string replay_frames;
  std::string pace = "max";
  CLI::App* replay_command = app.add_subcommand("replay", "runs a recording through the tracker");
  add_rig_options(*replay_command, replay.rig);
  replay_command->add_option("--out", replay.out, "folder for tracks.csv, summary.json, telemetry.bin");
  replay_command->add_option("--truth", replay.rig.truth, "FILE for the ground truth of synthetic:NAME, for eval");
  replay_command->add_option("--render", replay.render, "FILE.mp4, or a folder for PNG pictures");
  replay_command->add_option("--pace", pace, "max: as fast as it goes; real: in real time, with telemetry over UDP")
      ->check(CLI::IsMember({"max", "real"}));
  replay_command->add_option("--frames", replay_frames, "A:B, ordinals from 1, both included");
  std::string explain;
  replay_command->add_option("--explain", explain,
                             "ID of a target, or frames A:B: why it was born, associated, lost; into explain.txt of "
                             "--out, and into the rendered picture");
  bool check_config = false;
  replay_command->add_flag("--check-config", check_config,
                           "only checks configuration, calibration and source, and prints the memory by stage");

  stereotrack::MasksArguments masks;
  std::string masks_frames;
  CLI::App* masks_command = app.add_subcommand("masks", "writes the foreground masks of a recording");
  add_rig_options(*masks_command, masks.rig);
  masks_command->add_option("--out", masks.out, "folder for %06d.png")->required();
  masks_command->add_option("--frames", masks_frames, "A:B, ordinals from 1, both included");

  stereotrack::SynthArguments synth;
  CLI::App* synth_command = app.add_subcommand("synth", "writes a synthetic stereo sequence with ground truth");
  add_synth_options(*synth_command, synth);

  stereotrack::EvalArguments eval;
  CLI::App* eval_command = app.add_subcommand(
      "eval", "scores tracks against ground truth: HOTA, MOTA, IDF1, 3-D error, velocity, false tracks");
  eval_command->add_option("--truth", eval.truth, "ground truth, MOT columns")->required();
  eval_command->add_option("--tracks", eval.tracks, "tracks, MOT columns")->required();
  eval_command->add_option("--fps", eval.fps, "frames a second: for velocities and false tracks a minute")
      ->check(within(0.001, 100000))
      ->capture_default_str();
  eval_command
      ->add_option("--frames", eval.frames, "how many frames the sequence has; 0: up to the last in either file")
      ->check(CLI::Range(std::int64_t{0}, std::int64_t{1} << 40))
      ->capture_default_str();
  eval_command
      ->add_option("--focal-baseline", eval.focal_baseline,
                   "focal length times baseline, pixels times the files' unit: compares 3-D errors with the geometry's")
      ->check(within(0, 1e12));
  eval_command->add_flag("--json", eval.json, "one JSON object instead of the table");

  stereotrack::DisparityArguments disparity;
  std::optional<std::string> disparity_config;
  std::vector<std::string> disparity_set;
  CLI::App* disparity_command = app.add_subcommand("disparity", "dense disparity of a rectified pair");
  disparity_command->add_option("left", disparity.left, "left picture")->required();
  disparity_command->add_option("right", disparity.right, "right picture")->required();
  disparity_command->add_option("--out", disparity.out, "FILE.png, 16 bit, disparity x 256, 0 = none")->required();
  disparity_command->add_option("--config", disparity_config, "configuration (TOML)");
  disparity_command->add_option("--set", disparity_set, "KEY=VALUE")->allow_extra_args(false);

  stereotrack::InfoArguments info;
  app.add_subcommand("info", "tells what a recording holds, and whether it is whole")
      ->add_option("recording", info.recording, "FILE.strec")
      ->required();

  stereotrack::PlanArguments plan;
  add_plan_options(*app.add_subcommand("plan", "which lens and baseline a range and an accuracy ask for"), plan);

  stereotrack::MonitorArguments monitor;
  CLI::App* monitor_command = app.add_subcommand("monitor", "receives and shows the telemetry");
  monitor_command->add_option("--listen", monitor.listen, "ADDR:PORT")->capture_default_str();
  monitor_command->add_flag("--json", monitor.json, "one JSON object a datagram");
  monitor_command->add_option("--count", monitor.count, "end after so many pairs");
  monitor_command->add_option("--timeout", monitor.timeout_s, "fail if nothing comes for so many seconds");
  CLI::Option* key_file =
      monitor_command->add_option("--key-file", monitor.key_file, "take only what is signed with its keys");
  monitor_command->add_option("--state", monitor.state, "file that keeps what was seen: no replays after a restart")
      ->needs(key_file);

  stereotrack::DoctorArguments doctor;
  CLI::App* doctor_command =
      app.add_subcommand("doctor", "tells what this board has and can keep, and suggests a configuration");
  add_doctor_options(*doctor_command, doctor);

  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) return app.exit(error);
    std::cerr << "stereotrack: " << error.what() << " (see stereotrack --help)\n";
    return kBadUsage;
  }
  choose_simd(simd);
  if (*replay_command) {
    replay.real_time = pace == "real";
    if (!replay_frames.empty()) replay.frames = stereotrack::parse_frames(replay_frames);
    if (!explain.empty()) replay.explain = stereotrack::parse_explain(explain);
    if (check_config) return stereotrack::check_replay(replay, std::cout);
    return stereotrack::run_replay(replay, std::cout, std::cerr);
  }
  if (*masks_command) {
    if (!masks_frames.empty()) masks.frames = stereotrack::parse_frames(masks_frames);
    return stereotrack::run_masks(masks, std::cerr);
  }
  if (*synth_command) return stereotrack::run_synth(synth, std::cerr);
  if (*eval_command) return stereotrack::run_eval(eval, std::cout);
  if (*disparity_command) {
    return stereotrack::run_disparity(disparity, stereotrack::load_configuration(disparity_config, disparity_set),
                                      std::cerr);
  }
  if (app.got_subcommand("info")) return stereotrack::run_info(info, std::cout);
  if (app.got_subcommand("plan")) return stereotrack::run_plan(plan, std::cout);
  if (*doctor_command) return stereotrack::run_doctor(doctor, std::cout, std::cerr);
  monitor.live = isatty(STDOUT_FILENO) == 1;
  return stereotrack::run_monitor(monitor, std::cout, std::cerr);
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return run(argc, argv);
  } catch (const stereotrack::config::Error& error) {
    std::cerr << "stereotrack: " << error.what() << '\n';
    return kBadUsage;
  } catch (const stereotrack::telemetry::EndpointError& error) {
    std::cerr << "stereotrack: " << error.what() << '\n';
    return kBadUsage;
  } catch (const stereotrack::telemetry::KeyFileError& error) {
    std::cerr << "stereotrack: " << error.what() << '\n';
    return kBadUsage;
  } catch (const stereotrack::telemetry::MarksFileError& error) {
    std::cerr << "stereotrack: " << error.what() << '\n';
    return kBadUsage;
  } catch (const std::exception& error) {
    std::cerr << "stereotrack: " << error.what() << '\n';
    return kFailed;
  }
}
