#include <opencv2/core.hpp>
#include <stdexcept>
#include <string>

#include "config/calibration/formats.hpp"

namespace stereotrack::calibration {
namespace {

/// cv::Exception's text without OpenCV's own source file, in one line.
std::string one_line(const cv::Exception& error) {
  // FileStorage's parser hands its text, "file(line): what", over as the function's name.
  std::string text = error.code == cv::Error::StsParseError && !error.func.empty() ? error.func : error.err;
  if (text.empty()) text = error.what();
  for (char& c : text) {
    if (c == '\n' || c == '\r') c = ' ';
  }
  return text;
}

struct Storage {
  std::string path;
  cv::FileStorage storage;
};

struct Found {
  std::string where;  ///< file and key, for messages
  cv::FileNode node;
};

class Reader {
 public:
  explicit Reader(const std::vector<TextFile>& files) {
    for (const TextFile& file : files) {
      try {
        files_.push_back({file.path, cv::FileStorage(file.path, cv::FileStorage::READ)});
      } catch (const cv::Exception& error) {
        throw std::runtime_error(file.path + ": not a whole OpenCV FileStorage file: " + one_line(error));
      }
      if (!files_.back().storage.isOpened()) {
        throw std::runtime_error(file.path + ": not an OpenCV FileStorage file; its first line must be %YAML:1.0");
      }
    }
  }

  [[nodiscard]] Found find(const std::string& key) const {
    for (const Storage& file : files_) {
      const cv::FileNode node = file.storage[key];
      if (!node.empty()) return {file.path + ": " + key, node};
    }
    return {};
  }

  [[nodiscard]] Found require(const std::string& key, const std::string& other_key) const {
    Found found = find(key);
    if (found.node.empty() && !other_key.empty()) found = find(other_key);
    if (!found.node.empty()) return found;
    const std::string names = key + (other_key.empty() ? "" : " (or " + other_key + ")");
    if (files_.size() > 1) {
      throw std::runtime_error(files_[0].path + "," + files_[1].path + ": " + names + " is in neither file");
    }
    throw std::runtime_error(files_[0].path + ": " + names +
                             " is missing; if it is in a second file, give both as INTRINSICS,EXTRINSICS");
  }

  /// The elements of a matrix or a list, row by row.
  [[nodiscard]] static std::vector<double> elements(const Found& found) {
    try {
      cv::Mat values;
      if (found.node.isSeq()) {
        std::vector<double> list;
        found.node >> list;
        return list;
      }
      cv::Mat stored;
      found.node >> stored;
      if (stored.channels() != 1) throw std::runtime_error(found.where + " has more than one channel");
      stored.convertTo(values, CV_64F);
      return {values.begin<double>(), values.end<double>()};
    } catch (const cv::Exception& error) {
      throw std::runtime_error(found.where + " is not a matrix of numbers: " + one_line(error));
    }
  }

  [[nodiscard]] static std::vector<double> elements(const Found& found, std::size_t count) {
    std::vector<double> values = elements(found);
    if (values.size() != count) {
      throw std::runtime_error(found.where + " holds " + std::to_string(values.size()) + " numbers, must be " +
                               std::to_string(count));
    }
    return values;
  }

  [[nodiscard]] CameraModel camera(const std::string& number, LensModel lens) const {
    CameraModel model;
    const Found matrix = require("K" + number, "M" + number);
    const std::vector<double> k = elements(matrix, 9);
    if (k[1] != 0 || k[3] != 0 || k[6] != 0 || k[7] != 0 || k[8] != 1) {
      throw std::runtime_error(matrix.where + " is not a camera matrix fx 0 cx, 0 fy cy, 0 0 1");
    }
    model.fx = k[0];
    model.fy = k[4];
    model.cx = k[2];
    model.cy = k[5];
    const Found distortion = require("D" + number, "");
    set_distortion(model, lens, elements(distortion), distortion.where);
    return model;
  }

  void set_size(CameraModel& camera) const {
    const Found size = find("image_size");
    const Found width = find("image_width");
    const Found height = find("image_height");
    if (!size.node.empty()) {
      const std::vector<double> values = elements(size, 2);
      camera.width = side(values[0], size.where, "width");
      camera.height = side(values[1], size.where, "height");
    } else if (width.node.isInt() && height.node.isInt()) {
      camera.width = side(static_cast<int>(width.node), width.where, "width");
      camera.height = side(static_cast<int>(height.node), height.where, "height");
    }
  }

 private:
  std::vector<Storage> files_;
};

}  // namespace

StereoCalibration read_opencv(const std::vector<TextFile>& files) {
  const Reader reader(files);
  LensModel lens = LensModel::kRadtan;
  const Found model = reader.find("distortion_model");
  if (model.node.isString()) lens = lens_model(static_cast<std::string>(model.node), model.where);

  StereoCalibration result;
  result.left = reader.camera("1", lens);
  result.right = reader.camera("2", lens);
  reader.set_size(result.left);
  reader.set_size(result.right);
  const std::vector<double> R = Reader::elements(reader.require("R", ""), 9);
  const std::vector<double> T = Reader::elements(reader.require("T", ""), 3);
  result.R_right_left = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(R.data());
  result.t_right_left = Eigen::Map<const Eigen::Vector3d>(T.data());
  return result;
}

}  // namespace stereotrack::calibration
