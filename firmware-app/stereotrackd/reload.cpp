#include "firmware-app/stereotrackd/reload.hpp"

#include <exception>
#include <memory>
#include <stdexcept>
#include <utility>

#include "firmware-app/rig/rig.hpp"
#include "firmware-app/stereotrackd/log.hpp"
#include "firmware-app/stereotrackd/plan.hpp"

namespace stereotrack::daemon {

namespace {

/// False: the log was told why not.
bool take_inputs(const config::Configuration& wanted, Daemon& daemon) {
  try {
    daemon.inputs().exchange(input_setup(wanted), daemon.black_box());
    return true;
  } catch (const std::runtime_error& error) {
    log(LogLevel::kWarning, std::string("reload: input: cannot change: ") + error.what(),
        {{"STEREOTRACK_CAUSE", "reload"}});
    return false;
  }
}

}  // namespace

Reload reload(const std::string& file, const std::vector<std::string>& set, double unit_m,
              config::Configuration& running, Daemon& daemon) {
  try {
    const config::Loaded loaded = load_configuration(file, set);
    Difference change = difference(running, loaded.configuration);
    for (const std::string& key : change.refused) {
      log(LogLevel::kWarning, "reload: " + key + ": cannot change while the daemon runs, restart it",
          {{"STEREOTRACK_CAUSE", "reload"}});
    }
    // What is refused must not come in with what is not: rules of other signals would drive the lines of these.
    std::unique_ptr<Plan> plan;
    if (change.plan()) plan = make_plan(accepted(running, loaded.configuration, change), unit_m, change.rules);
    // From here on nothing throws: all is taken over, or nothing was.
    if (change.inputs) change.inputs = take_inputs(loaded.configuration, daemon);
    if (plan) daemon.exchange(std::move(plan));
    running = accepted(running, loaded.configuration, change);
    const bool takes = change.plan() || change.inputs;
    log(LogLevel::kInfo, std::string("reload: ") + (takes ? "taken over" : "nothing to take over"),
        {{"STEREOTRACK_CAUSE", "reload"}});
    return takes ? Reload::kTakenOver : Reload::kNothing;
  } catch (const std::exception& error) {
    log(LogLevel::kError, std::string("reload: refused, the running configuration stays: ") + error.what(),
        {{"STEREOTRACK_CAUSE", "reload"}});
    daemon.count_refused_reload();
    return Reload::kRefused;
  }
}

}  // namespace stereotrack::daemon
