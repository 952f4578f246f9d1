// score_masks --truth DIR --masks DIR: quality of foreground masks on a CDnet sequence.

#include "tests/support/score/mask_score.hpp"
#include "tests/support/score/score_main.hpp"

int main(int argc, char** argv) {
  using stereotrack::score::Figures;
  using stereotrack::score::MaskScore;
  using stereotrack::score::score_main;
  using stereotrack::score::score_mask_folders;
  std::filesystem::path truth;
  std::filesystem::path masks;
  std::size_t skip = 100;
  std::int64_t offset = 469;
  CLI::App app("Scores foreground masks against CDnet ground truth.", "score_masks");
  app.add_option("--truth", truth, "Folder of the ground truth (gt000470.png ...)")->required();
  app.add_option("--masks", masks, "Folder of the masks, 0 or 255 (000001.png ...)")->required();
  app.add_option("--skip", skip, "Frames at the start that are not scored")->capture_default_str();
  app.add_option("--offset", offset, "Number of a truth less that of its mask")->capture_default_str();
  return score_main(app, argc, argv, [&]() -> Figures {
    const MaskScore score = score_mask_folders(truth, masks, skip, offset);
    return {{"frames", std::to_string(score.frames)},
            {"f_measure", std::to_string(score.f_measure())},
            {"precision", std::to_string(score.precision())},
            {"recall", std::to_string(score.recall())},
            {"shadow_rate", score.shadow_pixels > 0 ? std::to_string(score.shadow_rate()) : "null"}};
  });
}
