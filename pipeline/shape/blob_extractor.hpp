#pragma once

#include <cstdint>
#include <span>

#include "pipeline/core/arena.hpp"
#include "pipeline/core/image_view.hpp"
#include "pipeline/core/rect.hpp"
#include "pipeline/core/result.hpp"
#include "pipeline/core/stage.hpp"
#include "pipeline/shape/run_length.hpp"

namespace stereotrack {

/// Which sides of the picture a region touches, as bits: there it may go on unseen.
enum BorderSide : std::uint8_t { kLeftSide = 1, kTopSide = 2, kRightSide = 4, kBottomSide = 8 };

/// One region of a label image.
struct Blob {
  std::uint16_t label = 0;  ///< its pixels' value in the label image, from 1
  std::uint8_t sides = 0;   ///< BorderSide bits
  std::int32_t area = 0;    ///< [px]
  Rect box;                 ///< tight [px]
  Point first;              ///< its first pixel in raster order
  double center_x = 0;      ///< mean of its pixels' x [px]
  double center_y = 0;
};

/// The blobs of one picture, and what was left out. Views live until the extractor's next run.
struct BlobSet {
  std::span<Blob> blobs;            ///< blobs[i].label == i + 1
  ImageView<std::uint16_t> labels;  ///< 0 = no blob
  int small = 0;                    ///< components under min_area_px
  int dropped_blobs = 0;            ///< components that found no room among max_blobs: the smallest
  int dropped_runs = 0;             ///< runs after max_runs: the lower part of the picture is missing
};

/// Blobs: 8-connected components of a mask (thesis 3.1, figures 3.14-3.16), by run-length union-find.
///
/// Capacities are fixed, so that noise costs bounded time and memory:
/// * more than max_runs runs: the rest of the picture, in raster order, is dropped and its runs counted;
/// * more than max_blobs components: the largest stay; of equals, those that begin first. The rest is counted.
/// Order: by first pixel in raster order, or by area, largest first, then by first pixel.
///
/// In: mask, non-zero = object, width x height. Out: BlobSet. Fault: kBadSize, the last BlobSet untouched.
/// O(pixels + max_runs). One instance a thread.
class BlobExtractor {
 public:
  enum class Order : std::uint8_t { kRaster, kArea };

  struct Config {
    int max_runs = 32768;
    int max_blobs = 256;  ///< 1..65535
    int min_area_px = 1;  ///< smaller components are left out [px]
    Order order = Order::kRaster;
  };

  [[nodiscard]] static Result<BlobExtractor> create(const Config& config, int width, int height, Arena& arena) noexcept;
  [[nodiscard]] Result<BlobSet> run(ImageView<const std::uint8_t> mask) noexcept;

 private:
  struct Component {
    std::int64_t sum_x;
    std::int64_t sum_y;
    std::int32_t area;
    std::int32_t root;  // its first run
    std::int32_t left;
    std::int32_t right;   // first column outside
    std::int32_t bottom;  // first row outside
  };

  Config config_;
  int width_ = 0;
  int height_ = 0;
  std::span<Run> runs_;
  std::span<std::int32_t> component_of_;  // by root run: its component; afterwards its label, 0 = none
  std::span<Component> components_;
  std::span<Blob> blobs_;
  ImageView<std::uint16_t> labels_;
};
static_assert(RealTimeStage<BlobExtractor, &BlobExtractor::run>);

}  // namespace stereotrack
