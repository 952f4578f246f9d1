#pragma once

#include <cstdint>
#include <span>

#include "pipeline/core/arena.hpp"
#include "pipeline/core/image_view.hpp"
#include "pipeline/core/result.hpp"
#include "pipeline/core/stage.hpp"
#include "pipeline/shape/run_length.hpp"

namespace stereotrack {

/// Contours of the thresholded edges, filled (thesis 3.1, figure 3.9): every closed outer contour becomes
/// a solid region. Contours are 8-connected, so what lies between them is 4-connected: background is
/// what reaches the picture's border through non-edge pixels, everything else is set. The result is that
/// of OpenCV's findContours(RETR_EXTERNAL) + drawContours(FILLED) without a contour list, whose length
/// sensor noise decides.
/// With `max_hole_px` only enclosed areas of at most that many pixels are filled.
/// The contour of an object that the picture cuts is open and stays a line, which the opening then deletes:
/// `max_border_px` fills areas up to that size although they reach the border (not in the document).
///
/// In: edges, non-zero = edge, width x height. Out: 0 or 255, the same size; may be the input's memory.
/// Fault: kBadSize, output untouched. O(pixels); memory for the worst picture, so nothing overflows.
/// One instance a thread.
class ContourFill {
 public:
  static constexpr std::int64_t kUnlimited = INT64_MAX;

  struct Config {
    std::int64_t max_hole_px = kUnlimited;  ///< largest enclosed area that is filled, >= 0 [px]
    std::int64_t max_border_px = 0;         ///< the same for areas that reach the picture's border [px]
  };

  [[nodiscard]] static Result<ContourFill> create(const Config& config, int width, int height, Arena& arena) noexcept;
  [[nodiscard]] Result<void> run(ImageView<const std::uint8_t> edges, ImageView<std::uint8_t> filled) noexcept;

 private:
  Config config_;
  int width_ = 0;
  int height_ = 0;
  std::span<Run> runs_;
  std::span<std::int64_t> area_;       // by root run
  std::span<std::uint8_t> at_border_;  // by root run
};
static_assert(RealTimeStage<ContourFill, &ContourFill::run>);

}  // namespace stereotrack
