#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <nlohmann/json.hpp>
#include <opencv2/core/utility.hpp>
#include <stdexcept>

#include "tests/bench/cases.hpp"
#include "tests/support/run_program.hpp"

namespace stereotrack::bench {

Side side_of(const Measured& measured, const Plan& plan) {
  Side side;
  side.ms = times_of(measured.ms);
  side.wall_ms = times_of(measured.wall_ms);
  side.allocations = measured.allocations;
  side.instructions = measured.instructions;
  const auto counted = plan.instructions.find(measured.name);
  if (!side.instructions && counted != plan.instructions.end()) side.instructions = counted->second;
  return side;
}

namespace {

struct Arguments {
  std::string json = "bench.json";
  bool quick = false;
  bool markdown = false;
  bool instructions = false;
  int frames = 0;
  int warm_up = 0;
};

// This program again, under callgrind, a single timed call of each contestant.
void count_with_callgrind(Plan& plan, Report& report) {
  const test::TempDir folder;
  const std::string self = std::filesystem::read_symlink("/proc/self/exe").string();
  const std::string json = (folder / "bench.json").string();
  test::ProgramOptions options;
  options.limit = std::chrono::hours(4);
  const test::ProgramResult done = test::run_program(
      {"/usr/bin/env", "valgrind", "--tool=callgrind", "--instr-atstart=no",
       "--callgrind-out-file=" + (folder / "callgrind.out").string(), self, "--quick", "--frames", "1", "--json", json},
      options);
  if (done.exit_code != 0) {
    throw std::runtime_error("--instructions: valgrind failed; is it installed? Its last words: " +
                             done.err.substr(done.err.size() - std::min<std::size_t>(done.err.size(), 300)));
  }
  plan.instructions = read_callgrind(folder.path().string());
  if (plan.instructions.empty()) {
    throw std::runtime_error(
        "--instructions: this program was built without valgrind's header; install valgrind and "
        "build again");
  }
  std::ifstream file(json);
  plan.counted_on = nlohmann::json::parse(file)["machine"]["simd"].get<std::string>();
  report.instructions_by = "callgrind";
  report.instructions_why = "whose CPU has SIMD target " + plan.counted_on + " at best";
}

int run(const Arguments& arguments) {
  cv::setNumThreads(1);
  // Before minutes of work.
  if (!std::ofstream(arguments.json, std::ios::app)) {
    throw std::runtime_error(arguments.json + ": cannot be written; is the folder there and writable?");
  }
  Plan plan;
  plan.quick = arguments.quick;
  if (plan.quick) {
    plan.frames = 24;
    plan.warm_up = 32;
  }
  if (arguments.frames > 0) plan.frames = arguments.frames;
  if (arguments.warm_up > 0) plan.warm_up = arguments.warm_up;

  const InstructionCounter counter;
  Report report;
  report.quick = plan.quick;
  report.frames = plan.frames;
  report.warm_up = plan.warm_up;
  if (counter.works()) {
    report.instructions_by = "perf_event_open";
  } else if (arguments.instructions) {
    count_with_callgrind(plan, report);
  } else {
    report.instructions_why = counter.why_not() + "; --instructions counts with callgrind";
  }
  if (!under_valgrind()) {
    report.checks = check_matchers();
    report.copy_gb_s = copy_bandwidth();
  }
  measure_matchers(plan, counter, report);
  measure_pipelines(plan, counter, report);
  write_json(report, arguments.json);
  std::cout << to_text(report, arguments.markdown);
  return 0;
}

}  // namespace
}  // namespace stereotrack::bench

int main(int argc, char** argv) {
  stereotrack::bench::Arguments arguments;
  CLI::App app(
      "Measures stereotrack against the same pipeline composed of stock OpenCV calls, in turns, in one process. Exits "
      "with 1 if a result of ours is not the naive one, never because of a time.");
  app.set_version_flag("--version", STEREOTRACK_VERSION);
  app.add_option("--json", arguments.json, "where the numbers go")->capture_default_str();
  app.add_flag("--quick", arguments.quick, "fewer frames: under two minutes");
  app.add_flag("--markdown", arguments.markdown, "prints all tables, as docs/PERFORMANCE.md holds them");
  app.add_flag("--instructions", arguments.instructions,
               "counts instructions with callgrind where the CPU's counter cannot be read; many minutes");
  app.add_option("--frames", arguments.frames, "timed calls of each contestant")->check(CLI::Range(1, 10000));
  app.add_option("--warm-up", arguments.warm_up, "untimed calls before them, in which backgrounds are learnt")
      ->check(CLI::Range(1, 10000));
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  try {
    return stereotrack::bench::run(arguments);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "stereotrack_bench: %s\n", error.what());
    return 1;
  }
}
