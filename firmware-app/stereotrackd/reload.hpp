#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "config/configuration.hpp"
#include "firmware-app/stereotrackd/daemon.hpp"

namespace stereotrack::daemon {

/// What SIGHUP came to.
enum class Reload : std::uint8_t {
  kTakenOver,  ///< the publisher goes on with another plan, and `running` says so
  kNothing,    ///< nothing differs that could be taken over
  kRefused,    ///< the file cannot be read or is wrong: all stays as it was
};

/// Reads the configuration that the daemon was started with anew. What is wrong changes nothing; what cannot change
/// while it runs is named in the log and stays. `unit_m`: see make_plan(). The owner's thread; throws nothing but
/// std::bad_alloc.
Reload reload(const std::string& file, const std::vector<std::string>& set, double unit_m,
              config::Configuration& running, Daemon& daemon);

}  // namespace stereotrack::daemon
