#include "firmware-app/stereotrack/eval.hpp"

#include <ostream>
#include <stdexcept>

#include "firmware-app/evaluation/mot_file.hpp"
#include "firmware-app/evaluation/report.hpp"
#include "firmware-app/evaluation/scores.hpp"

namespace stereotrack {

int run_eval(const EvalArguments& arguments, std::ostream& out) {
  const evaluation::Truth truth{evaluation::read_mot(arguments.truth)};
  const evaluation::Tracks tracks{evaluation::read_mot(arguments.tracks)};
  evaluation::Options options;
  options.fps = arguments.fps;
  options.frames = arguments.frames;
  options.focal_baseline = arguments.focal_baseline;
  const evaluation::Scores scores = evaluation::evaluate(truth, tracks, options);
  if (arguments.json) {
    evaluation::write_json(scores, out);
  } else {
    evaluation::write_table(scores, out);
  }
  if (!out.flush()) throw std::runtime_error("eval: the scores could not be written; is the disk full?");
  return 0;
}

}  // namespace stereotrack
