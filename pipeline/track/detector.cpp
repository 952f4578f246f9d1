#include "pipeline/track/detector.hpp"

#include <algorithm>
#include <cmath>

#include "pipeline/geometry/triangulate.hpp"
#include "pipeline/shape/region.hpp"
#include "pipeline/stereo/disparity.hpp"

namespace stereotrack {

namespace {

// Histogram bins of the layer search: half a pixel of disparity.
constexpr int kBin = kDisparityScale / 2;
constexpr std::size_t kBins = 0x10000 / kBin;
// A claim counts if at least this part of the smaller of target and blob is common to both.
constexpr double kClaimPart = 0.25;
// Targets of which the smaller lies inside the larger by this much are taken for one object.
constexpr double kNestedPart = 0.6;
constexpr double kOwnGap = 2;
constexpr double kMostGrowth = 1.1;
// Part of a piece's colours that a target must explain to be taken for another part of it.
constexpr double kAlike = 0.6;
constexpr double kUnlike = 0.5;
// Part of its usual area that a target must get of a shared region.
constexpr double kSplinterPart = 0.2;
// A depth that does not fit counts against a pixel at most this much.
constexpr double kMostDepthCost = 16.0;
// A colour that the target does not have counts this much, one that it has in this part of its pixels half.
constexpr double kMostColourCost = 4.0;
constexpr double kRareColour = 0.02;
// A region's disparity is never known better than this, whatever the number of pixels: errors of neighbours go
// together, and calibration adds its own.
constexpr double kLeastDisparitySd = 0.10;

double square(double value) noexcept { return value * value; }

double length(double x, double y) noexcept { return std::sqrt(x * x + y * y); }

bool fits_into(const Rect& whole, const Rect& box) noexcept {
  return box.width <= kMostGrowth * whole.width + 2 && box.height <= kMostGrowth * whole.height + 2;
}

}  // namespace

Result<Detector> Detector::create(const Config& config, int width, int height, Arena& arena) noexcept {
  if (config.min_area_px < 1 || !(config.merge_gap >= 0) || !(config.merge_depth >= 0) || !(config.split_depth > 0) ||
      !(config.split_min_px > 0) || !(config.split_part > 0) || !(config.split_jump > 0) ||
      !(config.min_area_ppm >= 0) || !(config.most_scatter > 0) || !(config.match_noise_px > 0)) {
    return fail(Fault::kBadConfig);
  }
  const Result<ConvexHull> hull = ConvexHull::create({}, width, height, arena);
  if (!hull) return fail(hull.error());
  const Result<DepthSegments> segments = DepthSegments::create(
      {.jump = config.split_jump, .min_px = config.min_area_px, .min_part = config.split_part}, width, height, arena);
  if (!segments) return fail(segments.error());
  Detector self(*hull, *segments);
  self.config_ = config;
  self.width_ = width;
  self.height_ = height;
  self.min_area_ = std::max(config.min_area_px, static_cast<int>(config.min_area_ppm * 1e-6 * width * height + 0.5));
  self.candidates_ = BoundedVector<Candidate>(arena.array<Candidate>(kMaxCandidates));
  self.detections_ = BoundedVector<Detection>(arena.array<Detection>(kMaxDetections));
  self.histogram_ = arena.array<std::uint32_t>(kBins);
  self.choice_ = arena.image<std::uint16_t>(width, height);
  if (arena.failed()) return fail(Fault::kOutOfMemory);
  return self;
}

void Detector::layers_from_claims(const Input& in, const Blob& blob) noexcept {
  Candidate whole{};
  whole.label = blob.label;
  whole.box = blob.box;
  for (std::size_t k = 0; k < in.predictions.size() && layers_.size() < layers_.capacity(); ++k) {
    const Prediction& target = in.predictions[k];
    if (!target.confirmed || !target.independent) continue;
    const Rect expected = intersect(target.box, {0, 0, width_, height_});
    const Rect common = intersect(expected, blob.box);
    if (common.empty()) continue;
    if (whole.area == 0) measure(in, whole);
    if (depth_apart(target, whole, 1) > 1) continue;
    int covered = 0;
    int matching = 0;
    int known = 0;
    const double reach = 3 * (target.disparity_sd + config_.match_noise_px) + config_.split_depth * target.disparity;
    for_each_pixel(in.labels, common, blob.label, [&](int x, int y) {
      ++covered;
      if (!target.has_depth || in.disparity.empty()) return;
      const int d = in.disparity.at(x, y);
      if (d == kNoDisparity) return;
      ++known;
      if (std::abs(d / static_cast<double>(kDisparityScale) - target.disparity) <= reach) ++matching;
    });
    const auto smaller = static_cast<double>(std::min<std::int64_t>(expected.area(), blob.area));
    if (covered < kClaimPart * smaller) continue;
    // Hidden behind something else: the pixels where it is expected are at another depth.
    if (known > covered / 3 && matching * 8 < known) continue;
    Layer layer{};
    layer.x = target.box.left + (target.box.width - 1) * 0.5;
    layer.y = target.box.top + (target.box.height - 1) * 0.5;
    layer.half_width = 0.5 * target.box.width + target.image_sd;
    layer.half_height = 0.5 * target.box.height + target.image_sd;
    layer.has_depth = target.has_depth;
    layer.disparity = target.disparity;
    layer.disparity_sd = target.disparity_sd + config_.match_noise_px + 0.25 * config_.split_depth * target.disparity;
    layer.appearance = target.appearance;
    layer.claim = static_cast<int>(k);
    layer.fit = overlap(expected, blob.box);
    // Two targets at one place and depth that were never seen side by side are one object followed twice: the one
    // that fits the blob better claims it.
    bool rival = false;
    for (Layer& other : layers_) {
      const Prediction& rival_target = in.predictions[static_cast<std::size_t>(other.claim)];
      if (rival_target.seen_beside(target)) continue;
      const Rect& box = rival_target.box;
      const auto lesser = static_cast<double>(std::min(box.area(), target.box.area()));
      if (static_cast<double>(intersect(box, target.box).area()) < kNestedPart * lesser) continue;
      if (other.has_depth && layer.has_depth &&
          std::abs(other.disparity - layer.disparity) >
              std::max(config_.split_min_px, config_.split_depth * std::max(other.disparity, layer.disparity))) {
        continue;
      }
      rival = true;
      if (layer.fit > other.fit) other = layer;
      break;
    }
    if (!rival) (void)layers_.push(layer);
  }
}

// A target that would get but a splinter of the region is not there: it is hidden, or gone.
void Detector::drop_weak_claims(const Input& in, const Blob& blob) noexcept {
  while (layers_.size() >= 2) {
    std::array<int, 8> pixels{};
    for_each_pixel(in.labels, blob.box, blob.label, [&](int x, int y) { ++pixels[choose(in, x, y)]; });
    std::size_t weakest = layers_.size();
    double least = kSplinterPart;
    for (std::size_t k = 0; k < layers_.size(); ++k) {
      const double expected = in.predictions[static_cast<std::size_t>(layers_[k].claim)].area;
      const double part = pixels[k] / std::max(expected, 1.0);
      if (part < least) {
        least = part;
        weakest = k;
      }
    }
    if (weakest == layers_.size()) return;
    FixedVector<Layer, 8> kept;
    for (std::size_t k = 0; k < layers_.size(); ++k) {
      if (k != weakest) (void)kept.push(layers_[k]);
    }
    layers_ = kept;
  }
}

std::size_t Detector::choose(const Input& in, int x, int y) const noexcept {
  const int raw = in.disparity.empty() ? kNoDisparity : in.disparity.at(x, y);
  std::size_t best = 0;
  double least = 1e300;
  for (std::size_t k = 0; k < layers_.size(); ++k) {
    const Layer& layer = layers_[k];
    double cost = square((x - layer.x) / layer.half_width) + square((y - layer.y) / layer.half_height);
    if (layer.has_depth && raw != kNoDisparity) {
      const double apart = raw / static_cast<double>(kDisparityScale) - layer.disparity;
      cost += std::min(square(apart / layer.disparity_sd), kMostDepthCost);
    }
    if (layer.appearance != nullptr) {
      const double share = layer.appearance->share(in.y.at(x, y), in.cb.empty() ? 128 : in.cb.at(x, y),
                                                   in.cr.empty() ? 128 : in.cr.at(x, y));
      cost += kMostColourCost * kRareColour / (share + kRareColour);
    }
    if (cost < least) {
      least = cost;
      best = k;
    }
  }
  return best;
}

void Detector::add_candidate(std::uint16_t label, const Rect& box, int claim, std::uint16_t blob, bool whole) noexcept {
  Candidate candidate{};
  candidate.label = label;
  candidate.blob = blob;
  candidate.box = box;
  candidate.claim = claim;
  candidate.whole = whole;
  candidate.root = static_cast<std::uint16_t>(candidates_.size());
  if (!candidates_.push(candidate)) reject(Rejection::kNoRoom);
}

void Detector::split(const Input& in, const Blob& blob) noexcept {
  if (blob.area == 0) return;
  const bool room = !candidates_.full() && !in.disparity.empty();
  const int segments = !room ? 1 : segments_.run({in.labels, in.disparity, in.y}, blob);
  if (segments == 1) {
    split_by_claims(in, blob, blob.label);
    return;
  }
  const std::uint16_t first = next_label_;
  next_label_ = static_cast<std::uint16_t>(next_label_ + segments);
  const ImageView<const std::uint16_t> segment = segments_.segment();
  for_each_pixel(in.labels, blob.box, blob.label,
                 [&](int x, int y) { in.labels.at(x, y) = static_cast<std::uint16_t>(first + segment.at(x, y)); });
  for (int k = 0; k < segments; ++k) {
    const Blob part = measure_region(in.labels, blob.box, static_cast<std::uint16_t>(first + k));
    if (part.area > 0) split_by_claims(in, part, blob.label);
  }
}

// Two targets at one depth: each pixel goes to the one that explains it best.
void Detector::split_by_claims(const Input& in, const Blob& segment, std::uint16_t blob) noexcept {
  layers_.clear();
  layers_from_claims(in, segment);
  if (layers_.size() >= 2) drop_weak_claims(in, segment);
  if (layers_.size() < 2 || candidates_.full()) {
    add_candidate(segment.label, segment.box, -1, blob, true);
    return;
  }
  const std::uint16_t first = next_label_;
  next_label_ = static_cast<std::uint16_t>(next_label_ + layers_.size());
  for_each_pixel(in.labels, segment.box, segment.label,
                 [&](int x, int y) { choice_.at(x, y) = static_cast<std::uint16_t>(first + choose(in, x, y)); });
  // A pixel that stands alone among pixels of other layers follows them: 5x5 majority, written behind the reader.
  for_each_pixel(in.labels, segment.box, segment.label, [&](int x, int y) {
    std::array<int, 8> votes{};
    for (int v = std::max(y - 2, 0); v <= std::min(y + 2, height_ - 1); ++v) {
      for (int u = std::max(x - 2, 0); u <= std::min(x + 2, width_ - 1); ++u) {
        if (in.labels.at(u, v) == segment.label) ++votes[static_cast<std::size_t>(choice_.at(u, v) - first)];
      }
    }
    const auto own = static_cast<std::size_t>(choice_.at(x, y) - first);
    std::size_t most = own;
    for (std::size_t k = 0; k < layers_.size(); ++k) {
      if (votes[k] > votes[most]) most = k;
    }
    choice_.at(x, y) = static_cast<std::uint16_t>(first + most);
  });
  for_each_pixel(in.labels, segment.box, segment.label, [&](int x, int y) { in.labels.at(x, y) = choice_.at(x, y); });
  for (std::size_t k = 0; k < layers_.size(); ++k) {
    add_candidate(static_cast<std::uint16_t>(first + k), segment.box, layers_[k].claim, blob, false);
  }
}

void Detector::measure(const Input& in, Candidate& candidate) noexcept {
  const Blob blob = measure_region(in.labels, candidate.box, candidate.label);
  candidate.area = blob.area;
  if (blob.area == 0) return;
  candidate.box = blob.box;
  candidate.appearance.clear();
  for_each_pixel(in.labels, candidate.box, candidate.label, [&](int x, int y) {
    candidate.appearance.add(in.y.at(x, y), in.cb.empty() ? 128 : in.cb.at(x, y), in.cr.empty() ? 128 : in.cr.at(x, y));
  });
  candidate.valid = 0;
  candidate.has_depth = false;
  if (in.disparity.empty()) return;
  std::size_t first = kBins;
  std::size_t last = 0;
  for_each_pixel(in.labels, candidate.box, candidate.label, [&](int x, int y) {
    const std::uint16_t d = in.disparity.at(x, y);
    if (d == kNoDisparity) return;
    const std::size_t at = d / kBin;
    ++histogram_[at];
    first = std::min(first, at);
    last = std::max(last, at);
    ++candidate.valid;
  });
  if (candidate.valid == 0) return;
  const auto half = static_cast<std::uint32_t>((candidate.valid + 1) / 2);
  std::uint32_t below = 0;
  std::size_t bin = first;
  while (below + histogram_[bin] < half) below += histogram_[bin++];
  // Linear inside the bin.
  candidate.disparity =
      (static_cast<double>(bin) + (half - below) / static_cast<double>(histogram_[bin])) * kBin / kDisparityScale -
      0.5 / kDisparityScale;
  // Grow around the median until half of the pixels are inside.
  std::uint32_t inside = histogram_[bin];
  std::size_t reach = 0;
  while (inside < half) {
    ++reach;
    if (bin >= reach) inside += histogram_[bin - reach];
    if (bin + reach < kBins) inside += histogram_[bin + reach];
  }
  candidate.scatter = (static_cast<double>(reach) + 0.25) * kBin / kDisparityScale;
  const auto most = static_cast<std::uint32_t>(candidate.valid * 9LL / 10);
  while (inside < most) {
    ++reach;
    if (bin >= reach) inside += histogram_[bin - reach];
    if (bin + reach < kBins) inside += histogram_[bin + reach];
  }
  candidate.reach = (static_cast<double>(reach) + 0.25) * kBin / kDisparityScale;
  std::fill(histogram_.begin() + static_cast<std::ptrdiff_t>(first),
            histogram_.begin() + static_cast<std::ptrdiff_t>(last) + 1, 0U);
  // A block's disparities hang together: about one independent value every 5 x 5 pixels.
  const double independent = std::max(candidate.valid / 25.0, 1.0);
  candidate.disparity_sd = std::sqrt(square(kLeastDisparitySd) + square(1.5 * candidate.scatter) / independent);
  candidate.has_depth = true;
}

// Difference in depth, 1 = as much as a piece may be nearer or farther than the target. One that looks alike may lie as
// far from the target's middle as its surface is known to reach.
double Detector::depth_apart(const Prediction& target, const Candidate& candidate, double likeness) const noexcept {
  const bool blind = is_blind(candidate.box, target.disparity);
  if (!target.has_depth || !candidate.has_depth || blind) return 0;
  const double nearer = std::max(target.disparity, candidate.disparity);
  const double usual = config_.merge_depth * nearer;
  const double slack =
      likeness >= kAlike ? std::clamp(target.disparity_reach, usual, config_.split_depth * nearer) : usual;
  const double limit = 2 * (target.disparity_sd + std::min(candidate.disparity_sd, 2.0)) + slack + 0.5;
  return std::abs(target.disparity - candidate.disparity) / limit;
}

// Depth and looks together: a piece may be somewhat nearer than the target or look somewhat different, not both.
bool Detector::resembles(const Prediction& target, const Candidate& candidate) const noexcept {
  const double likeness =
      target.appearance == nullptr
          ? 1.0
          : target.appearance->explains(candidate.appearance, candidate.area / std::max(target.area, 1.0));
  const double apart = depth_apart(target, candidate, likeness);
  return apart <= 1 && square(apart) + square((1 - likeness) / kUnlike) <= 1.5;
}

int Detector::claim_of(const Input& in, const Candidate& candidate) const noexcept {
  int best = -1;
  double most = 0;
  for (std::size_t k = 0; k < in.predictions.size(); ++k) {
    const Prediction& target = in.predictions[k];
    if (!target.confirmed) continue;
    const int slack =
        static_cast<int>(std::min(target.image_sd, 0.25 * std::max(target.box.width, target.box.height)) + 1.5);
    const double inside = static_cast<double>(intersect(grown(target.box, slack), candidate.box).area()) /
                          static_cast<double>(candidate.box.area());
    if (inside <= 0.5) continue;
    if (!resembles(target, candidate)) continue;
    const double likeness = target.appearance == nullptr ? 1.0 : target.appearance->explains(candidate.appearance);
    const double fit = inside + likeness;
    if (fit <= most) continue;
    most = fit;
    best = static_cast<int>(k);
  }
  return best;
}

bool Detector::belong_together(const Input& in, const Candidate& a, const Candidate& b,
                               const Rect& united) const noexcept {
  const bool same = a.claim >= 0 && a.claim == b.claim;
  if (a.has_depth && b.has_depth) {
    const double nearer = std::max(a.disparity, b.disparity);
    const double apart = std::abs(a.disparity - b.disparity);
    const bool cut = a.blob == b.blob && a.claim < 0 && b.claim < 0;
    double limit = cut ? std::max(config_.split_depth * nearer, config_.split_min_px)
                       : std::max(config_.merge_depth * nearer, 1.0);
    if (same) limit = std::max(limit, in.predictions[static_cast<std::size_t>(a.claim)].disparity_reach);
    if (apart > limit + 2 * std::min(length(a.disparity_sd, b.disparity_sd), 2.0)) return false;
  }
  const int across = std::min(a.box.right(), b.box.right()) - std::max(a.box.left, b.box.left);
  const bool stacked = across * 2 >= std::min(a.box.width, b.box.width);
  if (!same && a.claim >= 0 && b.claim >= 0) {
    if (!stacked) return false;
    const Prediction& first = in.predictions[static_cast<std::size_t>(a.claim)];
    const Prediction& second = in.predictions[static_cast<std::size_t>(b.claim)];
    if (first.seen_beside(second)) return false;
    const double speed = std::max(length(first.vx, first.vy), length(second.vx, second.vy));
    const double size = std::max({a.box.width, a.box.height, b.box.width, b.box.height});
    if (length(first.vx - second.vx, first.vy - second.vy) > 0.4 * speed + 0.2 * size) return false;
  }
  const Rect& larger = a.area >= b.area ? a.box : b.box;
  // A target that is known to be one object may have come apart further than strangers may be, but not have grown.
  double reach = std::max(larger.width, larger.height);
  if (same && fits_into(in.predictions[static_cast<std::size_t>(a.claim)].box, united)) {
    const Rect& whole = in.predictions[static_cast<std::size_t>(a.claim)].box;
    reach = kOwnGap * std::max({larger.width, larger.height, whole.width, whole.height});
  }
  return gap(a.box, b.box) <= config_.merge_gap * reach;
}

void Detector::merge(const Input& in) noexcept {
  const auto root_of = [&](std::size_t i) {
    while (candidates_[i].root != i) i = candidates_[i].root;
    return i;
  };
  for (Candidate& candidate : candidates_) candidate.united = candidate.box;
  bool merged = false;
  for (std::size_t i = 0; i < candidates_.size(); ++i) {
    if (candidates_[i].area == 0) continue;
    for (std::size_t j = i + 1; j < candidates_.size(); ++j) {
      if (candidates_[j].area == 0) continue;
      const std::size_t a = root_of(i);
      const std::size_t b = root_of(j);
      if (a == b) continue;
      const Rect united = unite(candidates_[a].united, candidates_[b].united);
      if (!belong_together(in, candidates_[i], candidates_[j], united)) continue;
      candidates_[std::max(a, b)].root = static_cast<std::uint16_t>(std::min(a, b));
      candidates_[std::min(a, b)].united = united;
      merged = true;
    }
  }
  for (std::size_t i = 0; i < candidates_.size(); ++i) {
    const std::size_t root = root_of(i);
    if (root == i || candidates_[i].area == 0) continue;
    relabel_region(in.labels, candidates_[i].box, candidates_[i].label, candidates_[root].label);
    candidates_[root].whole = candidates_[root].whole && candidates_[i].whole;
    candidates_[root].box = candidates_[root].united;
    if (candidates_[i].area > candidates_[root].area) {
      candidates_[root].blob = candidates_[i].blob;
      candidates_[root].area = candidates_[i].area;
    }
    if (candidates_[root].claim < 0) candidates_[root].claim = candidates_[i].claim;
    candidates_[i].area = 0;
  }
  if (!merged) return;
  for (Candidate& candidate : candidates_) {
    if (candidate.area > 0) measure(in, candidate);
  }
}

std::span<Detector::Candidate> Detector::segment(const Input& in) noexcept {
  rejections_ = {};
  candidates_.clear();
  next_label_ = 1;
  for (const Blob& blob : in.blobs) next_label_ = std::max(next_label_, static_cast<std::uint16_t>(blob.label + 1));
  for (const Blob& blob : in.blobs) split(in, blob);
  const auto claim = [&] {
    for (Candidate& candidate : candidates_) {
      if (candidate.area > 0 && candidate.claim < 0) candidate.claim = claim_of(in, candidate);
    }
  };
  for (Candidate& candidate : candidates_) measure(in, candidate);
  claim();
  merge(in);
  claim();
  std::size_t kept = 0;
  for (const Candidate& candidate : candidates_) {
    if (candidate.area > 0) candidates_[kept++] = candidate;
  }
  candidates_.truncate(kept);
  return {candidates_.begin(), candidates_.size()};
}

bool Detector::describe(const Input& in, const Candidate& candidate, Detection& out) noexcept {
  out = Detection{};
  out.box = candidate.box;
  out.area = candidate.area;
  out.whole = candidate.whole;
  out.region = candidate.blob;
  out.appearance = candidate.appearance;
  std::uint64_t strength = 0;
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  double u_sum = 0;
  double v_sum = 0;
  const bool stereo = candidate.has_depth && in.rectifier != nullptr;
  const double reach = 3 * candidate.scatter + 1;
  for_each_pixel(in.labels, candidate.box, candidate.label, [&](int x, int y) {
    strength += in.strength.at(x, y);
    if (!stereo) return;
    const Rectifier::PointF place = in.rectifier->rectified_from_raw().at(x, y);
    if (!place.valid()) return;
    const int raw = in.disparity.empty() ? kNoDisparity : in.disparity.at(x, y);
    double d = raw == kNoDisparity ? candidate.disparity : raw / static_cast<double>(kDisparityScale);
    if (std::abs(d - candidate.disparity) > reach || d < kMinDisparity) d = candidate.disparity;
    const RectifiedGeometry& g = in.rectifier->geometry();
    const double scale = g.baseline / d;
    mean += Eigen::Vector3d((place.x - g.cx_left) * scale, (place.y - g.cy) * scale, g.f * scale);
    u_sum += place.x;
    v_sum += place.y;
    out.disparity_sd += 1;
  });
  out.strength = std::min(static_cast<double>(strength) / candidate.area / 80.0, 1.0);
  const double placed = out.disparity_sd;
  out.disparity_sd = 0;
  if (stereo && placed > 0 && candidate.disparity >= kMinDisparity) {
    const RectifiedGeometry& g = in.rectifier->geometry();
    out.position = mean / placed;
    // The mean of points at many disparities lies at its own disparity, f b / Z.
    out.disparity = g.f * g.baseline / out.position.z();
    out.disparity_sd = candidate.disparity_sd;
    out.disparity_reach = candidate.reach;
    const double sigma_px = 0.5 + 0.03 * std::sqrt(static_cast<double>(candidate.area));
    const std::optional<Estimate3> point =
        triangulate(g, {u_sum / placed, v_sum / placed, out.disparity}, {sigma_px, sigma_px, out.disparity_sd});
    if (point) {
      out.position_covariance = point->covariance;
      out.has_depth = true;
    }
  }
  const Result<Hull> hull = hull_.run(in.labels, candidate.box, candidate.label);
  if (hull.has_value()) out.hull = *hull;
  return true;
}

std::span<const Detection> Detector::conclude(const Input& in) noexcept {
  detections_.clear();
  std::sort(candidates_.begin(), candidates_.end(), [](const Candidate& a, const Candidate& b) {
    return a.area != b.area ? a.area > b.area : a.label < b.label;
  });
  const std::uint16_t offset = 0x8000;
  for (const Candidate& candidate : candidates_) {
    if (candidate.area < min_area_) {
      reject(Rejection::kSmall);
      continue;
    }
    const bool known = candidate.claim >= 0;
    if (in.rectifier != nullptr && !candidate.has_depth && !known) {
      reject(Rejection::kNoTexture);
      continue;
    }
    if (candidate.has_depth && candidate.scatter > std::max(config_.most_scatter * candidate.disparity, 1.5) &&
        !known) {
      reject(Rejection::kInconsistent);
      continue;
    }
    if (candidate.own_surface) {
      reject(Rejection::kOwnSurface);
      continue;
    }
    Detection detection;
    if (detections_.full() || !describe(in, candidate, detection)) {
      reject(Rejection::kNoRoom);
      continue;
    }
    (void)detections_.push(detection);
    relabel_region(in.labels, candidate.box, candidate.label, static_cast<std::uint16_t>(offset | detections_.size()));
  }
  for (int y = 0; y < height_; ++y) {
    std::uint16_t* label = in.labels.row(y);
    for (int x = 0; x < width_; ++x) {
      label[x] = (label[x] & offset) != 0 ? static_cast<std::uint16_t>(label[x] & 0x7FFFU) : std::uint16_t{0};
    }
  }
  return detections_.view();
}

}  // namespace stereotrack
