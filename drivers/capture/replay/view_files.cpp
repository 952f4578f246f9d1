#include "drivers/capture/replay/view_files.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <fstream>
#include <regex>
#include <stdexcept>
#include <string>

namespace stereotrack::capture {
namespace {

namespace fs = std::filesystem;
using std::chrono::nanoseconds;

bool is_digit(char c) { return c >= '0' && c <= '9'; }

template <class Integer>
std::optional<Integer> to_integer(std::string_view text) {
  Integer value{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size()) return std::nullopt;
  return value;
}

std::string_view without_zeros(std::string_view digits) {
  const std::size_t first = digits.find_first_not_of('0');
  return first == std::string_view::npos ? std::string_view{} : digits.substr(first);
}

std::vector<std::string_view> digit_runs(std::string_view text) {
  std::vector<std::string_view> runs;
  for (std::size_t i = 0; i < text.size();) {
    std::size_t end = i;
    while (end < text.size() && is_digit(text[end])) ++end;
    if (end > i) runs.push_back(text.substr(i, end - i));
    i = end > i ? end : i + 1;
  }
  return runs;
}

std::string_view trim(std::string_view text) {
  constexpr std::string_view kBlank = " \t\r\n";
  const std::size_t first = text.find_first_not_of(kBlank);
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(kBlank) - first + 1);
}

nanoseconds unix_time(const std::string& seconds, std::string fraction) {
  fraction.resize(9, '0');
  return std::chrono::seconds(std::stoll(seconds)) + nanoseconds(std::stoll(fraction));
}

std::optional<nanoseconds> seconds_text(std::string_view text) {
  const std::size_t point = text.find('.');
  const std::string_view whole = text.substr(0, point);
  const std::string_view fraction = point == std::string_view::npos ? std::string_view{} : text.substr(point + 1);
  const bool plain = !whole.empty() && whole.size() <= 10 && fraction.size() <= 9 &&
                     std::all_of(whole.begin(), whole.end(), is_digit) &&
                     std::all_of(fraction.begin(), fraction.end(), is_digit);
  if (plain) return unix_time(std::string(whole), std::string(fraction));
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size() || !(std::abs(value) < 9e9)) return std::nullopt;
  return nanoseconds(std::llround(value * 1e9));
}

[[noreturn]] void fail_line(const fs::path& file, std::size_t line, const std::string& what) {
  throw std::runtime_error(file.string() + ":" + std::to_string(line) + ": " + what);
}

std::ifstream open_list(const fs::path& file) {
  std::ifstream in(file);
  if (!in) throw std::runtime_error(file.string() + ": cannot be read: check that it is a file and its permissions");
  return in;
}

}  // namespace

bool is_picture_name(const fs::path& path) {
  static constexpr std::array<std::string_view, 8> kExtensions{".png", ".jpg", ".jpeg", ".bmp",
                                                               ".pgm", ".ppm", ".tif",  ".tiff"};
  if (path.filename().string().starts_with('.')) return false;
  std::string extension = path.extension().string();
  for (char& c : extension) {
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  }
  return std::find(kExtensions.begin(), kExtensions.end(), extension) != kExtensions.end();
}

std::optional<nanoseconds> time_in_name(std::string_view stem) {
  // Ten digits without a leading zero are a unix time after 2001; a counter padded to ten digits is not.
  static const std::regex kSeconds(R"((?:^|[^0-9])([1-9][0-9]{9})([_.])([0-9]{1,9})(?![0-9]))");
  static const std::regex kNanoseconds(R"((?:^|[^0-9])([1-9][0-9]{18})(?![0-9]))");
  const std::string text(stem);
  std::smatch match;
  if (std::regex_search(text, match, kSeconds)) {
    if (match[2] == ".") return unix_time(match[1], match[3]);
    return std::chrono::seconds(std::stoll(match[1])) + nanoseconds(std::stoll(match[3]));
  }
  if (std::regex_search(text, match, kNanoseconds)) {
    if (const auto count = to_integer<std::int64_t>(match[1].str())) return nanoseconds(*count);
  }
  return std::nullopt;
}

bool natural_less(std::string_view a, std::string_view b) {
  std::size_t i = 0;
  std::size_t j = 0;
  while (i < a.size() && j < b.size()) {
    if (is_digit(a[i]) && is_digit(b[j])) {
      const std::size_t i_end = std::min(a.find_first_not_of("0123456789", i), a.size());
      const std::size_t j_end = std::min(b.find_first_not_of("0123456789", j), b.size());
      const std::string_view x = without_zeros(a.substr(i, i_end - i));
      const std::string_view y = without_zeros(b.substr(j, j_end - j));
      if (x.size() != y.size()) return x.size() < y.size();
      if (x != y) return x < y;
      i = i_end;
      j = j_end;
    } else {
      if (a[i] != b[j]) return a[i] < b[j];
      ++i;
      ++j;
    }
  }
  if (i < a.size() || j < b.size()) return j < b.size();
  return a < b;
}

void number_files(View& view) {
  std::vector<std::string> stems;
  std::vector<std::vector<std::string_view>> runs;
  stems.reserve(view.size());
  runs.reserve(view.size());
  for (const ViewFile& file : view) {
    stems.push_back(file.path.stem().string());
    runs.push_back(digit_runs(stems.back()));
  }
  const auto from_end = [](const std::vector<std::string_view>& list, std::size_t k) {
    return k < list.size() ? list[list.size() - 1 - k] : std::string_view{};
  };
  std::size_t k = 0;
  if (view.size() > 1) {
    const auto constant = [&](std::size_t position) {
      const std::string_view first = from_end(runs.front(), position);
      return !first.empty() &&
             std::all_of(runs.begin(), runs.end(), [&](const auto& list) { return from_end(list, position) == first; });
    };
    while (constant(k)) ++k;
  }
  for (std::size_t i = 0; i < view.size(); ++i) {
    const std::string_view digits = from_end(runs[i], k);
    const std::string_view value = without_zeros(digits);
    view[i].number.reset();
    if (digits.empty() || value.size() > 18) continue;
    view[i].number = value.empty() ? 0 : to_integer<std::uint64_t>(value);
  }
}

View list_pictures(const fs::path& folder) {
  std::error_code error;
  View view;
  fs::directory_iterator entry(folder, error);
  for (; !error && entry != fs::directory_iterator(); entry.increment(error)) {
    if (is_picture_name(entry->path())) {
      view.push_back({entry->path(), time_in_name(entry->path().stem().string()), std::nullopt});
    }
  }
  if (error) throw std::runtime_error(folder.string() + ": cannot list the folder: " + error.message());
  std::sort(view.begin(), view.end(), [](const ViewFile& a, const ViewFile& b) {
    return natural_less(a.path.filename().string(), b.path.filename().string());
  });
  number_files(view);
  return view;
}

View list_euroc_camera(const fs::path& camera) {
  const fs::path list = camera / "data.csv";
  if (!fs::exists(list)) {
    if (!fs::is_directory(camera / "data")) {
      throw std::runtime_error(camera.string() + ": has neither data.csv nor data/: a EuRoC camera folder has both");
    }
    return list_pictures(camera / "data");
  }
  std::ifstream in = open_list(list);
  View view;
  std::string line;
  for (std::size_t number = 1; std::getline(in, line); ++number) {
    const std::string_view text = trim(line);
    if (text.empty() || text.front() == '#') continue;
    const std::size_t comma = text.find(',');
    const auto time = to_integer<std::int64_t>(trim(text.substr(0, comma)));
    const std::string name{comma == std::string_view::npos ? std::string_view{} : trim(text.substr(comma + 1))};
    if (!time || name.empty()) fail_line(list, number, "expected `time in ns,file name`: correct or remove the line");
    view.push_back({camera / "data" / name, nanoseconds(*time), std::nullopt});
  }
  if (view.empty()) {
    throw std::runtime_error(list.string() + ": lists no pictures: add `time in ns,file name` lines, or remove it");
  }
  return view;
}

std::vector<nanoseconds> read_kitti_times(const fs::path& file) {
  std::ifstream in = open_list(file);
  std::vector<nanoseconds> times;
  std::string line;
  for (std::size_t number = 1; std::getline(in, line); ++number) {
    const std::string_view text = trim(line);
    if (text.empty()) continue;
    const auto time = seconds_text(text);
    if (!time) fail_line(file, number, "expected a time in seconds: correct the line or remove the file");
    if (!times.empty() && *time <= times.back()) {
      fail_line(file, number, "not later than the time before: correct the line or remove the file");
    }
    times.push_back(*time);
  }
  return times;
}

}  // namespace stereotrack::capture
