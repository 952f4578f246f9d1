#include "firmware-app/stereotrackd/reload.hpp"

#include <exception>
#include <utility>

#include "firmware-app/rig/rig.hpp"
#include "firmware-app/stereotrackd/log.hpp"
#include "firmware-app/stereotrackd/plan.hpp"

namespace stereotrack::daemon {

Reload reload(const std::string& file, const std::vector<std::string>& set, double unit_m,
              config::Configuration& running, Daemon& daemon) {
  try {
    const config::Loaded loaded = load_configuration(file, set);
    const Difference change = difference(running, loaded.configuration);
    for (const std::string& key : change.refused) {
      log(LogLevel::kWarning, "reload: " + key + ": cannot change while the daemon runs, restart it",
          {{"STEREOTRACK_CAUSE", "reload"}});
    }
    if (change.plan()) {
      // What is refused must not come in with what is not: rules of other signals would drive the lines of these.
      config::Configuration next = accepted(running, loaded.configuration, change);
      daemon.exchange(make_plan(next, unit_m, change.rules));
      running = std::move(next);
    }
    log(LogLevel::kInfo, std::string("reload: ") + (change.plan() ? "taken over" : "nothing to take over"),
        {{"STEREOTRACK_CAUSE", "reload"}});
    return change.plan() ? Reload::kTakenOver : Reload::kNothing;
  } catch (const std::exception& error) {
    log(LogLevel::kError, std::string("reload: refused, the running configuration stays: ") + error.what(),
        {{"STEREOTRACK_CAUSE", "reload"}});
    daemon.count_refused_reload();
    return Reload::kRefused;
  }
}

}  // namespace stereotrack::daemon
