#include "pipeline/shape/sobel.hpp"

#include <algorithm>

#include "pipeline/shape/sobel_kernel.hpp"

namespace stereotrack {

Result<Sobel> Sobel::create(const Config&, int width, int height, Arena& /*arena*/) noexcept {
  if (width <= 0 || height <= 0) return fail(Fault::kBadConfig);
  Sobel stage;
  stage.width_ = width;
  stage.height_ = height;
  return stage;
}

Result<void> Sobel::run(ImageView<const std::uint8_t> in, ImageView<std::uint8_t> magnitude) noexcept {
  if (in.width != width_ || in.height != height_ || !in.same_size(magnitude)) return fail(Fault::kBadSize);
  for (int y = 0; y < height_; ++y) {
    sobel_row({in.row(std::max(y - 1, 0)), in.row(y), in.row(std::min(y + 1, height_ - 1))}, width_, magnitude.row(y));
  }
  return {};
}

}  // namespace stereotrack
