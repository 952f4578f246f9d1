// score_path --tracks FILE --frames A:B: how steadily one object of a recording is followed.

#include <charconv>
#include <sstream>
#include <stdexcept>

#include "tests/support/score/path_score.hpp"
#include "tests/support/score/score_main.hpp"

namespace {

using stereotrack::score::Figures;
using stereotrack::score::PathScore;
using stereotrack::score::PathSpec;

void parse_range(const std::string& text, PathSpec& spec) {
  const char* end = text.data() + text.size();
  const auto first = std::from_chars(text.data(), end, spec.first_frame);
  const bool colon = first.ec == std::errc{} && first.ptr != end && *first.ptr == ':';
  const auto last = std::from_chars(colon ? first.ptr + 1 : end, end, spec.last_frame);
  if (!colon || last.ec != std::errc{} || last.ptr != end) {
    throw CLI::ValidationError("--frames", "'" + text + "' is not a range A:B of frame numbers");
  }
}

std::string text_of(double value) {
  std::ostringstream out;
  out << value;
  return out.str();
}

std::string ids_of(const PathScore& score) {
  std::string list = "[";
  for (const auto& [id, rows] : score.rows_of_id) {
    list += (list.size() > 1 ? ", [" : "[") + std::to_string(id) + ", " + std::to_string(rows) + "]";
  }
  return list + "]";
}

}  // namespace

int main(int argc, char** argv) {
  namespace evaluation = stereotrack::evaluation;
  namespace score = stereotrack::score;
  std::filesystem::path tracks;
  std::string model = "line";
  PathSpec spec;
  CLI::App app("Tells how one track of a recording covers a range of frames and how smooth its 3-D path is.",
               "score_path");
  app.add_option("--tracks", tracks, "tracks.csv of a replay")->required();
  app.add_option_function<std::string>(
         "--frames", [&](const std::string& text) { parse_range(text, spec); }, "Range A:B, both included")
      ->required();
  app.add_option("--id", spec.id, "Track to look at (default: the one with most rows in the range)");
  app.add_option("--model", model, "line: straight, constant speed; ballistic: x and z quadratic, y cubic in time")
      ->check(CLI::IsMember({"line", "ballistic"}))
      ->capture_default_str();
  return score::score_main(app, argc, argv, [&]() -> Figures {
    const PathScore path = score::follow(evaluation::read_mot(tracks), spec);
    Figures figures = {{"frames", std::to_string(path.frames)},
                       {"ids", std::to_string(path.rows_of_id.size())},
                       {"rows_of_ids", ids_of(path)},
                       {"id", path.rows > 0 ? std::to_string(path.id) : "null"},
                       {"rows", std::to_string(path.rows)},
                       {"coverage", text_of(path.coverage())},
                       {"points_3d", std::to_string(path.points.size())}};
    const auto& degrees = model == "line" ? score::kStraight : score::kBallistic;
    if (path.points.size() <= static_cast<std::size_t>(*std::max_element(degrees.begin(), degrees.end()))) {
      figures.emplace_back("rms_3d", "null");
      return figures;
    }
    const score::PathFit fit = score::fit_path(path.points, degrees);
    figures.insert(figures.end(), {{"rms_3d", text_of(fit.rms_3d)},
                                   {"rms_x", text_of(fit.rms.x())},
                                   {"rms_y", text_of(fit.rms.y())},
                                   {"rms_z", text_of(fit.rms.z())},
                                   {"largest", text_of(fit.largest)},
                                   {"speed_a_frame", text_of(fit.velocity.norm())}});
    if (model == "line") figures.emplace_back("rms_from_line", text_of(score::distance_from_line(path.points)));
    return figures;
  });
}
