#include "config/calibration/text.hpp"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <stdexcept>

namespace stereotrack::calibration {

TextFile read_text(const std::string& path) {
  std::error_code error;
  const std::filesystem::file_status status = std::filesystem::status(path, error);
  if (!std::filesystem::exists(status)) {
    throw std::runtime_error(path + ": no such calibration file; check the name");
  }
  if (std::filesystem::is_directory(status)) throw std::runtime_error(path + ": is a folder, a file is wanted");
  std::ifstream stream(path, std::ios::binary);
  if (!stream) throw std::runtime_error(path + ": cannot be opened; check its permissions");
  constexpr std::size_t kMaxBytes = 16U << 20;
  std::string text;
  char block[65536];
  while (text.size() <= kMaxBytes && (stream.read(block, sizeof block) || stream.gcount() > 0)) {
    text.append(block, static_cast<std::size_t>(stream.gcount()));
  }
  if (text.size() > kMaxBytes || text.find('\0') != std::string::npos) {
    throw std::runtime_error(path + ": is not a calibration file but binary or far too long; check the name");
  }
  if (text.find_first_not_of(" \t\r\n") == std::string::npos) {
    throw std::runtime_error(path + ": is empty; write the calibration again");
  }
  return {path, text};
}

bool has_key(const TextFile& file, const std::string& key) {
  const std::string& text = file.text;
  if (text.find('"' + key + '"') != std::string::npos || text.find('<' + key + '>') != std::string::npos ||
      text.find('<' + key + ' ') != std::string::npos) {
    return true;
  }
  for (std::size_t at = text.find(key + ':'); at != std::string::npos; at = text.find(key + ':', at + 1)) {
    const std::size_t line = at == 0 ? std::string::npos : text.find_last_of('\n', at - 1);
    const std::size_t start = line == std::string::npos ? 0 : line + 1;
    if (text.find_first_not_of(" \t", start) == at) return true;
  }
  return false;
}

YAML::Node parse_yaml(const TextFile& file) {
  std::string text = file.text;
  if (text.rfind("%YAML", 0) == 0) text[0] = '#';
  try {
    YAML::Node root = YAML::Load(text);
    if (!root.IsMap()) throw std::runtime_error(file.path + ": holds no keys; is it a calibration file?");
    return root;
  } catch (const YAML::Exception& error) {
    throw std::runtime_error(file.path + ":" + std::to_string(error.mark.line + 1) + ": not valid YAML: " + error.msg);
  }
}

std::string place(const TextFile& file, const YAML::Node& node) {
  const YAML::Mark mark = node.Mark();
  return mark.is_null() ? file.path : file.path + ":" + std::to_string(mark.line + 1);
}

YAML::Node child(const TextFile& file, const YAML::Node& parent, const std::string& key) {
  if (parent.IsMap()) {
    const YAML::Node found = parent[key];
    if (found.IsDefined() && !found.IsNull()) return found;
  }
  throw std::runtime_error(place(file, parent) + ": " + key + " is missing; add it or calibrate again");
}

namespace {

void collect(const TextFile& file, const YAML::Node& node, const std::string& key, std::vector<double>& values) {
  if (node.IsMap()) return collect(file, child(file, node, "data"), key, values);
  if (node.IsSequence()) {
    for (const YAML::Node& element : node) collect(file, element, key, values);
    return;
  }
  try {
    values.push_back(node.as<double>());
  } catch (const YAML::Exception&) {
    throw std::runtime_error(place(file, node) + ": " + key + " holds something that is not a number");
  }
}

}  // namespace

std::vector<double> numbers(const TextFile& file, const YAML::Node& node, const std::string& key) {
  std::vector<double> values;
  collect(file, node, key, values);
  return values;
}

std::vector<double> numbers(const TextFile& file, const YAML::Node& node, const std::string& key, std::size_t count) {
  std::vector<double> values = numbers(file, node, key);
  if (values.size() != count) {
    throw std::runtime_error(place(file, node) + ": " + key + " holds " + std::to_string(values.size()) +
                             " numbers, must be " + std::to_string(count));
  }
  return values;
}

std::string word(const TextFile& file, const YAML::Node& node, const std::string& key) {
  if (!node.IsScalar()) throw std::runtime_error(place(file, node) + ": " + key + " must be a word");
  return node.Scalar();
}

int side(double value, const std::string& where, const std::string& key) {
  if (!(value >= 1 && value <= 65535) || value != static_cast<int>(value)) {
    throw std::runtime_error(where + ": " + key + " is not a picture size in px");
  }
  return static_cast<int>(value);
}

void set_distortion(CameraModel& camera, LensModel lens, const std::vector<double>& coefficients,
                    const std::string& where) {
  const std::size_t n = coefficients.size();
  const bool known = lens == LensModel::kEquidistant ? n == 4 : n == 4 || n == 5 || n == 8 || n == 12 || n == 14;
  if (!known) {
    throw std::runtime_error(where + ": " + std::to_string(n) + " distortion coefficients, must be " +
                             (lens == LensModel::kEquidistant ? "4" : "4, 5, 8, 12 or 14"));
  }
  camera.lens = lens;
  camera.distortion.fill(0);
  std::copy(coefficients.begin(), coefficients.end(), camera.distortion.begin());
}

LensModel lens_model(const std::string& name, const std::string& where) {
  for (const char* known : {"radtan", "radial-tangential", "plumb_bob", "rational_polynomial", "thin_prism", "none"}) {
    if (name == known) return LensModel::kRadtan;
  }
  for (const char* known : {"equidistant", "fisheye"}) {
    if (name == known) return LensModel::kEquidistant;
  }
  throw std::runtime_error(where + ": distortion model " + name +
                           " is not supported; calibrate with radtan (plumb_bob, rational) or equidistant");
}

}  // namespace stereotrack::calibration
