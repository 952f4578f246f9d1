#include "drivers/record/calibration_text.hpp"

#include <array>
#include <span>

#include "drivers/record/text_lines.hpp"

namespace stereotrack::record {

namespace {

constexpr const char* kRadtanName = "radtan";
constexpr const char* kEquidistantName = "equidistant";

void write(TextWriter& out, const std::string& view, const CameraModel& camera) {
  out.key(view + ".size").number(camera.width).number(camera.height);
  out.key(view + ".matrix").number(camera.fx).number(camera.fy).number(camera.cx).number(camera.cy);
  out.key(view + ".lens").word(camera.lens == LensModel::kRadtan ? kRadtanName : kEquidistantName);
  out.key(view + ".distortion").numbers(std::span<const double>(camera.distortion));
}

CameraModel read(const TextReader& in, const std::string& view) {
  CameraModel camera;
  std::array<int, 2> size{};
  in.numbers(view + ".size", std::span<int>(size));
  camera.width = size[0];
  camera.height = size[1];
  std::array<double, 4> matrix{};
  in.numbers(view + ".matrix", std::span<double>(matrix));
  camera.fx = matrix[0];
  camera.fy = matrix[1];
  camera.cx = matrix[2];
  camera.cy = matrix[3];
  const std::string lens = in.word(view + ".lens");
  if (lens != kRadtanName && lens != kEquidistantName) in.fail(view + ".lens", "is no lens that is known: " + lens);
  camera.lens = lens == kRadtanName ? LensModel::kRadtan : LensModel::kEquidistant;
  in.numbers(view + ".distortion", std::span<double>(camera.distortion));
  return camera;
}

}  // namespace

std::string to_text(const StereoCalibration& calibration) {
  TextWriter out;
  write(out, "left", calibration.left);
  write(out, "right", calibration.right);
  out.key("R_right_left");
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) out.number(calibration.R_right_left(row, column));
  }
  out.key("t_right_left");
  for (int row = 0; row < 3; ++row) out.number(calibration.t_right_left(row));
  return out.text();
}

StereoCalibration calibration_from_text(const std::string& text, const std::string& name) {
  const TextReader in(text, name);
  StereoCalibration calibration;
  calibration.left = read(in, "left");
  calibration.right = read(in, "right");
  std::array<double, 9> rotation{};
  in.numbers("R_right_left", std::span<double>(rotation));
  for (int i = 0; i < 9; ++i) calibration.R_right_left(i / 3, i % 3) = rotation[static_cast<std::size_t>(i)];
  std::array<double, 3> translation{};
  in.numbers("t_right_left", std::span<double>(translation));
  for (int i = 0; i < 3; ++i) calibration.t_right_left(i) = translation[static_cast<std::size_t>(i)];
  return calibration;
}

}  // namespace stereotrack::record
