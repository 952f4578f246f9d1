// score_disparity --truth FILE --scale S --disparity FILE.png: errors of a disparity map on a Middlebury pair.

#include <stdexcept>

#include "tests/support/score/disparity_score.hpp"
#include "tests/support/score/score_main.hpp"

int main(int argc, char** argv) {
  using stereotrack::score::DisparityScore;
  using stereotrack::score::Figures;
  using stereotrack::score::non_occluded;
  using stereotrack::score::read_estimate;
  using stereotrack::score::read_scored_mask;
  using stereotrack::score::read_truth;
  using stereotrack::score::score_disparity;
  using stereotrack::score::score_main;
  std::filesystem::path truth_file;
  std::filesystem::path right_file;
  std::filesystem::path mask_file;
  std::filesystem::path disparity_file;
  double scale = 1;
  CLI::App app("Scores a disparity map (16-bit PNG, disparity x 256, 0 = none) against ground truth.",
               "score_disparity");
  app.add_option("--truth", truth_file, "Left ground truth, PNG or PFM")->required();
  app.add_option("--scale", scale, "Value of the truth for one pixel of disparity")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  app.add_option("--disparity", disparity_file, "The map to be scored")->required();
  auto* mask_option = app.add_option("--mask", mask_file, "Picture whose white pixels are scored");
  app.add_option("--truth-right", right_file, "Right ground truth: pixels that it does not confirm are not scored")
      ->excludes(mask_option);
  return score_main(app, argc, argv, [&]() -> Figures {
    const cv::Mat truth = read_truth(truth_file, scale);
    cv::Mat mask;
    if (!mask_file.empty()) mask = read_scored_mask(mask_file);
    if (!right_file.empty()) mask = non_occluded(truth, read_truth(right_file, scale));
    const DisparityScore score = score_disparity(truth, read_estimate(disparity_file), mask);
    if (score.scored == 0) throw std::runtime_error(truth_file.string() + ": no pixel is left to score");
    return {{"scored_pixels", std::to_string(score.scored)},
            {"density", std::to_string(score.density())},
            {"bad_1", std::to_string(score.bad_1())},
            {"bad_2", std::to_string(score.bad_2())},
            {"bad_2_of_all", std::to_string(score.bad_2_of_all())}};
  });
}
