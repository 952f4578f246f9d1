#include "pipeline/track/features.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>

namespace stereotrack {

namespace {

constexpr int kReach = kPatchReach;
constexpr int kArea = kPatchArea;
constexpr int kTensorArea = (2 * kTensorReach + 1) * (2 * kTensorReach + 1);
// Where a patch was found to about this many pixels.
constexpr double kSearchNoise = 0.4;

using Vector = ConstantVelocityFilter<2>::Vector;

bool patch_fits(ImageView<const std::uint8_t> luma, int x, int y) noexcept {
  return x >= kReach && y >= kReach && x + kReach < luma.width && y + kReach < luma.height;
}

void cut(ImageView<const std::uint8_t> luma, int x, int y, Patch& patch) noexcept {
  for (int v = 0; v < Features::kPatch; ++v) {
    std::copy_n(luma.row(y - kReach + v) + x - kReach, Features::kPatch, patch.begin() + v * Features::kPatch);
  }
}

// From the whole pixel (x, y), where the patch fits best, to where it fits best between the pixels; at most one pixel.
Vector sub_pixel(const Patch& patch, ImageView<const std::uint8_t> luma, int x, int y) noexcept {
  if (x <= kReach || y <= kReach || x + kReach + 1 >= luma.width || y + kReach + 1 >= luma.height)
    return Vector::Zero();
  // Integers, so that nothing depends on the order: sums over the patch of gx, gy, e and their products.
  std::int64_t gx = 0, gy = 0, e = 0, xx = 0, xy = 0, yy = 0, xe = 0, ye = 0;
  for (int v = -kReach; v <= kReach; ++v) {
    for (int u = -kReach; u <= kReach; ++u) {
      const int across = luma.at(x + u + 1, y + v) - luma.at(x + u - 1, y + v);
      const int down = luma.at(x + u, y + v + 1) - luma.at(x + u, y + v - 1);
      const int apart =
          patch[static_cast<std::size_t>((v + kReach) * Features::kPatch + u + kReach)] - luma.at(x + u, y + v);
      gx += across;
      gy += down;
      e += apart;
      xx += across * across;
      xy += across * down;
      yy += down * down;
      xe += across * apart;
      ye += down * apart;
    }
  }
  const auto centred = [](std::int64_t product, std::int64_t a, std::int64_t b) {
    return static_cast<double>(product * kArea - a * b);
  };
  const double a = centred(xx, gx, gx);
  const double b = centred(xy, gx, gy);
  const double c = centred(yy, gy, gy);
  const double p = centred(xe, gx, e);
  const double q = centred(ye, gy, e);
  const double determinant = a * c - b * b;
  if (!(determinant > 1e-3 * a * c)) return Vector::Zero();
  // Gradients over two pixels are twice the slope.
  const Vector step(2 * (c * p - b * q) / determinant, 2 * (a * q - b * p) / determinant);
  return step.cwiseMax(-1).cwiseMin(1);
}

// Per pixel of the window.
double smaller_eigenvalue(const Tensor& tensor) noexcept {
  const auto sum = static_cast<double>(tensor.a + tensor.c);
  const auto apart = static_cast<double>(tensor.a - tensor.c);
  const auto mixed = static_cast<double>(2 * tensor.b);
  return 0.5 * (sum - std::sqrt(apart * apart + mixed * mixed)) / kTensorArea;
}

}  // namespace

Result<Features> Features::create(const Config& config, int width, int height, Arena& arena) noexcept {
  if (config.corner_quality < 1 || config.most_difference < 1 || config.search_px < 1) return fail(Fault::kBadConfig);
  if (width < 1 || height < 1) return fail(Fault::kBadSize);
  Features self;
  self.config_ = config;
  self.corners_ = arena.array<Corner>(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
  if (arena.failed()) return fail(Fault::kOutOfMemory);
  return self;
}

double Features::corner_strength(ImageView<const std::uint8_t> luma, int x, int y) noexcept {
  constexpr int kEdge = kTensorReach + 1;
  if (x < kEdge || y < kEdge || x + kEdge >= luma.width || y + kEdge >= luma.height) return 0;
  Tensor tensor;
  tensors(luma, x, y, 1, &tensor);
  return smaller_eigenvalue(tensor);
}
void Features::follow(ImageView<const std::uint8_t> luma, double dt, double acceleration_sd, Set& set) const noexcept {
  const ConstantVelocityFilter<2>::Matrix R =
      ConstantVelocityFilter<2>::Matrix::Identity() * (kSearchNoise * kSearchNoise);
  Set kept;
  for (Feature& feature : set) {
    const ConstantVelocityFilter<2>::Vector before = feature.filter.position();
    feature.filter.predict(dt, acceleration_sd);
    const auto expected = feature.filter.position();
    const auto S = (feature.filter.position_covariance() + R).eval();
    const auto reach = [&](double variance) {
      return std::clamp(static_cast<int>(std::ceil(3 * std::sqrt(variance))), std::min(2, config_.search_px),
                        config_.search_px);
    };
    const int reach_x = reach(S(0, 0));
    const int reach_y = reach(S(1, 1));
    const int x0 = static_cast<int>(std::floor(expected.x() + 0.5));
    const int y0 = static_cast<int>(std::floor(expected.y() + 0.5));
    const Rect window = intersect({x0 - reach_x, y0 - reach_y, 2 * reach_x + 1, 2 * reach_y + 1},
                                  grown({0, 0, luma.width, luma.height}, -kReach));
    if (window.empty()) continue;
    const auto [best, best_x, best_y] = best_place(feature.patch, luma, window);
    if (best > config_.most_difference * kArea) continue;
    const Vector found = feature.offset + Vector(best_x, best_y) + sub_pixel(feature.patch, luma, best_x, best_y);
    if (!feature.filter.update(found, R)) continue;
    const int x = static_cast<int>(std::floor(found.x() + 0.5));
    const int y = static_cast<int>(std::floor(found.y() + 0.5));
    if (best > config_.most_difference * kArea / 2 && patch_fits(luma, x, y)) {
      cut(luma, x, y, feature.patch);
      feature.offset = found - Vector(x, y);
    }
    feature.moved = feature.filter.position() - before;
    (void)kept.push(feature);
  }
  set = kept;
}

void Features::refill(ImageView<const std::uint8_t> luma, ImageView<const std::uint16_t> labels, std::uint16_t label,
                      const Rect& box, const ConstantVelocityFilter<2>::Vector& velocity, double velocity_sd,
                      Set& set) noexcept {
  const Rect inside = intersect(box, {0, 0, luma.width, luma.height});
  if (inside.empty() || set.size() == Set::capacity()) return;
  static_assert(kReach > kTensorReach, "where a patch fits, a tensor does, too");
  const auto least = static_cast<float>(config_.corner_quality);
  const int least_sum = config_.corner_quality * kTensorArea;
  std::ptrdiff_t count = 0;
  const Rect fitting = intersect(inside, grown({0, 0, luma.width, luma.height}, -kReach));
  std::array<Tensor, kMostTensors> row;
  for (int y = fitting.top; y < fitting.bottom(); ++y) {
    for (int left = fitting.left; left < fitting.right(); left += kMostTensors) {
      const int places = std::min(fitting.right() - left, kMostTensors);
      tensors(luma, left, y, places, row.data());
      for (int i = 0; i < places; ++i) {
        const Tensor& tensor = row[static_cast<std::size_t>(i)];
        // The smaller eigenvalue is no more than a and no more than c.
        if (labels.at(left + i, y) != label || std::min(tensor.a, tensor.c) <= least_sum) continue;
        const auto strength = static_cast<float>(smaller_eigenvalue(tensor));
        if (strength > least)
          corners_[count++] = {static_cast<std::uint16_t>(left + i), static_cast<std::uint16_t>(y), strength};
      }
    }
  }
  const auto clear_around = [&](double px, double py) {
    const Rect taken{static_cast<int>(px) - kPatch, static_cast<int>(py) - kPatch, 2 * kPatch + 1, 2 * kPatch + 1};
    const auto lies_there = [&](const Corner& corner) {
      return corner.x >= taken.left && corner.x < taken.right() && corner.y >= taken.top && corner.y < taken.bottom();
    };
    count = std::remove_if(corners_.begin(), corners_.begin() + count, lies_there) - corners_.begin();
  };
  for (const Feature& feature : set) clear_around(feature.filter.position().x(), feature.filter.position().y());
  const ConstantVelocityFilter<2>::Matrix R =
      ConstantVelocityFilter<2>::Matrix::Identity() * (kSearchNoise * kSearchNoise);
  while (set.size() < Set::capacity()) {
    if (count == 0) return;
    // The first of the strongest.
    const Corner where = *std::max_element(corners_.begin(), corners_.begin() + count,
                                           [](const Corner& a, const Corner& b) { return a.strength < b.strength; });
    Feature feature;
    feature.filter.start({static_cast<double>(where.x), static_cast<double>(where.y)}, R, velocity_sd, velocity);
    cut(luma, where.x, where.y, feature.patch);
    (void)set.push(feature);
    clear_around(where.x, where.y);
  }
}

}  // namespace stereotrack
