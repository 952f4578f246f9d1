#pragma once

#include <memory>
#include <string>
#include <vector>

#include "config/load.hpp"
#include "firmware-app/stereotrackd/publisher_rt.hpp"

namespace stereotrack::daemon {

/// Where telemetry goes and what the lines tell, as the configuration says. Throws config::Error,
/// telemetry::EndpointError or std::runtime_error, one line.
[[nodiscard]] std::unique_ptr<Plan> make_plan(const config::Configuration& configuration, double unit_m);

/// What another configuration would change of one that runs.
struct Difference {
  bool plan = false;                 ///< something that a Plan holds
  std::vector<std::string> refused;  ///< keys that need a restart
};
/// Copies what a Plan is made of.
void take_plan_keys(const config::Configuration& from, config::Configuration& to);
[[nodiscard]] Difference difference(const config::Configuration& running, const config::Configuration& wanted);

}  // namespace stereotrack::daemon
