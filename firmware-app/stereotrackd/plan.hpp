#pragma once

#include <memory>
#include <string>
#include <vector>

#include "config/load.hpp"
#include "firmware-app/stereotrackd/publisher_rt.hpp"

namespace stereotrack::daemon {

/// Where telemetry goes and what the lines tell, as the configuration says; without rules the publisher keeps those
/// that it has. Throws config::Error, telemetry::EndpointError or std::runtime_error, one line.
[[nodiscard]] std::unique_ptr<Plan> make_plan(const config::Configuration& configuration, double unit_m,
                                              bool with_rules = true);

/// What another configuration would change of one that runs.
struct Difference {
  bool destinations = false;
  bool rules = false;                ///< signals, whose lines are the same, and zones that the pipeline does not use
  bool inputs = false;               ///< all of them, and record.on_input
  std::vector<std::string> refused;  ///< keys that need a restart, and zones that the pipeline uses: "zone NAME"
  [[nodiscard]] bool plan() const noexcept { return destinations || rules; }
};
/// `running` with what of `wanted` can be taken over. A zone that the pipeline uses stays as it is; one that it would
/// use only after a restart is there meanwhile for signals that name it.
[[nodiscard]] config::Configuration accepted(const config::Configuration& running, const config::Configuration& wanted,
                                             const Difference& difference);
[[nodiscard]] Difference difference(const config::Configuration& running, const config::Configuration& wanted);

}  // namespace stereotrack::daemon
