#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "config/configuration.hpp"

namespace stereotrack::daemon {

/// What a run took its lines by, in its state directory from before it asks for them until it has ended in order: who
/// makes them safe after a crash must not depend on a file that somebody may have changed, or broken, since.
class TakenLines {
 public:
  /// On the disk when it returns. Throws std::runtime_error.
  TakenLines(const std::filesystem::path& state, const config::Configuration& configuration);
  TakenLines(const TakenLines&) = delete;
  TakenLines& operator=(const TakenLines&) = delete;
  ~TakenLines();

 private:
  std::filesystem::path path_;
};

/// After a crash, in a process of its own (ExecStopPost): drives the lines of the run that crashed, and those of the
/// configuration as it is now, to their safe states, and their PWM, too; where both name a line, it is as the run had
/// it. Each outcome is a line of the log. False: one refused. `state_of`: the state directory of a configuration.
/// Throws config::Error where the configuration is wrong and no run left any.
[[nodiscard]] bool make_lines_safe(const std::string& file, const std::vector<std::string>& set,
                                   std::filesystem::path (*state_of)(const config::Configuration&));

}  // namespace stereotrack::daemon
