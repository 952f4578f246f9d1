#include "pipeline/shape/threshold.hpp"

namespace stereotrack {

Result<void> threshold(ImageView<const std::uint8_t> in, int threshold, ImageView<std::uint8_t> out) noexcept {
  if (!in.same_size(out)) return fail(Fault::kBadSize);
  for (int y = 0; y < in.height; ++y) {
    const std::uint8_t* from = in.row(y);
    std::uint8_t* to = out.row(y);
    for (int x = 0; x < in.width; ++x) to[x] = from[x] >= threshold ? 255 : 0;
  }
  return {};
}

}  // namespace stereotrack
