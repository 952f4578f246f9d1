#pragma once

#include <cstdint>
#include <span>

#include "pipeline/core/arena.hpp"
#include "pipeline/core/bounded_vector.hpp"
#include "pipeline/core/image_view.hpp"
#include "pipeline/core/result.hpp"
#include "pipeline/core/stage.hpp"
#include "pipeline/shape/blob_extractor.hpp"

namespace stereotrack {

/// Splits a blob into segments of continuous depth: what touches in the picture but not in space.
///
/// 1. Pixels without disparity take that of the known pixel nearest by a path inside the blob, on which each step
///    costs 1 + |change of luma| / 4: flat surfaces are filled from their textured rims, and not across an edge.
/// 2. 4-neighbours hang together if their disparities differ by at most max(jump_px, jump d).
/// 3. A component with fewer than min_part of the blob's pixels (or than min_px), or of which less than min_known was
///    measured rather than filled (0.6 for those under 5 % of the blob), is no evidence: its pixels go to the nearest
///    other one, by the same path.
/// A blob without any disparity is one segment without depth.
///
/// disparity in 1/16 px, kNoDisparity where unknown, same picture as labels. Two sweeps over the blob's box in each
/// direction (exact for convex blobs, near enough for others), of which
/// each unknown pixel is visited. One instance a thread. O(box).
class DepthSegments {
 public:
  static constexpr int kMost = 32;

  struct Config {
    double jump = 0.05;      ///< of the disparity, 0.005..1
    double jump_px = 1.0;    ///< 0.1..50 [px]
    int min_px = 24;         ///< 1..1e6
    double min_part = 0.01;  ///< 0..0.5
    double min_known = 0.2;  ///< part of a component's pixels whose own disparity must be known, 0..1
  };

  struct Input {
    ImageView<const std::uint16_t> labels;
    ImageView<const std::uint16_t> disparity;
    ImageView<const std::uint8_t> y;
  };

  /// Faults: kBadConfig, kBadSize, kOutOfMemory.
  [[nodiscard]] static Result<DepthSegments> create(const Config& config, int width, int height, Arena& arena) noexcept;

  /// Number of segments, 1..kMost; what would be more is noise, too. segment() then holds 0..n-1 at the blob's pixels,
  /// and anything elsewhere.
  [[nodiscard]] int run(const Input& in, const Blob& blob) noexcept;

  [[nodiscard]] ImageView<const std::uint16_t> segment() const noexcept { return segment_; }
  /// Disparity of the blob's pixels, filled; kNoDisparity if the blob has none at all.
  [[nodiscard]] ImageView<const std::uint16_t> filled() const noexcept { return filled_; }

 private:
  struct Place {
    std::uint16_t x, y;
  };

  /// Neighbours in a row that hang together. `parent` links the pieces of a component; the root is its first one.
  struct Piece {
    std::uint16_t begin, end;  // columns
    std::int32_t parent;
    std::int32_t area;   // of the root: of the component
    std::int32_t known;  // likewise; at last its segment
  };
  /// Pieces [first, end) lie in row y.
  struct Row {
    int y;
    std::int32_t first, end;
  };

  template <class Known>
  [[nodiscard]] std::size_t start_spread(const Input& in, const Blob& blob, Known&& known) noexcept;
  void spread(ImageView<const std::uint8_t> luma, std::size_t count, ImageView<std::uint16_t> value) noexcept;
  [[nodiscard]] bool hang_together(int a, int b) const noexcept;
  void find_pieces(const Input& in, const Blob& blob) noexcept;
  void join_rows(const Row& above, const Row& here) noexcept;
  [[nodiscard]] std::int32_t root_of(std::int32_t piece) noexcept;
  [[nodiscard]] int number_pieces(const Input& in, const Blob& blob, int least) noexcept;

  Config config_;
  ImageView<std::uint16_t> filled_;
  ImageView<std::uint16_t> segment_;  // one pixel of frame around it, so that neighbours need no test
  ImageView<std::uint16_t> cost_;     // likewise
  std::span<Place> places_;
  std::span<Piece> pieces_;
  std::int32_t piece_count_ = 0;
  double jump_ = 0;      // [1/16 px]
  int surely_near_ = 0;  // no more than that, whole
};
static_assert(RealTimeStage<DepthSegments, &DepthSegments::run>);

}  // namespace stereotrack
