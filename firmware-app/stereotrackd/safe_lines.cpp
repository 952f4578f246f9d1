#include "firmware-app/stereotrackd/safe_lines.hpp"

#include <algorithm>
#include <optional>
#include <system_error>

#include "config/error.hpp"
#include "config/schema.hpp"
#include "drivers/telemetry/durable_file.hpp"
#include "firmware-app/rig/rig.hpp"
#include "firmware-app/rig/trigger.hpp"
#include "firmware-app/signals/set_up.hpp"
#include "firmware-app/stereotrackd/log.hpp"

namespace stereotrack::daemon {

namespace fs = std::filesystem;

namespace {

fs::path path_in(const fs::path& state) { return state / "taken_lines.toml"; }

void forget(const fs::path& path) noexcept {
  std::error_code ignored;
  fs::remove(path, ignored);
}

bool drive(const std::vector<config::Configuration>& configurations) {
  bool all = true;
  std::vector<gpio::LineSpec> lines;
  std::vector<trigger::Pwm::Config> pwms;
  for (const config::Configuration& configuration : configurations) {
    std::vector<gpio::LineSpec> more = signals::line_specs(configuration);
    if (const auto pulses = trigger_output(configuration)) more.push_back(*pulses);
    for (const gpio::LineSpec& line : more) {
      const auto is_same = [&](const gpio::LineSpec& other) { return to_string(other.name) == to_string(line.name); };
      if (std::none_of(lines.begin(), lines.end(), is_same)) lines.push_back(line);
    }
    // One that is asked for twice is made safe twice.
    if (const auto pwm = trigger_pwm(configuration)) pwms.push_back(*pwm);
  }
  for (const gpio::SafeOutcome& outcome : gpio::set_lines_safe(lines, "stereotrackd")) {
    log(outcome.done ? LogLevel::kInfo : LogLevel::kError, outcome.text, {{"STEREOTRACK_CAUSE", "line"}});
    all = all && outcome.done;
  }
  for (const trigger::Pwm::Config& pwm : pwms) {
    try {
      log(LogLevel::kInfo, trigger::set_pwm_safe(pwm), {{"STEREOTRACK_CAUSE", "trigger"}});
    } catch (const std::runtime_error& error) {
      log(LogLevel::kError, error.what(), {{"STEREOTRACK_CAUSE", "trigger"}});
      all = false;
    }
  }
  return all;
}

}  // namespace

TakenLines::TakenLines(const fs::path& state, const config::Configuration& configuration) : path_(path_in(state)) {
  telemetry::write_durably(path_, config::to_text(configuration));
}

TakenLines::~TakenLines() { forget(path_); }

bool make_lines_safe(const std::string& file, const std::vector<std::string>& set,
                     fs::path (*state_of)(const config::Configuration&)) {
  std::vector<config::Configuration> configurations;
  std::optional<config::Error> wrong;
  config::Configuration given;
  try {
    given = load_configuration(file, set).configuration;
  } catch (const config::Error& error) {
    wrong = error;
  }
  fs::path taken;
  try {
    taken = path_in(state_of(given));
    // Those of the run come first.
    if (fs::exists(taken)) configurations.push_back(load_configuration(taken.string(), {}).configuration);
  } catch (const std::exception& error) {
    log(LogLevel::kWarning, error.what(), {{"STEREOTRACK_CAUSE", "line"}});
  }
  if (wrong && configurations.empty()) throw config::Error(*wrong);
  if (wrong) log(LogLevel::kError, wrong->what(), {{"STEREOTRACK_CAUSE", "line"}});
  if (!wrong) configurations.push_back(given);
  if (!drive(configurations)) return false;
  if (!taken.empty()) forget(taken);
  return true;
}

}  // namespace stereotrack::daemon
