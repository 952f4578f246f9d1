#include "pipeline/track/depth_segments.hpp"

#include <algorithm>
#include <array>
#include <cstdlib>

#include "pipeline/shape/region.hpp"
#include "pipeline/stereo/disparity.hpp"

namespace stereotrack {

namespace {

constexpr std::uint16_t kFar = 0xFFFF;
constexpr std::uint16_t kLoose = 0xFFFF;  // belongs to no large component
constexpr int kSweeps = 2;
constexpr int kLumaStep = 4;
constexpr double kSmallPart = 0.05;
constexpr double kSmallKnown = 0.6;

}  // namespace

Result<DepthSegments> DepthSegments::create(const Config& config, int width, int height, Arena& arena) noexcept {
  if (!(config.jump > 0) || !(config.jump_px > 0) || config.min_px < 1 || !(config.min_part >= 0) ||
      !(config.min_known >= 0) || !(config.min_part <= 0.5)) {
    return fail(Fault::kBadConfig);
  }
  if (width < 1 || height < 1 || width > 8192 || height > 8192) return fail(Fault::kBadSize);
  DepthSegments self;
  self.config_ = config;
  const auto framed = [&]() -> ImageView<std::uint16_t> {
    const ImageView<std::uint16_t> all = arena.image<std::uint16_t>(width + 2, height + 2);
    return all.empty() ? all : all.window(1, 1, width, height);
  };
  self.filled_ = arena.image<std::uint16_t>(width, height);
  self.segment_ = framed();
  self.cost_ = framed();
  self.jump_ = config.jump_px * kDisparityScale;
  self.surely_near_ = static_cast<int>(std::min(self.jump_, 65535.0));
  self.pieces_ = arena.array<Piece>(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
  self.places_ = arena.array<Place>(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
  if (arena.failed()) return fail(Fault::kOutOfMemory);
  return self;
}

// Values travel from where cost_ is 0 to where it is kFar, which are the first `count` places, along the cheapest
// paths.
void DepthSegments::spread(ImageView<const std::uint8_t> luma, std::size_t count,
                           ImageView<std::uint16_t> value) noexcept {
  const std::ptrdiff_t stride = cost_.stride;
  // `next` and `down`: where the four neighbours lie that were visited before this pixel.
  const auto relax = [&](Place p, std::ptrdiff_t next, int down) {
    std::uint16_t* here = &cost_.at(p.x, p.y);
    int least = *here;
    std::ptrdiff_t from_x = 0;
    int from_y = 0;
    const auto offer = [&](std::ptrdiff_t dx, int dy) {
      const int there = here[dx + dy * stride];
      if (there == kFar) return;
      const int step = 1 + std::abs(luma.at(p.x, p.y) - luma.row(p.y + dy)[p.x + dx]) / kLumaStep;
      if (there + step >= least) return;
      least = there + step;
      from_x = dx;
      from_y = dy;
    };
    offer(next, 0);
    offer(next, down);
    offer(0, down);
    offer(-next, down);
    if (least == *here) return false;
    *here = static_cast<std::uint16_t>(least);
    value.at(p.x, p.y) = value.row(p.y + from_y)[p.x + from_x];
    return true;
  };
  for (int sweep = 0; sweep < kSweeps; ++sweep) {
    bool changed = false;
    for (std::size_t i = 0; i < count; ++i) changed = relax(places_[i], -1, -1) || changed;
    // The sweep upwards has left nothing to do that another one would find.
    if (sweep > 0 && !changed) return;
    for (std::size_t i = count; i-- > 0;) (void)relax(places_[i], 1, 1);
  }
}

bool DepthSegments::hang_together(int a, int b) const noexcept {
  const int apart = std::abs(a - b);
  return apart <= surely_near_ || apart <= std::max(jump_, config_.jump * std::max(a, b));
}

std::int32_t DepthSegments::root_of(std::int32_t piece) noexcept {
  while (pieces_[piece].parent != piece) {
    pieces_[piece].parent = pieces_[pieces_[piece].parent].parent;
    piece = pieces_[piece].parent;
  }
  return piece;
}

// Pieces of two rows, the one next to the other, are joined where a pixel hangs together with the one below it.
void DepthSegments::join_rows(const Row& above, const Row& here) noexcept {
  const std::uint16_t* upper = filled_.row(above.y);
  const std::uint16_t* lower = filled_.row(here.y);
  std::int32_t a = above.first;
  std::int32_t b = here.first;
  while (a < above.end && b < here.end) {
    const int begin = std::max(pieces_[a].begin, pieces_[b].begin);
    const int end = std::min(pieces_[a].end, pieces_[b].end);
    if (begin < end) {
      const std::int32_t first = root_of(a);
      const std::int32_t second = root_of(b);
      int x = first == second ? end : begin;
      while (x < end && !hang_together(upper[x], lower[x])) ++x;
      if (first != second && x < end) pieces_[std::max(first, second)].parent = std::min(first, second);
    }
    if (pieces_[a].end < pieces_[b].end) {
      ++a;
    } else {
      ++b;
    }
  }
}

void DepthSegments::find_pieces(const Input& in, const Blob& blob) noexcept {
  piece_count_ = 0;
  Row above{-9, 0, 0};  // in no picture, and next to none
  Row here{-9, 0, 0};
  const auto end_row = [&] {
    if (above.y + 1 == here.y) join_rows(above, here);
    above = here;
  };
  for_each_run(in.labels, blob.box, blob.label, [&](int y, int begin, int end) {
    if (y != here.y) {
      end_row();
      here = {y, piece_count_, piece_count_};
    }
    const std::uint16_t* filled = filled_.row(y);
    const std::uint16_t* disparity = in.disparity.row(y);
    for (int x = begin; x < end;) {
      const int from = x++;
      while (x < end && hang_together(filled[x - 1], filled[x])) ++x;
      std::int32_t known = 0;
      for (int u = from; u < x; ++u) known += disparity[u] != kNoDisparity ? 1 : 0;
      pieces_[piece_count_] = {static_cast<std::uint16_t>(from), static_cast<std::uint16_t>(x), piece_count_, x - from,
                               known};
      ++piece_count_;
    }
    here.end = piece_count_;
  });
  end_row();
}

// Components of continuous disparity, in the order of their first pixels; those under `least` pixels become kLoose. How
// many, and segment_ where they are more than one.
int DepthSegments::number_pieces(const Input& in, const Blob& blob, int least) noexcept {
  for (std::int32_t i = 0; i < piece_count_; ++i) {
    const std::int32_t root = root_of(i);
    if (root == i) continue;
    pieces_[root].area += pieces_[i].area;
    pieces_[root].known += pieces_[i].known;
  }
  int found = 0;
  for (std::int32_t i = 0; i < piece_count_; ++i) {
    Piece& piece = pieces_[i];
    if (piece.parent != i) continue;
    // A small one must be sure of itself.
    const double needed = piece.area < kSmallPart * blob.area ? kSmallKnown : config_.min_known;
    const bool sure = piece.known >= needed * piece.area;
    piece.known = piece.area >= least && sure && found < kMost ? found++ : kLoose;
  }
  if (found <= 1) return found;
  std::int32_t next = 0;
  for_each_run(in.labels, blob.box, blob.label, [&](int y, int /*begin*/, int end) {
    for (; next < piece_count_; ++next) {
      const Piece& piece = pieces_[next];
      std::fill(&segment_.at(piece.begin, y), &segment_.at(piece.begin, y) + (piece.end - piece.begin),
                static_cast<std::uint16_t>(pieces_[root_of(next)].known));
      if (piece.end == end) break;
    }
    ++next;
  });
  return found;
}

// The blob's pixels that are known stay, the others are to be reached: their number, and that many places_.
template <class Known>
std::size_t DepthSegments::start_spread(const Input& in, const Blob& blob, Known&& known) noexcept {
  const Rect& box = blob.box;
  for (int y = box.top - 1; y <= box.bottom(); ++y) std::fill_n(&cost_.at(box.left - 1, y), box.width + 2, kFar);
  std::size_t count = 0;
  for_each_pixel(in.labels, box, blob.label, [&](int x, int y) {
    if (known(x, y)) {
      cost_.at(x, y) = 0;
    } else {
      places_[count++] = {static_cast<std::uint16_t>(x), static_cast<std::uint16_t>(y)};
    }
  });
  return count;
}

int DepthSegments::run(const Input& in, const Blob& blob) noexcept {
  const auto all_one = [&] {
    for_each_run(in.labels, blob.box, blob.label, [&](int y, int begin, int end) {
      std::fill_n(&segment_.at(begin, y), end - begin, std::uint16_t{0});
    });
    return 1;
  };
  bool any = false;
  const std::size_t unknown = start_spread(in, blob, [&](int x, int y) {
    const std::uint16_t d = in.disparity.at(x, y);
    filled_.at(x, y) = d;
    any = any || d != kNoDisparity;
    return d != kNoDisparity;
  });
  if (!any) return all_one();
  spread(in.y, unknown, filled_);
  const int least = std::max(config_.min_px, static_cast<int>(config_.min_part * blob.area + 1));
  find_pieces(in, blob);
  const int found = number_pieces(in, blob, least);
  if (found <= 1) return all_one();
  const std::size_t loose = start_spread(in, blob, [&](int x, int y) { return segment_.at(x, y) != kLoose; });
  spread(in.y, loose, segment_);
  // Two sweeps may leave a pixel in a far corner of a winding blob.
  for (std::size_t i = 0; i < loose; ++i) {
    std::uint16_t& segment = segment_.at(places_[i].x, places_[i].y);
    if (segment == kLoose) segment = 0;
  }
  return found;
}

}  // namespace stereotrack
