#pragma once

#include "config/configuration.hpp"
#include "pipeline/pipeline_config.hpp"
#include "pipeline/track/zone.hpp"

namespace stereotrack::config {

/// Where it is. What load() let pass is good.
[[nodiscard]] Zone zone_of(const ZoneConfig& said);

/// Whether the pipeline uses it, for a rule of its own or as `volume`, objects.volume; else it is for signals alone.
[[nodiscard]] bool is_for_pipeline(const ZoneConfig& zone, const std::string& volume);

/// What the pipeline is told: `pipeline` with what is said of places and in metres, the rules of [[zone]] and of
/// [objects], and gravity. unit_m: metres in one unit of the calibration; 0: not known, and check_metres() has let pass
/// that nothing is in metres.
[[nodiscard]] PipelineConfig pipeline_of(const Configuration& configuration, double unit_m);

}  // namespace stereotrack::config
