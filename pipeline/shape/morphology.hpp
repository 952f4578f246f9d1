#pragma once

#include <cstdint>
#include <span>

#include "pipeline/core/arena.hpp"
#include "pipeline/core/image_view.hpp"
#include "pipeline/core/result.hpp"
#include "pipeline/core/stage.hpp"
#include "pipeline/shape/bit_mask.hpp"

namespace stereotrack {

/// What stands behind Opening and Closing: 3x3 erosions and dilations.
///     A (-) B = { z | (B)_z subset of A }                         erosion    (3.15)
///     A (+) B = { z | (B^)_z and A meet }                         dilation   (3.14)
/// B: 3x3 rectangle, which is its own reflection B^. The document prints 3.14's condition as
/// "[(B^)_z and I] subset of I", which holds for every z; meant is that the intersection is not empty.
/// On masks, 64 pixels a word, erosion is the AND and dilation the OR over the square. What lies outside
/// the picture neither erodes nor dilates (OpenCV's default border).
/// Separable: seven operations a word and pass. `repeats` n is a (2n+1) x (2n+1) square.
class Morphology3x3 {
 public:
  struct Config {
    int repeats = 1;  ///< passes of each kind; 0 copies
  };

 protected:
  enum class Pass : std::uint8_t { kErode, kDilate };

  [[nodiscard]] Result<void> init(const Config& config, int width, int height, Arena& arena) noexcept;
  [[nodiscard]] Result<void> run_passes(Pass first, Pass second, ImageView<const std::uint8_t> in,
                                        ImageView<std::uint8_t> out) noexcept;

 private:
  void pass(Pass kind, const BitMask& in, const BitMask& out) noexcept;

  Config config_;
  int width_ = 0;
  int height_ = 0;
  BitMask from_;
  BitMask to_;
  std::span<std::uint64_t> column_;  // one row of vertical AND or OR, a neutral word at each end
};

/// Removes what a 3x3 square does not fit into: noise, thin protrusions, isthmuses.
///     A o B = (A (-) B) (+) B                                                (3.13)
/// In: a width x height mask, set where it is not 0. Out: 0 or 255, the same size; may be the input's memory.
/// Fault: kBadSize, output untouched. O(pixels x repeats). One instance a thread.
class Opening : public Morphology3x3 {
 public:
  [[nodiscard]] static Result<Opening> create(const Config& config, int width, int height, Arena& arena) noexcept;
  [[nodiscard]] Result<void> run(ImageView<const std::uint8_t> in, ImageView<std::uint8_t> out) noexcept;
};
static_assert(RealTimeStage<Opening, &Opening::run>);

/// The dual: closes gaps that a 3x3 square does not fit into.
///     A . B = (A (+) B) (-) B
/// In, out, faults, cost as Opening.
class Closing : public Morphology3x3 {
 public:
  [[nodiscard]] static Result<Closing> create(const Config& config, int width, int height, Arena& arena) noexcept;
  [[nodiscard]] Result<void> run(ImageView<const std::uint8_t> in, ImageView<std::uint8_t> out) noexcept;
};
static_assert(RealTimeStage<Closing, &Closing::run>);

}  // namespace stereotrack
