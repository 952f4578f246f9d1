#include "pipeline/track/zone_rules.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <span>

#include "pipeline/core/checksum.hpp"

namespace stereotrack {
namespace {

[[nodiscard]] bool is_size(double size_m) noexcept { return std::isfinite(size_m) && size_m >= 0; }

[[nodiscard]] bool is_range(double least, double most) noexcept {
  return is_size(least) && is_size(most) && (most == 0 || least <= most);
}

/// The longer side of the box at the detection's distance [calibration unit]; 0 where that is not known.
[[nodiscard]] double longer_side(const Detection& detection, const Rectifier& rectifier) noexcept {
  const Rect& box = detection.box;
  const ImageView<const Rectifier::PointF> places = rectifier.rectified_from_raw();
  const auto length_px = [&](const Point& first, const Point& last, int pixels) {
    const Rectifier::PointF a = places.at(first.x, first.y);
    const Rectifier::PointF b = places.at(last.x, last.y);
    if (pixels < 2 || !a.valid() || !b.valid()) return 0.0;
    const double dx = b.x - a.x;
    const double dy = b.y - a.y;
    return std::sqrt(dx * dx + dy * dy) * pixels / (pixels - 1);  // from rim to rim, not from centre to centre
  };
  const int x = box.left + box.width / 2;
  const int y = box.top + box.height / 2;
  const double across = length_px({box.left, y}, {box.right() - 1, y}, box.width);
  const double down = length_px({x, box.top}, {x, box.bottom() - 1}, box.height);
  return std::max(across, down) * detection.position.z() / rectifier.geometry().f;
}

[[nodiscard]] std::uint64_t fingerprint_of(const ZoneRules::Rule& rule) noexcept {
  constexpr std::size_t kFixed = 12;
  std::array<double, kFixed + 2 * Zone::kMaxCorners> numbers{};
  const Zone& zone = rule.zone;
  const std::array<double, kFixed> fixed{static_cast<double>(zone.kind),
                                         static_cast<double>(zone.anchor),
                                         static_cast<double>(rule.targets),
                                         zone.x_m.from,
                                         zone.x_m.to,
                                         zone.y_m.from,
                                         zone.y_m.to,
                                         zone.z_m.from,
                                         zone.z_m.to,
                                         rule.min_size_m,
                                         rule.max_size_m,
                                         static_cast<double>(zone.corners.size())};
  std::copy(fixed.begin(), fixed.end(), numbers.begin());
  for (std::size_t i = 0; i < zone.corners.size(); ++i) {
    numbers[kFixed + 2 * i] = zone.corners[i].x;
    numbers[kFixed + 2 * i + 1] = zone.corners[i].y;
  }
  return checksum(std::as_bytes(std::span(numbers)));
}

}  // namespace

Result<ZoneRules> ZoneRules::create(const Config& config, int width, int height, Arena& arena) noexcept {
  if (width < 1 || height < 1) return fail(Fault::kBadSize);
  if (!std::isfinite(config.unit_m)) return fail(Fault::kNotFinite);
  bool metres = config.volume.has_value() || config.min_size_m > 0 || config.max_size_m > 0;
  bool good = config.unit_m >= 0 && is_range(config.min_size_m, config.max_size_m);
  if (config.volume) {
    if (const Result<void> checked = check(*config.volume); !checked) return fail(checked.error());
    good = good && config.volume->kind == Zone::Kind::kSpace;
  }
  ZoneRules self;
  self.limits_size_ = config.min_size_m > 0 || config.max_size_m > 0;
  bool has_mask = false;
  for (const Rule& rule : config.zones) {
    if (const Result<void> checked = check(rule.zone); !checked) return fail(checked.error());
    good = good && is_range(rule.min_size_m, rule.max_size_m);
    const bool sized = rule.min_size_m > 0 || rule.max_size_m > 0;
    self.limits_size_ = self.limits_size_ || sized;
    metres = metres || sized || rule.zone.kind == Zone::Kind::kSpace;
    has_mask = has_mask || (rule.targets == Targets::kIgnore && rule.zone.kind == Zone::Kind::kPicture);
  }
  if (!good || (metres && !(config.unit_m > 0))) return fail(Fault::kBadConfig);
  self.config_ = config;
  self.width_ = width;
  self.height_ = height;
  if (!has_mask) return self;
  self.ignored_ = BitMask::create(width, height, arena);
  if (arena.failed()) return fail(Fault::kOutOfMemory);
  for (const Rule& rule : config.zones) {
    if (rule.targets != Targets::kIgnore || rule.zone.kind != Zone::Kind::kPicture) continue;
    add_polygon(rule.zone.corners.view(), self.ignored_);
  }
  return self;
}

double ZoneRules::limit_for(const Detection& detection, double Rule::*limit, double everywhere) const noexcept {
  for (const Rule& rule : config_.zones) {
    if (rule.*limit > 0 && contains(rule.zone, detection, config_.unit_m)) return rule.*limit;
  }
  return everywhere;
}

bool ZoneRules::is_cut(const Rect& box) const noexcept {
  if (box.left <= 0 || box.top <= 0 || box.right() >= width_ || box.bottom() >= height_) return true;
  if (ignored_.width == 0) return false;
  const Rect around = grown(box, 1);
  for (int y = around.top; y < around.bottom(); ++y) {
    for (int x = around.left; x < around.right(); ++x) {
      if (ignored_.at(x, y)) return true;
    }
  }
  return false;
}

ZoneRules::Verdict ZoneRules::judge(const Detection& detection, bool claimed,
                                    const Rectifier* rectifier) const noexcept {
  if (!detection.has_depth) return {};
  if (config_.volume && !contains(*config_.volume, detection, config_.unit_m)) return {Rejection::kOutside, 0};
  for (const Rule& rule : config_.zones) {
    const bool box = rule.targets == Targets::kIgnore && rule.zone.kind == Zone::Kind::kSpace;
    if (box && contains(rule.zone, detection, config_.unit_m)) return {Rejection::kIgnored, 0};
  }
  if (!limits_size_ || claimed || rectifier == nullptr) return {};
  const double size_m = longer_side(detection, *rectifier) * config_.unit_m;
  if (!(size_m > 0)) return {};
  const double least_m = limit_for(detection, &Rule::min_size_m, config_.min_size_m);
  if (size_m < least_m && !is_cut(detection.box)) return {Rejection::kUnderSize, size_m};
  const double most_m = limit_for(detection, &Rule::max_size_m, config_.max_size_m);
  if (most_m > 0 && size_m > most_m) return {Rejection::kOverSize, size_m};
  return {};
}

bool ZoneRules::may_begin(const Detection& detection) const noexcept {
  return std::none_of(config_.zones.begin(), config_.zones.end(), [&](const Rule& rule) {
    return rule.targets == Targets::kNoneBegin && contains(rule.zone, detection, config_.unit_m);
  });
}

std::uint64_t ZoneRules::fingerprint() const noexcept {
  std::array<std::uint64_t, kMaxZones + 2> sums{};
  for (std::size_t i = 0; i < config_.zones.size(); ++i) sums[i] = fingerprint_of(config_.zones[i]);
  if (config_.volume) sums[kMaxZones] = fingerprint_of({.zone = *config_.volume});
  const std::array<double, 4> numbers{config_.min_size_m, config_.max_size_m, config_.unit_m,
                                      static_cast<double>(config_.zones.size())};
  sums[kMaxZones + 1] = checksum(std::as_bytes(std::span(numbers)));
  return checksum(std::as_bytes(std::span(sums))) | 1;
}

}  // namespace stereotrack
