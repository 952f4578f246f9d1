#pragma once

#include <cstdint>
#include <span>

#include "pipeline/core/arena.hpp"
#include "pipeline/core/image_view.hpp"
#include "pipeline/core/rect.hpp"
#include "pipeline/core/stage.hpp"
#include "pipeline/geometry/remap_kernel.hpp"

namespace stereotrack {

/// One view's rectified picture, of which only what somebody needs is drawn: most of a canvas is asked for by nobody
/// where only moving regions are matched. Of each row one stretch is drawn, which grows to hold all that was asked for.
/// What is drawn equals Rectifier::rectify(); what is not is an older picture's, or 0.
/// A default one is empty, and stays so. O(pixels drawn). One instance a thread.
class LazyCanvas {
 public:
  LazyCanvas() noexcept = default;

  /// `table`: the view's, Rectifier::table(); its pictures outlive the canvas. Memory from the arena, which says
  /// failed() where there was none.
  [[nodiscard]] static LazyCanvas create(const RemapTable& table, Sampling sampling, Arena& arena) noexcept;

  /// A new raw picture of the table's raw size, which stays as it is until the next one: nothing of it is drawn yet.
  void show(ImageView<const std::uint8_t> raw) noexcept;

  /// The whole canvas, with at least `part` of it drawn (as far as it lies inside).
  [[nodiscard]] ImageView<const std::uint8_t> with(const Rect& part) noexcept;

  [[nodiscard]] ImageView<const std::uint8_t> whole() noexcept { return with({0, 0, canvas_.width, canvas_.height}); }

 private:
  /// Columns [begin, end) that are drawn; multiples of RemapTable::kBlock, or the canvas' end.
  struct Stretch {
    std::int32_t begin = 0;
    std::int32_t end = 0;
  };

  void draw(int row, int begin, int end) noexcept;

  RemapTable table_;
  Sampling sampling_ = Sampling::kBilinear;
  ImageView<const std::uint8_t> raw_;
  ImageView<std::uint8_t> canvas_;
  std::span<Stretch> drawn_;
};
static_assert(RealTimeStage<LazyCanvas, &LazyCanvas::show, &LazyCanvas::with, &LazyCanvas::whole>);

}  // namespace stereotrack
