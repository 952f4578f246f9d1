#include "pipeline/shape/sobel.hpp"

#include <algorithm>
#include <cmath>

namespace stereotrack {

Result<Sobel> Sobel::create(const Config&, int width, int height, Arena& arena) noexcept {
  if (width <= 0 || height <= 0) return fail(Fault::kBadConfig);
  Sobel stage;
  stage.width_ = width;
  stage.height_ = height;
  stage.smooth_ = arena.array<std::int16_t>(static_cast<std::size_t>(width) + 2);
  stage.slope_ = arena.array<std::int16_t>(static_cast<std::size_t>(width) + 2);
  if (stage.smooth_.empty() || stage.slope_.empty()) return fail(Fault::kOutOfMemory);
  return stage;
}

Result<void> Sobel::run(ImageView<const std::uint8_t> in, ImageView<std::uint8_t> magnitude) noexcept {
  if (in.width != width_ || in.height != height_ || !in.same_size(magnitude)) return fail(Fault::kBadSize);
  const int width = width_;  // bytes may alias members, locals not: without this nothing is vectorised
  std::int16_t* const smooth = smooth_.data() + 1;
  std::int16_t* const slope = slope_.data() + 1;
  for (int y = 0; y < height_; ++y) {
    const std::uint8_t* above = in.row(std::max(y - 1, 0));
    const std::uint8_t* here = in.row(y);
    const std::uint8_t* below = in.row(std::min(y + 1, height_ - 1));
    for (int x = 0; x < width; ++x) {
      smooth[x] = static_cast<std::int16_t>(above[x] + 2 * here[x] + below[x]);
      slope[x] = static_cast<std::int16_t>(below[x] - above[x]);
    }
    smooth[-1] = smooth[0];
    slope[-1] = slope[0];
    smooth[width] = smooth[width - 1];
    slope[width] = slope[width - 1];
    std::uint8_t* out = magnitude.row(y);
    for (int x = 0; x < width; ++x) {
      const int gx = smooth[x + 1] - smooth[x - 1];
      const int gy = slope[x - 1] + 2 * slope[x] + slope[x + 1];
      // Exact: the sum fits a float's 24 bits, sqrt is correctly rounded, and below 256 the root of
      // k^2 - 1 lies 0.002 under k, more than a hundred times a float's step there.
      const float root = std::sqrt(static_cast<float>(gx * gx + gy * gy));
      out[x] = static_cast<std::uint8_t>(static_cast<int>(std::min(root, 255.0F)));
    }
  }
  return {};
}

}  // namespace stereotrack
