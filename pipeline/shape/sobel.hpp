#pragma once

#include <cstdint>

#include "pipeline/core/arena.hpp"
#include "pipeline/core/image_view.hpp"
#include "pipeline/core/result.hpp"
#include "pipeline/core/stage.hpp"

namespace stereotrack {

/// Edge strength of the absolute difference image.
///     Gx = [+1 0 -1; +2 0 -2; +1 0 -1] * A                                   (3.9)
///     Gy = [+1 +2 +1; 0 0 0; -1 -2 -1] * A
///     G  = sqrt(Gx^2 + Gy^2)                                                 (3.10)
/// The square root is rounded down exactly and then saturated: G in 0..255, because the threshold (3.12)
/// is an intensity. For an integer t <= 255, G >= t says the same as Gx^2 + Gy^2 >= t^2.
/// The direction (3.11), atan(Gy / Gx), is used by no later stage and is not computed.
/// The border is replicated: the row above the first is the first (OpenCV's BORDER_REPLICATE).
///
/// In: width x height, u8. Out: the same size, u8, not the input's memory.
/// Fault: kBadSize, output untouched. O(pixels). One instance a thread.
class Sobel {
 public:
  struct Config {};  ///< the kernels have no parameter

  [[nodiscard]] static Result<Sobel> create(const Config& config, int width, int height, Arena& arena) noexcept;
  [[nodiscard]] Result<void> run(ImageView<const std::uint8_t> in, ImageView<std::uint8_t> magnitude) noexcept;

 private:
  int width_ = 0;
  int height_ = 0;
};
static_assert(RealTimeStage<Sobel, &Sobel::run>);

}  // namespace stereotrack
