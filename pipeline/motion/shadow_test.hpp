#pragma once

#include <cstdint>
#include <span>

#include "pipeline/core/arena.hpp"
#include "pipeline/core/image_view.hpp"
#include "pipeline/core/rect.hpp"
#include "pipeline/core/result.hpp"
#include "pipeline/core/stage.hpp"
#include "pipeline/motion/shadow_kernel.hpp"
#include "pipeline/shape/blob_extractor.hpp"

namespace stereotrack {

/// Shadow, light and ghosts of the robust preset: foreground pixels that are the background after all.
///
/// Stereo evidence first, where the present disparity d and the background's own d_b are both known:
///     d - d_b > disparity_px       nearer than the background: object, whatever it looks like
///     d_b - d > disparity_px       behind it, where nothing can be: in a region with more of it than of nearer pixels,
///                                  the background holds something that has left, a ghost; in another, one of the two
///                                  is wrong and stereo says nothing
///     else                         the background's own surface: shadow if it looks so, the tolerances below
///                                  taken three times as wide
/// Photometric evidence, where stereo says nothing or "own surface". With r the ratio of the lights over 5x5,
/// r = sum Y / sum Y_background:
///     darkest_percent / 100 <= r < 0.97                      darker, not black
///     |C - 128 - r (C_background - 128)| <= chroma tolerance, C in {Cb, Cr}
///     mean over 5x5 of |Y - r Y_background| <= texture tolerance
/// the last says that the background's own texture is still there, only scaled. A reflection on a glossy floor
/// may also be brighter and of another colour; it is told by its weakness instead: with the texture kept,
///     distance < weak_percent of the 75th percentile of its region
/// counts as background too.
///
/// The decision is a majority vote over the 5x5 foreground pixels around, so that no object is riddled.
/// In: planes of one size; empty cb, cr for grey; empty disparities for mono. O(foreground x 25), 5 to 10 ns a
/// foreground pixel. One instance a thread.
class ShadowTest {
 public:
  struct Config {
    int darkest_percent = 40;   ///< smallest ratio of a shadow [%], 1..99
    int chroma_tolerance = 8;   ///< [grey levels], 0..255
    int texture_tolerance = 5;  ///< [grey levels], 0..255
    int weak_percent = 32;      ///< 0..90; 0 = off
    double disparity_px = 1.0;  ///< disparities this near are the same [px], 0..16
  };

  /// What the foreground of a region is made of [px].
  struct Evidence {
    int near = 0;     ///< nearer than the background
    int own = 0;      ///< at the background's own disparity
    int behind = 0;   ///< behind it
    int unknown = 0;  ///< no disparity, then or now
  };

  struct Input {
    ImageView<const std::uint8_t> y;
    ImageView<const std::uint8_t> cb;
    ImageView<const std::uint8_t> cr;
    ImageView<const std::uint8_t> y_background;
    ImageView<const std::uint8_t> cb_background;
    ImageView<const std::uint8_t> cr_background;
    ImageView<const std::uint8_t> distance;               ///< to the background, any unit
    ImageView<const std::uint16_t> labels;                ///< region of each pixel, 0 = none
    ImageView<const std::uint16_t> disparity;             ///< 1/16 px, kNoDisparity where unknown
    ImageView<const std::uint16_t> disparity_background;  ///< the same of the background
  };

  /// max_label: the largest label that pixels of a mask can have, 1..65535. Faults: kBadConfig, kBadSize, kOutOfMemory.
  [[nodiscard]] static Result<ShadowTest> create(const Config& config, int width, int height, int max_label,
                                                 Arena& arena) noexcept;

  /// Clears the pixels of `mask` (255 = foreground) that are shadow or light; returns how many. `regions`: all labels
  /// that pixels of the mask have.
  std::uint32_t run(const Input& in, std::span<const Blob> regions, ImageView<std::uint8_t> mask) noexcept;

  /// How many pixels of the region `label`, which lies inside `box`, look like the background under another light,
  /// darker or brighter, with the wide tolerances: to be asked where stereo has said that the surface is the
  /// background's own. Any label.
  [[nodiscard]] int count_resembling(const Input& in, const Rect& box, std::uint16_t label) noexcept;

  /// What stereo says of the pixels of the region `label` inside `box`. Any label.
  [[nodiscard]] Evidence evidence(const Input& in, const Rect& box, std::uint16_t label) const noexcept;

 private:
  struct Region {
    std::uint8_t typical = 0;  // 75th percentile of the distance
    bool ghost = false;
  };
  enum Verdict : std::int8_t {
    kObject = -1,
    kOutside = 0,
    kBackground = 1,
    kLook = 2,      // not yet known: as it looks, by the tolerances as they are
    kLookWide = 3,  // the same with the wide ones
  };
  enum class Depth : std::uint8_t { kUnknown, kNear, kOwn, kBehind };
  [[nodiscard]] Depth depth_of(const Input& in, int x, int y) const noexcept;
  void look(const Input& in, int y, int from, int to) noexcept;
  [[nodiscard]] bool looks_like_background(const Input& in, int x, int y, bool wide, int typical) const noexcept;
  void judge_row(const Input& in, int y, const std::uint8_t* mask) noexcept;

  Config config_;
  LookTolerances tolerances_;
  std::span<Region> regions_;        // by label
  ImageView<std::int8_t> verdicts_;  // within zeros
  std::span<std::uint8_t> looks_;    // ShadowLook bits of one row, where it was looked at
};
static_assert(RealTimeStage<ShadowTest, &ShadowTest::run, &ShadowTest::count_resembling, &ShadowTest::evidence>);

}  // namespace stereotrack
