#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "drivers/capture/synthetic/scene.hpp"
#include "drivers/capture/synthetic/sensor.hpp"
#include "drivers/capture/synthetic/still_picture.hpp"

namespace stereotrack::capture::synthetic {

/// How bright sun and sky are at a moment; 1 = as the scene says.
struct LightLevel {
  double sun = 1;
  double sky = 1;
  double lamp = 0;
};

/// A scene ray-cast into one camera.
///
/// What stands still is cast once (see StillPicture). A frame costs rays where objects and their shadows can be:
/// four a pixel for objects (shape, texture, sun, shadows of everything else), four towards the sun for
/// shadows on what stands still.
///
/// Memory: about 100 bytes a pixel. One thread an instance.
class View {
 public:
  View(const Scene& scene, const PinholeCamera& camera);

  /// From here on the picture is that of this camera; only where the scene sways.
  void turn(const PinholeCamera& camera);
  /// Casts the actors into this view, and the leaves of a scene that has foliage.
  void cast_actors(std::span<const PosedActor> actors, const PosedFoliage& foliage = {});
  /// What `expose` needs beside the light.
  struct Exposure {
    double gain = 1;
    Ripple ripple;
    std::uint64_t frame = 0;
  };
  /// The picture of the last cast_actors(): width x height, blue green red, rows without gaps.
  void expose(const LightLevel& level, const Exposure& exposure, const Sensor& sensor, std::uint8_t* bgr);

  /// The same of several cast_actors(), each a part of the time for which the shutter is open: gather() after each,
  /// then develop(). `first` throws away what was gathered before.
  void gather(const LightLevel& level, bool first);
  void develop(const Exposure& exposure, const Sensor& sensor, std::uint8_t* bgr);

  [[nodiscard]] const PinholeCamera& camera() const noexcept { return camera_; }

  /// Which actor (index into the span, -1 none) most of a pixel shows, and its mean inverse depth there.
  struct Owner {
    int actor = -1;
    double inverse_depth = 0;  ///< of the actor or of what stands still [1/m]; 0 for the sky
  };
  [[nodiscard]] Owner owner(int x, int y) const noexcept;
  /// What would be there if nobody were.
  [[nodiscard]] double still_inverse_depth(int x, int y) const noexcept;
  /// What moves in a row lies within [first, last).
  [[nodiscard]] std::array<int, 2> row_span(int y) const noexcept { return row_span_[static_cast<std::size_t>(y)]; }
  /// How much of its light a pixel of what stands still loses to shadows of actors, 0..1.
  /// Nothing where leaves are.
  [[nodiscard]] double darkening(int x, int y) const noexcept;

 private:
  struct Part {
    Shape shape;
    int actor = 0;
    std::vector<std::uint16_t> shaders;         ///< parts that may stand between it and the sun
    std::vector<std::uint16_t> static_shaders;  ///< the same of what stands still
    std::array<Blocker, kSamples> blockers;     ///< towards to_sun_
  };

  /// A point of what stands still: metres across, up and towards the sun. Rounded: to leave out, not to decide.
  struct SeenFromSun {
    float u = 0;
    float v = 0;
    float w = 0;
  };
  static constexpr float kRounding = 1e-3F;  ///< [m], far more than the above loses

  /// What hides the sun: actors where no leaf does it already.
  enum class Shaders { kAll, kActors, kLeaves };

  static constexpr std::uint16_t kFirstLeaf = 0x4000;
  static_assert(kFirstLeaf + Foliage::kMostLeaves < 0x10000);

  void look_from_sun();
  [[nodiscard]] SeenFromSun from_sun(Vec3 point) const noexcept;
  void light_row(int y, const LightLevel& level) noexcept;  ///< fills row_
  [[nodiscard]] unsigned shadows_of_column(int x, int y) const noexcept;
  void cast_leaves(const PosedFoliage& foliage);
  void cast_shadow(const Part& part);
  void shade_still(const Shape& shape, const Rect& box, std::vector<std::uint8_t>& bits);
  void cast_contact(const Shape& sphere);
  void find_shaders(std::size_t first, std::size_t count);
  void mark(const Rect& box) noexcept;
  [[nodiscard]] double shadow(int x, int y, Shaders shaders) const noexcept;
  [[nodiscard]] Vec3 shade(const Part& part, std::size_t sample, double u, double v, double depth,
                           const LightLevel& level) const noexcept;
  [[nodiscard]] Vec3 shade(const PosedLeaf& leaf, std::size_t sample, double u, double v, double depth,
                           const LightLevel& level) const noexcept;
  [[nodiscard]] std::size_t index(int x, int y) const noexcept {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(camera_.width) + static_cast<std::size_t>(x);
  }

  const Scene& scene_;
  PinholeCamera camera_;
  Rect frame_;
  Across across_sun_;
  std::array<Vec3, kSamples> to_sun_;                           ///< directions into the sun's disc, unit
  std::vector<std::array<Blocker, kSamples>> static_blockers_;  ///< of the scene's statics, towards to_sun_

  StillPicture still_;                      ///< as camera_ sees it now
  std::vector<SeenFromSun> seen_from_sun_;  ///< a pixel's centre of still_
  std::optional<TurnableStill> turnable_;   ///< where the scene sways

  // This frame, per pixel.
  std::vector<float> depth_;           ///< kSamples
  std::vector<std::uint16_t> who_;     ///< kSamples: 0 = still, from kFirstLeaf on a leaf, else index into parts_ + 1
  std::vector<std::uint8_t> shadow_;   ///< bit s: the sun's sample s is hidden
  std::vector<std::uint8_t> contact_;  ///< skylight taken away, of 255
  std::vector<std::uint8_t> leaf_shadow_;  ///< the same as shadow_ of leaves; empty without foliage
  std::vector<PosedLeaf> leaves_;
  std::vector<Part> parts_;
  std::size_t part_count_ = 0;
  std::vector<Rect> dirty_;                   ///< what this frame's actors may have touched
  std::vector<std::array<int, 2>> row_span_;  ///< the same, by rows: first and one past the last column
  std::vector<float> row_;
  std::vector<float> gathered_;  ///< 3 a pixel; empty until gather()
  int gathers_ = 0;
  float lamp_ = 0;  ///< how bright the lamp burns
};

}  // namespace stereotrack::capture::synthetic
