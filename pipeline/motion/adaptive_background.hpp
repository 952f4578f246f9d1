#pragma once

#include <algorithm>
#include <cstdint>
#include <span>

#include "pipeline/core/arena.hpp"
#include "pipeline/core/image_view.hpp"
#include "pipeline/core/result.hpp"
#include "pipeline/core/stage.hpp"

namespace stereotrack {

/// Background of the robust preset: what each pixel usually looks like, how much that varies, and how far
/// the present picture is from it. In place of (3.7) and (3.8).
///
/// Per pixel: mean m of luma (and of Cb, Cr), mean absolute deviation a of each, number of frames n in which
/// the pixel looked so, and one candidate: another look, seen lately, with its own count. On a pixel that
/// is not foreground
///     m <- m + s / r,   a <- a + (|s| - a) / (r + 8),   r = min(n + 1, window)
///     s = x - m, but no longer than pull a + 1 grey level
/// so the first frames give the mean (3.7) and later ones an exponential window. The bound is for what passes under
/// the threshold of the foreground: unbounded, parts of passing objects are learnt as noise, and that hides larger
/// parts of the next ones. A second look, far away, in a part q of a pixel's frames (leaves before the sky) pulls the
/// mean away by q pull a / (1 - q) and keeps the deviation up where 2 q pull >= 1: with a pull of 3 it is noise from
/// a sixth of the frames on, and foreground where it is rarer. On a foreground pixel
/// the candidate learns instead. When the candidate has been seen more often than the background, and at least
/// 9 times (counts saturate at absorb_frames), they change places: what was there at start and left, dissolves
/// quickly; what stops in view, is absorbed after absorb_frames.
///
/// Distance of a picture from the background, in standard deviations, 4 steps each:
///     z = 4 max(0, |x - g m| - e R) / (1.25 a + floor)
/// g: gain of the light (median ratio of picture and background over the pixels not lately foreground), so
/// that exposure drift is no motion; R: range of m in the 3x3 neighbourhood, so that an edge which moves by
/// a fraction e of a pixel is no motion either. A clipped pixel
/// (g m or m from 250 on) stands for all that is at least as bright as min(g m, 250). Channels combine as max + half
/// the smaller.
///
/// The pictures given should be smoothed a little (3x3): then a is the noise that remains.
/// Integers only (8.8 fixed point). One instance a view; one thread; O(pixels).
class AdaptiveBackground {
 public:
  static constexpr int kStepsPerSd = 4;  ///< of distance()

  struct Config {
    int window = 60;           ///< frames of the exponential window, 2..1024
    int pull = 3;              ///< mean absolute deviations that a sample pulls at most, 0..8; 0 = without bound
    int absorb_frames = 300;   ///< frames after which what stands still is background, 2..60000
    int noise_floor = 256;     ///< added to the standard deviation [1/256 grey level], 1..4096
    int edge_percent = 75;     ///< e: tolerated shift of an edge [% of the 3x3 range], 0..200
    int relearn_percent = 60;  ///< part of the picture that must change at once to start anew, 1..100
  };

  /// colour: whether Cb and Cr are given. Faults: kBadConfig, kBadSize, kOutOfMemory.
  [[nodiscard]] static Result<AdaptiveBackground> create(const Config& config, int width, int height, bool colour,
                                                         Arena& arena) noexcept;

  /// Planes of one picture; cb and cr empty for a grey one.
  struct Planes {
    ImageView<const std::uint8_t> y;
    ImageView<const std::uint8_t> cb;
    ImageView<const std::uint8_t> cr;
  };

  /// Distance of the picture from the background, kStepsPerSd a standard deviation, saturated at 255. All 0 before
  /// the first learn(). Also estimates the light's gain.
  void distance(const Planes& picture, ImageView<std::uint8_t> out) noexcept;

  /// Marks in the mask of learn().
  static constexpr std::uint8_t kForeground = 255;  ///< not to be learnt as background
  static constexpr std::uint8_t kForget = 1;        ///< the background here is wrong: start anew with this look
  static constexpr std::uint8_t kGhost = 2;         ///< foreground; learnt once it looks so for kGhostFrames
  static constexpr int kGhostFrames = 4;

  /// Learns from the picture that distance() saw. mask: 0 where it is background, else one of the marks above.
  void learn(const Planes& picture, ImageView<const std::uint8_t> mask) noexcept;

  /// What is seen here now is known to stand before the background: before the next learn(), the background counts as
  /// seen for longer than that, so that absorb_frames alone make it give way.
  void confirm(int x, int y) noexcept {
    const int longer = std::min(candidate_age_.at(x, y) + 1, config_.absorb_frames);
    age_.at(x, y) = static_cast<std::uint16_t>(std::max<int>(age_.at(x, y), longer));
  }

  /// Forgets everything but the latest look: the next learn() starts a new mean.
  void restart() noexcept;

  /// The background's luma under the present light [grey levels]; valid after distance().
  [[nodiscard]] ImageView<const std::uint8_t> luma() const noexcept { return y_.shown; }
  [[nodiscard]] ImageView<const std::uint8_t> blue() const noexcept { return cb_.shown; }
  [[nodiscard]] ImageView<const std::uint8_t> red() const noexcept { return cr_.shown; }
  /// Gain of the light against the background, 256 = unchanged.
  [[nodiscard]] int gain() const noexcept { return gain_; }
  /// Whether learn() has been called.
  [[nodiscard]] bool started() const noexcept { return started_; }

  /// What crosses frames: pipeline/core/state.hpp.
  template <class Self, class Archive>
  static void visit_state(Self& self, Archive& archive) noexcept {
    archive(self.started_);
    for (auto* channel : {&self.y_, &self.cb_, &self.cr_}) {
      archive(channel->mean, channel->deviation, channel->candidate);
    }
    archive(self.age_, self.candidate_age_, self.foreground_);
  }

 private:
  struct Channel {
    ImageView<std::uint16_t> mean;       // 8.8
    ImageView<std::uint16_t> deviation;  // 8.8
    ImageView<std::uint16_t> candidate;  // 8.8
    ImageView<std::uint8_t> shown;       // mean under the present light, rounded
  };

  int estimate_gain(ImageView<const std::uint8_t> y) const noexcept;

  Config config_;
  bool colour_ = false;
  bool started_ = false;
  int gain_ = 256;
  Channel y_;
  Channel cb_;
  Channel cr_;
  ImageView<std::uint16_t> age_;
  ImageView<std::uint16_t> candidate_age_;
  ImageView<std::uint8_t> foreground_;  // mask of the last learn(), of every kGainStep-th row
  std::span<std::uint8_t> range_;       // of one row
  std::span<std::uint16_t> bins_;       // of all pixels that the gain is estimated from
};
static_assert(RealTimeStage<AdaptiveBackground, &AdaptiveBackground::distance, &AdaptiveBackground::learn,
                            &AdaptiveBackground::confirm, &AdaptiveBackground::restart>);

}  // namespace stereotrack
