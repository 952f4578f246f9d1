#pragma once

#include <yaml-cpp/yaml.h>

#include <cstddef>
#include <string>
#include <vector>

#include "pipeline/geometry/calibration.hpp"

/// What the readers of the formats share. Everything throws std::runtime_error with one line.
namespace stereotrack::calibration {

/// A calibration file's name and whole content.
struct TextFile {
  std::string path;
  std::string text;
};

/// Refuses what is missing, unreadable, empty, larger than 16 MB or not text.
[[nodiscard]] TextFile read_text(const std::string& path);

/// Whether a line of the file begins with `key:` (YAML, KITTI), or it holds "key" (JSON) or <key (XML).
[[nodiscard]] bool has_key(const TextFile& file, const std::string& key);

/// The file as YAML; OpenCV's header line `%YAML:1.0`, which is not YAML, is skipped.
[[nodiscard]] YAML::Node parse_yaml(const TextFile& file);

/// "path:line", the line only where it is known.
[[nodiscard]] std::string place(const TextFile& file, const YAML::Node& node);

/// parent[key]; refused where it is missing.
[[nodiscard]] YAML::Node child(const TextFile& file, const YAML::Node& parent, const std::string& key);

/// The numbers of a (nested) list, or of the `data` of a matrix.
[[nodiscard]] std::vector<double> numbers(const TextFile& file, const YAML::Node& node, const std::string& key);

/// The same, refused where there are not exactly `count`.
[[nodiscard]] std::vector<double> numbers(const TextFile& file, const YAML::Node& node, const std::string& key,
                                          std::size_t count);

[[nodiscard]] std::string word(const TextFile& file, const YAML::Node& node, const std::string& key);

/// A picture's side: 1 to 65535.
[[nodiscard]] int side(double value, const std::string& where, const std::string& key);

/// Puts coefficients where the model wants them; refuses a number of them that the model does not have.
void set_distortion(CameraModel& camera, LensModel lens, const std::vector<double>& coefficients,
                    const std::string& where);

/// radtan, radial-tangential, plumb_bob, rational_polynomial, equidistant, fisheye...; others are refused.
[[nodiscard]] LensModel lens_model(const std::string& name, const std::string& where);

}  // namespace stereotrack::calibration
