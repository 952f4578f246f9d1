#include "tests/bench/report.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "firmware-app/runtime/allocation_count.hpp"
#include "tests/bench/machine.hpp"

namespace stereotrack::bench {

namespace {

using Json = nlohmann::ordered_json;

Json or_null(const std::optional<double>& value) { return value ? Json(*value) : Json(nullptr); }

Json json_of(const Times& times) { return {{"p50", times.p50}, {"p99", times.p99}, {"max", times.max}}; }

Json json_of(const StageRow& row) {
  Json json{{"name", row.name}};
  json["ours"] = row.ours ? json_of(*row.ours) : Json(nullptr);
  json["theirs"] = row.theirs ? json_of(*row.theirs) : Json(nullptr);
  const bool both = row.ours && row.theirs && row.ours->p50 > 0;
  json["ratio"] = both ? Json(row.theirs->p50 / row.ours->p50) : Json(nullptr);
  return json;
}

Json json_of(const std::vector<StageRow>& rows) {
  Json json = Json::array();
  for (const StageRow& row : rows) json.push_back(json_of(row));
  return json;
}

// Bytes in so many milliseconds [GB/s].
double gb_s(double bytes, double ms) { return bytes / 1e6 / ms; }

Json json_of(const Entry& entry) {
  Json json{{"name", entry.name},
            {"what", entry.what},
            {"unit", "ms"},
            {"ours", entry.ours.ms.p50},
            {"theirs", entry.theirs.ms.p50},
            {"ratio", entry.ratio()}};
  json["target"] = or_null(entry.target);
  for (const auto& [name, side] : {std::pair{"ours", &entry.ours}, std::pair{"theirs", &entry.theirs}}) {
    Json& detail = json["detail"][name];
    detail = json_of(side->ms);
    detail["wall"] = json_of(side->wall_ms);
    detail["allocations"] = allocations_are_counted() ? Json(side->allocations) : Json(nullptr);
    detail["instructions"] = or_null(side->instructions);
    if (side->targets) detail["targets"] = *side->targets;
    detail["gb_per_s"] = gb_s(entry.bytes, side->ms.p50);
  }
  json["bytes"] = entry.bytes;
  if (!entry.stages.empty()) json["stages"] = json_of(entry.stages);
  if (!entry.calls.empty()) json["calls"] = json_of(entry.calls);
  return json;
}

std::string printed(const char* format, double value) {
  char text[64];
  (void)std::snprintf(text, sizeof text, format, value);
  return text;
}

// Three digits that mean something.
std::string number(double value) {
  if (value == 0) return "0";
  if (std::abs(value) >= 100) return printed("%.0f", value);
  if (std::abs(value) >= 10) return printed("%.1f", value);
  return printed(std::abs(value) >= 1 ? "%.2f" : "%.3f", value);
}
std::string number_or_dash(const std::optional<double>& value) { return value ? number(*value) : "-"; }

// Markdown with columns of one width; the first is set left, the others right.
class Table {
 public:
  explicit Table(std::vector<std::string> head) : rows_{std::move(head)} {}
  void add(std::vector<std::string> row) { rows_.push_back(std::move(row)); }
  [[nodiscard]] std::string text() const {
    std::vector<std::size_t> widths(rows_.front().size(), 3);
    for (const auto& row : rows_) {
      for (std::size_t i = 0; i < row.size(); ++i) widths[i] = std::max(widths[i], row[i].size());
    }
    std::string out;
    for (std::size_t r = 0; r < rows_.size(); ++r) {
      for (std::size_t i = 0; i < widths.size(); ++i) {
        const std::size_t room = widths[i] - rows_[r][i].size();
        out.append("| ").append(i == 0 ? 0 : room, ' ').append(rows_[r][i]).append(i == 0 ? room + 1 : 1, ' ');
      }
      out += "|\n";
      if (r != 0) continue;
      for (std::size_t i = 0; i < widths.size(); ++i) {
        out.append("|").append(widths[i] + 1, '-').append(i == 0 ? "-" : ":");
      }
      out += "|\n";
    }
    return out + "\n";
  }

 private:
  std::vector<std::vector<std::string>> rows_;
};

std::string today() {
  const std::time_t now = std::time(nullptr);
  std::tm parts{};
  char text[16];
  if (gmtime_r(&now, &parts) == nullptr || std::strftime(text, sizeof text, "%Y-%m-%d", &parts) == 0) return "";
  return text;
}

std::string verdict(const Entry& entry) {
  if (!entry.target) return "-";
  return number(*entry.target) + (entry.ratio() >= *entry.target ? ", reached" : ", missed");
}

std::string entries_table(const Report& report) {
  Table table({"entry", "ours p50", "p99", "max", "OpenCV p50", "p99", "max", "ratio", "target"});
  for (const Entry& entry : report.entries) {
    const Times& ours = entry.ours.ms;
    const Times& theirs = entry.theirs.ms;
    table.add({entry.name, number(ours.p50), number(ours.p99), number(ours.max), number(theirs.p50), number(theirs.p99),
               number(theirs.max), number(entry.ratio()), verdict(entry)});
  }
  return table.text();
}

std::string resources_table(const Report& report) {
  Table table({"entry", "allocations", "OpenCV", "M instructions", "OpenCV", "GB/s used", "OpenCV", "% of copy"});
  const auto millions = [](const std::optional<double>& count) {
    return count ? number(*count / 1e6) : std::string("-");
  };
  const auto allocations = [](double count) {
    return allocations_are_counted() ? printed("%.0f", count) : std::string("-");
  };
  for (const Entry& entry : report.entries) {
    const double used = gb_s(entry.bytes, entry.ours.ms.p50);
    table.add({entry.name, allocations(entry.ours.allocations), allocations(entry.theirs.allocations),
               millions(entry.ours.instructions), millions(entry.theirs.instructions), number(used),
               number(gb_s(entry.bytes, entry.theirs.ms.p50)), number(100 * used / report.copy_gb_s)});
  }
  return table.text();
}

std::string scaling_table(const Report& report) {
  Table table({"scaling", "measured", "dearest / cheapest", "limit"});
  for (const Scaling& scaling : report.scalings) {
    std::string values;
    for (const auto& [name, value] : scaling.values) {
      values += (values.empty() ? "" : ", ") + name + ": " + number(value);
    }
    table.add({scaling.name, values + " " + scaling.unit, number(scaling.growth()),
               number(scaling.limit) + (scaling.growth() <= scaling.limit ? ", kept" : ", missed")});
  }
  return table.text();
}

std::optional<double> p50(const std::optional<Times>& times) {
  return times ? std::optional(times->p50) : std::nullopt;
}

std::string stages_table(const Entry& entry) {
  Table table({entry.name, "ours p50", "p99", "max", "OpenCV p50", "p99", "max", "ratio"});
  const auto cells = [](const std::optional<Times>& times) -> std::vector<std::string> {
    if (!times) return {"-", "-", "-"};
    return {number(times->p50), number(times->p99), number(times->max)};
  };
  for (const StageRow& row : entry.stages) {
    std::vector<std::string> line{row.name};
    for (const auto& side : {row.ours, row.theirs}) {
      for (std::string& cell : cells(side)) line.push_back(std::move(cell));
    }
    const bool both = row.ours && row.theirs && row.ours->p50 > 0;
    line.push_back(both ? number(row.theirs->p50 / row.ours->p50) : "-");
    table.add(std::move(line));
  }
  std::string calls;
  for (const StageRow& row : entry.calls) {
    calls += (calls.empty() ? "" : ", ") + row.name + " " + number_or_dash(p50(row.theirs));
  }
  return table.text() + "Targets in the last frame: ours " + std::to_string(entry.ours.targets.value_or(0)) +
         ", OpenCV " + std::to_string(entry.theirs.targets.value_or(0)) + ". OpenCV's p50 by call: " + calls + ".\n\n";
}

std::string setting(const Report& report) {
  const Machine machine = this_machine();
  const OpenCvBuild opencv = opencv_build();
  std::string text = "* Machine: " + machine.cpu + ", " + std::to_string(machine.cores) + " cores, " + machine.kernel +
                     "; one thread measured.\n* Ours: " + machine.compiler + ", " + machine.build_type +
                     ", best SIMD target " + machine.simd + ".\n* OpenCV " + opencv.version + ": " + opencv.build +
                     ".\n* " + std::to_string(report.frames) + " timed calls after " + std::to_string(report.warm_up) +
                     " others" + (report.quick ? ", fewer where pictures are large (--quick)" : "") +
                     "; ms of CPU time of the one thread.\n* memcpy moves " + number(report.copy_gb_s) +
                     " GB/s, read and written; \"used\" counts what any program must read and write, once.\n";
  text += report.instructions_by.empty()
              ? "* Instructions are not counted: " + report.instructions_why + ".\n"
              : "* Instructions: by " + report.instructions_by +
                    (report.instructions_why.empty() ? "" : ", " + report.instructions_why) + ".\n";
  text += "* Equal to the naive result on every pixel:";
  for (const std::string& check : report.checks) text += (&check == report.checks.data() ? " " : "; ") + check;
  return text + ".\n\n";
}

}  // namespace

double Scaling::growth() const {
  const auto [least, most] = std::minmax_element(values.begin(), values.end(),
                                                 [](const auto& a, const auto& b) { return a.second < b.second; });
  return most->second / least->second;
}

void write_json(const Report& report, const std::string& file) {
  const Machine machine = this_machine();
  const OpenCvBuild opencv = opencv_build();
  Json json;
  json["machine"] = {{"name", machine.name},         {"cpu", machine.cpu},
                     {"cores", machine.cores},       {"kernel", machine.kernel},
                     {"compiler", machine.compiler}, {"build_type", machine.build_type},
                     {"simd", machine.simd},         {"copy_gb_per_s", report.copy_gb_s}};
  json["opencv"] = {{"version", opencv.version}, {"build", opencv.build}, {"threads", 1}};
  json["date"] = today();
  json["quick"] = report.quick;
  json["frames"] = report.frames;
  json["warm_up"] = report.warm_up;
  json["instructions"] = {{"by", report.instructions_by.empty() ? Json(nullptr) : Json(report.instructions_by)},
                          {"note", report.instructions_why}};
  json["equal_to_naive"] = report.checks;
  json["entries"] = Json::array();
  for (const Entry& entry : report.entries) json["entries"].push_back(json_of(entry));
  json["scaling"] = Json::array();
  for (const Scaling& scaling : report.scalings) {
    Json values;
    for (const auto& [name, value] : scaling.values) values[name] = value;
    json["scaling"].push_back({{"name", scaling.name},
                               {"what", scaling.what},
                               {"unit", scaling.unit},
                               {"values", values},
                               {"growth", scaling.growth()},
                               {"limit", scaling.limit}});
  }
  std::ofstream out(file, std::ios::trunc);
  out << json.dump(1) << '\n';
  out.close();
  if (out.fail()) throw std::runtime_error(file + ": cannot be written whole; is the disk full?");
}

std::map<std::string, double> read_callgrind(const std::string& folder) {
  constexpr std::string_view kName = "desc: Trigger: Client Request: ";
  constexpr std::string_view kTotals = "totals: ";
  std::map<std::string, double> counts;
  for (const auto& file : std::filesystem::directory_iterator(folder)) {
    std::ifstream lines(file.path());
    std::string name;
    for (std::string line; std::getline(lines, line);) {
      if (line.starts_with(kName)) name = line.substr(kName.size());
      if (line.starts_with(kTotals) && !name.empty()) counts[name] = std::stod(line.substr(kTotals.size()));
    }
  }
  return counts;
}

std::string to_text(const Report& report, bool for_page) {
  std::string text;
  if (for_page) text += "## " + today() + "\n\n";
  text += setting(report) + entries_table(report) + scaling_table(report);
  if (!for_page) return text;
  text += "### Allocations, instructions, bandwidth\n\nA call each.\n\n" + resources_table(report) + "### Stages\n\n";
  for (const Entry& entry : report.entries) {
    if (!entry.stages.empty()) text += stages_table(entry);
  }
  text.pop_back();
  return text;
}

}  // namespace stereotrack::bench
