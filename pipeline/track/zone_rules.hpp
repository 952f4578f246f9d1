#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>

#include "pipeline/core/arena.hpp"
#include "pipeline/core/bounded_vector.hpp"
#include "pipeline/core/result.hpp"
#include "pipeline/core/stage.hpp"
#include "pipeline/geometry/rectify.hpp"
#include "pipeline/shape/bit_mask.hpp"
#include "pipeline/track/decision.hpp"
#include "pipeline/track/detection.hpp"
#include "pipeline/track/zone.hpp"

namespace stereotrack {

/// What is tracked where, and of which size.
///
///     volume     a detection outside of this box in space is rejected
///     kIgnore    of a polygon: its pixels are never foreground (ignored()); of a box: a detection inside is rejected
///     kNoneBegin a detection inside may be a known target's, but no target begins with it
///     size       S = n_rect Z / f of the longer side of a detection's box, n_rect its length in the rectified picture
///                [px], so that a lens' distortion is out of it; Z of the detection's position
/// The limits of the first zone that holds the detection and has one of a kind take the place of those for everywhere.
///
/// Metres need depth: a detection without depth is in no box, and neither volume nor size speak of it. One that a
/// confirmed target claims is not judged by its size: half hidden, or together with another, it has another. One that
/// the border of the picture, or of an ignored polygon, cuts is not judged by the smallest size.
///
/// Immutable after create(): any thread. O(zones x corners) a detection.
class ZoneRules {
 public:
  static constexpr std::size_t kMaxZones = 16;

  enum class Targets : std::uint8_t { kAll, kNoneBegin, kIgnore };

  struct Rule {
    Zone zone = {};
    Targets targets = Targets::kAll;
    double min_size_m = 0;  ///< 0: that for everywhere
    double max_size_m = 0;  ///< 0: that for everywhere
  };
  struct Config {
    FixedVector<Rule, kMaxZones> zones = {};
    std::optional<Zone> volume = {};  ///< in space; none: everywhere
    double min_size_m = 0;            ///< everywhere; 0: none
    double max_size_m = 0;            ///< everywhere; 0: none
    double unit_m = 0;                ///< metres in one unit of the calibration; 0: not known

    /// Whether it says anything.
    [[nodiscard]] bool any() const noexcept {
      return !zones.empty() || volume.has_value() || min_size_m > 0 || max_size_m > 0;
    }
  };
  struct Verdict {
    std::optional<Rejection> why;  ///< none: it is accepted
    double size_m = 0;             ///< of what is rejected for its size [m]
  };

  /// Faults: kBadConfig (a volume that is no box, metres without a unit, a size < 0 or a smallest one over the
  /// largest), kNotFinite, kBadSize, kOutOfMemory. Memory for one mask, where a polygon is ignored.
  [[nodiscard]] static Result<ZoneRules> create(const Config& config, int width, int height, Arena& arena) noexcept;

  /// Pixels of the raw left picture that no object may have; width 0: there are none.
  [[nodiscard]] const BitMask& ignored() const noexcept { return ignored_; }

  /// rectifier: that of the detection's position; null for mono.
  [[nodiscard]] Verdict judge(const Detection& detection, bool claimed, const Rectifier* rectifier) const noexcept;
  [[nodiscard]] bool may_begin(const Detection& detection) const noexcept;

  /// Of all that the configuration says, never 0.
  [[nodiscard]] std::uint64_t fingerprint() const noexcept;

 private:
  [[nodiscard]] double limit_for(const Detection& detection, double Rule::*limit, double everywhere) const noexcept;
  [[nodiscard]] bool is_cut(const Rect& box) const noexcept;

  Config config_;
  int width_ = 0;
  int height_ = 0;
  BitMask ignored_;
  bool limits_size_ = false;
};
static_assert(RealTimeStage<ZoneRules, &ZoneRules::judge, &ZoneRules::may_begin>);

}  // namespace stereotrack
