#include "firmware-app/evaluation/mot_file.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <fstream>
#include <map>
#include <optional>
#include <stdexcept>
#include <string_view>
#include <system_error>
#include <utility>

namespace stereotrack::evaluation {
namespace {

constexpr std::array<std::string_view, 10> kColumns = {"frame",  "id",         "left", "top", "width",
                                                       "height", "confidence", "x",    "y",   "z"};
constexpr std::size_t kLeastColumns = 7;
constexpr double kLargestCount = 1e15;  // every whole number below has an exact double

[[noreturn]] void fail_at(const std::string& name, std::size_t line, const std::string& what) {
  throw std::runtime_error(name + ":" + std::to_string(line) + ": " + what);
}

std::string_view trimmed(std::string_view text) {
  const auto first = text.find_first_not_of(" \t\r");
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(" \t\r") - first + 1);
}

std::vector<std::string_view> split(std::string_view line) {
  std::vector<std::string_view> fields;
  for (std::size_t start = 0;;) {
    const auto comma = line.find(',', start);
    fields.push_back(trimmed(line.substr(start, comma - start)));
    if (comma == std::string_view::npos) return fields;
    start = comma + 1;
  }
}

std::optional<double> number(std::string_view field) {
  double value = 0;
  const auto [end, error] = std::from_chars(field.data(), field.data() + field.size(), value);
  if (error != std::errc{} || end != field.data() + field.size() || !std::isfinite(value)) return std::nullopt;
  return value;
}

/// Trackers write frame and id as "3" or "3.0".
std::optional<std::int64_t> whole_number(double value, double least) {
  if (value < least || value > kLargestCount || value != std::floor(value)) return std::nullopt;
  return static_cast<std::int64_t>(value);
}

MotRow parse_row(std::string_view line, const std::string& name, std::size_t line_number) {
  const auto fields = split(line);
  if (fields.size() < kLeastColumns || fields.size() > kColumns.size()) {
    fail_at(name, line_number,
            std::to_string(fields.size()) +
                " columns, but 7 to 10 are needed: frame,id,left,top,width,height,confidence,x,y,z");
  }
  std::array<double, kColumns.size()> values{};
  for (std::size_t i = 0; i < fields.size(); ++i) {
    const auto value = number(fields[i]);
    if (!value) {
      fail_at(name, line_number,
              std::string(kColumns[i]) + " (column " + std::to_string(i + 1) + ") is '" + std::string(fields[i]) +
                  "', not a finite number");
    }
    values[i] = *value;
  }
  const auto frame = whole_number(values[0], 1);
  if (!frame) fail_at(name, line_number, "frame is " + std::string(fields[0]) + ", but frames count 1, 2, 3...");
  const auto id = whole_number(values[1], 0);
  if (!id) fail_at(name, line_number, "id is " + std::string(fields[1]) + ", but ids are whole numbers from 0");
  if (values[4] < 0 || values[5] < 0) {
    fail_at(name, line_number,
            "the box's size is " + std::string(fields[4]) + " x " + std::string(fields[5]) +
                ", but width and height cannot be negative");
  }

  MotRow row{*frame, *id, {values[2], values[3], values[4], values[5]}, values[6]};
  if (fields.size() == kColumns.size()) {
    row.position = {values[7], values[8], values[9]};
    row.has_position = row.position != Eigen::Vector3d(-1, -1, -1);
  }
  return row;
}

}  // namespace

double overlap(const Box& a, const Box& b) noexcept {
  const double width = std::min(a.left + a.width, b.left + b.width) - std::max(a.left, b.left);
  const double height = std::min(a.top + a.height, b.top + b.height) - std::max(a.top, b.top);
  if (width <= 0 || height <= 0) return 0;
  const double common = width * height;
  return common / (a.width * a.height + b.width * b.height - common);
}

std::vector<MotRow> read_mot(std::istream& in, const std::string& name) {
  std::vector<MotRow> rows;
  std::map<std::pair<std::int64_t, std::int64_t>, std::size_t> line_of;
  std::string line;
  for (std::size_t line_number = 1; std::getline(in, line); ++line_number) {
    const auto text = trimmed(line);
    if (text.empty() || (line_number == 1 && text.starts_with(kColumns[0]))) continue;
    rows.push_back(parse_row(text, name, line_number));
    const auto& row = rows.back();
    const auto [earlier, is_new] = line_of.try_emplace({row.frame, row.id}, line_number);
    if (!is_new) {
      fail_at(name, line_number,
              "frame " + std::to_string(row.frame) + " holds id " + std::to_string(row.id) + " already (line " +
                  std::to_string(earlier->second) + "); an id may stand once a frame");
    }
  }
  if (in.bad()) throw std::runtime_error(name + ": reading stopped with an error of the device");
  return rows;
}

std::vector<MotRow> read_mot(const std::filesystem::path& file) {
  std::error_code ignored;
  if (std::filesystem::is_directory(file, ignored)) {
    throw std::runtime_error(file.string() + ": is a folder, but a file in MOT columns is needed");
  }
  std::ifstream in(file);
  if (!in) throw std::runtime_error(file.string() + ": cannot be opened; is the path right?");
  return read_mot(in, file.string());
}

}  // namespace stereotrack::evaluation
