#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "pipeline/core/rect.hpp"

namespace stereotrack {

/// Why a candidate is no object.
enum class Rejection : std::uint8_t {
  kSmall,         ///< fewer than min_area_px pixels
  kNoTexture,     ///< stereo source, but nothing in it could be matched
  kInconsistent,  ///< its disparities scatter too much to be one object
  kShadow,        ///< the shadow test left nothing of it
  kOwnSurface,    ///< its disparity is the background's own: light, a shadow or a mark
  kNoRoom,        ///< more runs of the mask, blobs or candidates than there is room for
  kOutside,       ///< outside of the working volume: ZoneRules
  kIgnored,       ///< in a box in space whose targets are ignored
  kUnderSize,     ///< smaller in metres than is tracked there
  kOverSize,      ///< larger in metres
  kNoneBegin,     ///< a detection, no known target's, where or when none begins: ZoneRules, PairCheck
};
inline constexpr std::size_t kRejections = 11;
[[nodiscard]] constexpr const char* to_string(Rejection why) noexcept {
  constexpr std::array<const char*, kRejections> kNames{
      "small",          "no_texture",   "inconsistent_depth", "shadow",    "own_surface", "no_room",
      "outside_volume", "ignored_zone", "under_size",         "over_size", "none_begin"};
  return kNames[static_cast<std::size_t>(why)];
}
using RejectionCounts = std::array<std::uint32_t, kRejections>;

/// What speaks against a pair of target and detection; the sum is its cost in the assignment.
struct PairCost {
  enum class Gate : std::uint8_t { kOpen, kPicture, kDepth };
  double picture = 0;       ///< squared Mahalanobis distance of the centres in the picture
  double depth = 0;         ///< squared distance in disparity, in standard deviations; 0 where one is unknown
  double size = 0;          ///< of areas that differ
  double corners = 0;       ///< of corner features that lie outside of the detection
  double looks = 0;         ///< of colours that the target does not explain
  Gate gate = Gate::kOpen;  ///< that forbids the pair; what comes after it was not asked

  [[nodiscard]] double sum() const noexcept {
    if (gate != Gate::kOpen) return std::numeric_limits<double>::infinity();
    return picture + depth + size + corners + looks;
  }
};

/// How a target came by its detection.
enum class Taken : std::uint8_t {
  kAssociated,  ///< by the least sum of costs
  kRecovered,   ///< near where it was last seen: Tracker, "Recovery"
  kOverlapped,  ///< it covers the place of a large target: Tracker, "Large"
  kInherited,   ///< it was that of a part of its region: Tracker, "Parts"
};
[[nodiscard]] constexpr const char* to_string(Taken how) noexcept {
  constexpr std::array<const char*, 4> kNames{"associated", "recovered", "covers its place", "inherited"};
  return kNames[static_cast<std::size_t>(how)];
}

/// Why a target is no more.
enum class Removal : std::uint8_t {
  kUnconfirmed,  ///< tentative, and not seen for track.tentative_misses frames
  kUnseen,       ///< coasted to its limit
  kLeft,         ///< most of where it is expected lies outside of the picture
  kTwin,         ///< it goes along with a larger one, as a part of it does
  kInherited,    ///< it was a part of another, which took its place
};
[[nodiscard]] constexpr const char* to_string(Removal why) noexcept {
  constexpr std::array<const char*, 5> kNames{"not confirmed in time", "not seen for too long", "left the picture",
                                              "a piece of another target", "taken over by another target"};
  return kNames[static_cast<std::size_t>(why)];
}

/// One decision of the tracker about one target in one frame.
struct Decision {
  enum class Kind : std::uint8_t {
    kWeighed,    ///< target and detection were compared: cost, offset
    kTook,       ///< the target took the detection: taken; cost and offset where it was weighed
    kMissed,     ///< no detection was the target's: unseen_s of limit_s
    kBorn,       ///< a tentative target from a detection; other: the target of whose region it is a part
    kNoRoom,     ///< a detection that would have been one, but there are Tracker::kMaxTracks
    kNoneBegin,  ///< a detection that would have been one, but it may not begin one: detection
    kConfirmed,  ///< believed from now on
    kWaits,      ///< took a detection, but is not believed yet: hits, evidence, way_px, path_px, other (on trial)
    kRemoved,    ///< removal; other: the target that it belongs to
  };
  Kind kind = Kind::kWeighed;
  std::uint32_t id = 0;         ///< of the target
  std::uint32_t other = 0;      ///< of another target, 0 = none
  std::uint16_t detection = 0;  ///< its place in FrameResult::detections, from 1; 0 = none
  Taken taken = Taken::kAssociated;
  Removal removal = Removal::kUnconfirmed;
  PairCost cost;
  double offset_x = 0;  ///< of the detection's centre from the expected one [px]
  double offset_y = 0;
  double sd_x = 0;  ///< of that offset, as expected [px]
  double sd_y = 0;
  double offset_disparity = 0;  ///< [px]; 0 where one is unknown
  double limit = 0;             ///< of the cost
  double unseen_s = 0;          ///< [s]
  double limit_s = 0;           ///< and how long that may be [s]
  int hits = 0;
  double evidence = 0;
  double way_px = 0;
  double path_px = 0;
};

/// A candidate that became no detection. Boxes in the raw left picture [px].
struct RejectedCandidate {
  Rejection why = Rejection::kSmall;
  Rect box;
  int area = 0;  ///< [px]
  bool has_depth = false;
  double disparity = 0;  ///< [px]
  double size_m = 0;     ///< its longer side, of what is rejected for it [m]
};

/// A pair of which both pictures do not show one instant: PairCheck.
struct WrongPair {
  double lag_s = 0;   ///< the right picture was taken so much later than the left one [s]
  int witnesses = 0;  ///< targets that told
};

/// Told why, while it happens; the thread of the pipeline. Without one nothing is worked out for it. The functions must
/// return at once; what they are given is theirs only until then.
struct DecisionObserver {
  void (*decided)(void* context, const Decision& decision) noexcept = nullptr;
  void (*rejected)(void* context, const RejectedCandidate& candidate) noexcept = nullptr;
  void (*mispaired)(void* context, const WrongPair& pair) noexcept = nullptr;
  void* context = nullptr;

  void tell(const Decision& decision) const noexcept {
    if (decided != nullptr) decided(context, decision);
  }
  void tell(const RejectedCandidate& candidate) const noexcept {
    if (rejected != nullptr) rejected(context, candidate);
  }
  void tell(const WrongPair& pair) const noexcept {
    if (mispaired != nullptr) mispaired(context, pair);
  }
};

}  // namespace stereotrack
