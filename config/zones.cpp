#include "config/zones.hpp"

#include <array>

#include "config/signals.hpp"

namespace stereotrack::config {
namespace {

static_assert(kMaxZones == ZoneRules::kMaxZones && kMaxCorners == Zone::kMaxCorners);

constexpr double kAnywhere_m = 1e6;

[[nodiscard]] Zone::Range range_of(const std::array<double, 2>& said) {
  const bool anywhere = said[0] == 0 && said[1] == 0;
  return anywhere ? Zone::Range{-kAnywhere_m, kAnywhere_m} : Zone::Range{said[0], said[1]};
}

[[nodiscard]] ZoneRules::Targets targets_of(ZoneTargets said) {
  switch (said) {
    case ZoneTargets::kAll: break;
    case ZoneTargets::kNoneBegin: return ZoneRules::Targets::kNoneBegin;
    case ZoneTargets::kIgnore: return ZoneRules::Targets::kIgnore;
  }
  return ZoneRules::Targets::kAll;
}

[[nodiscard]] bool has_rule(const ZoneConfig& zone) {
  return zone.targets != ZoneTargets::kAll || zone.min_size_m > 0 || zone.max_size_m > 0;
}

}  // namespace

Zone zone_of(const ZoneConfig& said) {
  Zone zone;
  zone.kind = said.picture.empty() ? Zone::Kind::kSpace : Zone::Kind::kPicture;
  zone.x_m = range_of(said.x_m);
  zone.y_m = range_of(said.y_m);
  zone.z_m = range_of(said.z_m);
  for (const auto& [x, y] : said.picture) (void)zone.corners.push({x, y});
  zone.anchor = said.anchor == ZoneAnchor::kBottom ? Zone::Anchor::kBottom : Zone::Anchor::kCentre;
  return zone;
}

bool is_for_pipeline(const ZoneConfig& zone, const std::string& volume) {
  return has_rule(zone) || (!volume.empty() && zone.name == volume);
}

PipelineConfig pipeline_of(const Configuration& configuration, double unit_m) {
  PipelineConfig told = configuration.pipeline;
  told.zones.unit_m = unit_m;
  told.zones.zones.clear();
  told.zones.volume.reset();
  const std::array<double, 3>& gravity = configuration.track.gravity_m_s2;
  if (unit_m > 0) told.track.gravity = Eigen::Vector3d(gravity[0], gravity[1], gravity[2]) / unit_m;
  for (const ZoneConfig& zone : configuration.zones) {
    if (has_rule(zone)) {
      (void)told.zones.zones.push({.zone = zone_of(zone),
                                   .targets = targets_of(zone.targets),
                                   .min_size_m = zone.min_size_m,
                                   .max_size_m = zone.max_size_m});
    }
    if (!configuration.objects.volume.empty() && zone.name == configuration.objects.volume) {
      told.zones.volume = zone_of(zone);
    }
  }
  return told;
}

}  // namespace stereotrack::config
