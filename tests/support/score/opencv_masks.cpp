// opencv_masks --method knn|mog2 --pictures DIR --out DIR: what a stock background subtractor makes of a sequence,
// to score beside ours.

#include <CLI/CLI.hpp>
#include <algorithm>
#include <exception>
#include <filesystem>
#include <iostream>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/video/background_segm.hpp>
#include <stdexcept>
#include <string>
#include <vector>

namespace {

namespace fs = std::filesystem;

/// OpenCV's own values for everything, its shadows (127) as background, then the usual median of 5 x 5.
void write_masks(const std::string& method, const fs::path& pictures, const fs::path& out) {
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(pictures)) files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  if (files.empty()) throw std::runtime_error(pictures.string() + ": holds no pictures");
  cv::Ptr<cv::BackgroundSubtractor> subtractor;
  if (method == "knn") {
    subtractor = cv::createBackgroundSubtractorKNN();
  } else {
    subtractor = cv::createBackgroundSubtractorMOG2();
  }
  fs::create_directories(out);
  cv::Mat mask;
  cv::Mat clean;
  for (const fs::path& file : files) {
    const cv::Mat picture = cv::imread(file.string(), cv::IMREAD_COLOR);
    if (picture.empty()) throw std::runtime_error(file.string() + ": cannot be read as a picture");
    subtractor->apply(picture, mask);
    cv::threshold(mask, mask, 200, 255, cv::THRESH_BINARY);
    cv::medianBlur(mask, clean, 5);
    const fs::path to = out / (file.stem().string() + ".png");
    if (!cv::imwrite(to.string(), clean)) throw std::runtime_error(to.string() + ": cannot be written");
  }
}

}  // namespace

int main(int argc, char** argv) {
  std::string method;
  fs::path pictures;
  fs::path out;
  CLI::App app("Foreground masks of OpenCV's background subtractors, with a 5 x 5 median.", "opencv_masks");
  app.add_option("--method", method, "knn or mog2")->required()->check(CLI::IsMember({"knn", "mog2"}));
  app.add_option("--pictures", pictures, "Folder of the pictures, names that sort")->required();
  app.add_option("--out", out, "Folder for the masks, 0 or 255")->required();
  CLI11_PARSE(app, argc, argv);
  try {
    write_masks(method, pictures, out);
    return 0;
  } catch (const std::exception& error) {
    std::cerr << "opencv_masks: " << error.what() << '\n';
    return 1;
  }
}
