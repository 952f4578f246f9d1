#pragma once

#include <iosfwd>
#include <optional>
#include <string>

#include "firmware-app/stereotrack/explain.hpp"
#include "firmware-app/stereotrack/rig.hpp"

namespace stereotrack {

/// `stereotrack replay SOURCE ...`
struct ReplayArguments {
  RigArguments rig;
  std::optional<std::string> out;         ///< --out DIR
  std::optional<std::string> render;      ///< --render FILE.mp4, or a folder for PNG pictures
  std::optional<ExplainRequest> explain;  ///< --explain ID|A:B
  bool real_time = false;                 ///< --pace real
  FrameRange frames;                      ///< --frames A:B
};

/// Runs a source through the pipeline and writes what was asked for. Progress and skipped frames go to
/// `messages`, explanations (but with --out, where they become explain.txt) and the closing table to `out`. Answers the
/// exit code. Throws config::Error (exit 2) or std::runtime_error (exit 1), one line; then, and after ctrl-C, no file
/// of --out and no video is left behind unless it was whole before; PNG pictures so far stay, each whole.
int run_replay(const ReplayArguments& arguments, std::ostream& out, std::ostream& messages);

/// `stereotrack replay SOURCE ... --check-config`: opens and checks all that run_replay() would, makes the pipeline,
/// and prints to `out` what memory it takes by part. No frame is read, no file written. Throws as run_replay().
int check_replay(const ReplayArguments& arguments, std::ostream& out);

/// `stereotrack masks SOURCE --out DIR`: foreground masks, one %06d.png a frame, 255 = object.
struct MasksArguments {
  RigArguments rig;
  std::string out;
  FrameRange frames;
};
int run_masks(const MasksArguments& arguments, std::ostream& messages);

}  // namespace stereotrack
