#pragma once

#include <cstdint>

#include "pipeline/core/arena.hpp"
#include "pipeline/core/image_view.hpp"
#include "pipeline/core/stage.hpp"
#include "pipeline/stereo/block_matcher.hpp"

namespace stereotrack {

/// The disparity of what does not move, by which shadows, light and ghosts are told from objects.
/// The background hardly changes and matching all of it costs much, so each frame renews a strip of rows: the whole
/// canvas once in the `frames` over which the background is learnt, then again and again, ten times slower.
/// Short stretches without disparity, along a row and then along a column, between ends that agree (within 2 px or a
/// tenth) take the straight line between them: a background is mostly made of planes, and a line along the rows has no
/// disparity of its own.
/// In: the background's luma, rectified. Out: map(), left canvas, 1/16 px, kNoDisparity where nothing is known (yet).
/// Cost: that of the matcher for height / frames rows. One instance a thread.
class BackgroundDisparity {
 public:
  struct Config {
    int frames = 30;  ///< of the first pass, 1..10000
  };

  /// `shown`: left canvas, where it shows something of the raw picture; must outlive this.
  /// Faults: kBadConfig, kBadSize (no canvas), kOutOfMemory.
  [[nodiscard]] static Result<BackgroundDisparity> create(const Config& config, ImageView<const std::uint8_t> shown,
                                                          Arena& arena) noexcept;

  /// Renews the next strip. Range: what `matcher` was made for.
  void renew(CanvasPair& background, BlockMatcher& matcher, DisparityRange range) noexcept;

  /// Nothing is known any more.
  void restart() noexcept;

  /// Nothing is known of this place of the left canvas until its strip is renewed: what was there has left. Places
  /// outside are ignored.
  void forget(int x, int y) noexcept {
    if (map_.contains(x, y)) map_.at(x, y) = kNoDisparity;
  }

  [[nodiscard]] ImageView<const std::uint16_t> map() const noexcept { return map_; }

  /// What crosses frames: pipeline/core/state.hpp.
  template <class Self, class Archive>
  static void visit_state(Self& self, Archive& archive) noexcept {
    archive(self.map_, self.complete_);
    archive.bounded(self.next_row_, 0, self.map_.height - 1);
  }

 private:
  Config config_;
  ImageView<const std::uint8_t> shown_;
  ImageView<std::uint16_t> map_;
  int next_row_ = 0;       // of the next strip
  bool complete_ = false;  // the first pass is done
};
static_assert(RealTimeStage<BackgroundDisparity, &BackgroundDisparity::renew, &BackgroundDisparity::restart>);

}  // namespace stereotrack
