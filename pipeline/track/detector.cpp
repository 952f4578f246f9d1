#include "pipeline/track/detector.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "pipeline/core/square.hpp"
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

double length(double x, double y) noexcept { return std::sqrt(x * x + y * y); }

// The disparities in 1/16 px, of those that are known, that lie within `reach` of `middle` [px]: first and last, or an
// empty range.
std::pair<int, int> values_within(double middle, double reach) noexcept {
  const auto within = [=](int d) { return std::abs(d / static_cast<double>(kDisparityScale) - middle) <= reach; };
  const auto value = [](double px) {
    return static_cast<int>(std::clamp(px * kDisparityScale, 0.0, static_cast<double>(kNoDisparity - 1)));
  };
  // Near enough by a value; which of two it is, the question itself says.
  int low = std::max(value(middle - reach) - 1, 0);
  int high = std::min(value(middle + reach) + 1, kNoDisparity - 1);
  while (low <= high && !within(low)) ++low;
  while (high >= low && !within(high)) --high;
  return {low, high};
}

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
  self.histogram_ = arena.array<std::uint32_t>(2 * kBins);
  self.choice_ = arena.image<std::uint16_t>(width, height);
  if (arena.failed()) return fail(Fault::kOutOfMemory);
  return self;
}

// The segment as a candidate, measured once.
Detector::Candidate& Detector::whole_of(const Input& in, const Blob& blob) noexcept {
  if (whole_.area == 0) {
    whole_ = Candidate{};
    whole_.label = blob.label;
    whole_.box = blob.box;
    measure(in, whole_);
  }
  return whole_;
}

void Detector::layers_from_claims(const Input& in, const Blob& blob) noexcept {
  for (std::size_t k = 0; k < in.predictions.size() && layers_.size() < layers_.capacity(); ++k) {
    const Prediction& target = in.predictions[k];
    if (!target.confirmed || !target.independent) continue;
    const Rect expected = intersect(target.box, {0, 0, width_, height_});
    const Rect common = intersect(expected, blob.box);
    if (common.empty()) continue;
    if (depth_apart(target, whole_of(in, blob), 1) > 1) continue;
    int covered = 0;
    int matching = 0;
    int known = 0;
    const double reach = 3 * (target.disparity_sd + config_.match_noise_px) + config_.split_depth * target.disparity;
    const bool by_depth = target.has_depth && !in.disparity.empty();
    const auto [lowest, highest] = by_depth ? values_within(target.disparity, reach) : std::pair(0, -1);
    for_each_run(in.labels, common, blob.label, [&, low = lowest, high = highest](int y, int begin, int end) {
      covered += end - begin;
      if (!by_depth) return;
      const std::uint16_t* d = in.disparity.row(y);
      int known_of_run = 0;
      int matching_of_run = 0;
      for (int x = begin; x < end; ++x) {
        known_of_run += d[x] != kNoDisparity ? 1 : 0;
        matching_of_run += static_cast<int>(d[x] >= low) & static_cast<int>(d[x] <= high);
      }
      known += known_of_run;
      matching += matching_of_run;
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

// A target that would get but a splinter of the region is not there: it is hidden, or gone. Leaves each pixel's layer,
// where two or more stay, in choice_.
void Detector::drop_weak_claims(const Input& in, const Blob& blob) noexcept {
  while (layers_.size() >= 2) {
    std::array<int, 8> pixels{};
    for_each_pixel(in.labels, blob.box, blob.label, [&](int x, int y) {
      const std::size_t chosen = choose(in, x, y);
      ++pixels[chosen];
      choice_.at(x, y) = static_cast<std::uint16_t>(chosen);
    });
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

// A part of a segment that targets share.
void Detector::add_candidate(const Input& in, std::uint16_t label, const Rect& box, int claim,
                             std::uint16_t blob) noexcept {
  Candidate candidate{};
  candidate.label = label;
  candidate.blob = blob;
  candidate.box = box;
  candidate.claim = claim;
  candidate.root = static_cast<std::uint16_t>(candidates_.size());
  measure(in, candidate);
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
  whole_.area = 0;
  layers_from_claims(in, segment);
  if (layers_.size() >= 2) drop_weak_claims(in, segment);
  if (layers_.size() < 2 || candidates_.full()) {
    if (candidates_.full()) return reject(Rejection::kNoRoom);
    (void)candidates_.push(whole_of(in, segment));
    Candidate& candidate = candidates_[candidates_.size() - 1];
    candidate.blob = blob;
    candidate.claim = -1;
    candidate.whole = true;
    candidate.root = static_cast<std::uint16_t>(candidates_.size() - 1);
    return;
  }
  const std::uint16_t first = next_label_;
  next_label_ = static_cast<std::uint16_t>(next_label_ + layers_.size());
  // A pixel that stands alone among pixels of other layers follows them: 5x5 majority, written behind the reader.
  for_each_pixel(in.labels, segment.box, segment.label, [&](int x, int y) {
    std::array<int, 8> votes{};
    for (int v = std::max(y - 2, 0); v <= std::min(y + 2, height_ - 1); ++v) {
      for (int u = std::max(x - 2, 0); u <= std::min(x + 2, width_ - 1); ++u) {
        if (in.labels.at(u, v) == segment.label) ++votes[choice_.at(u, v)];
      }
    }
    const std::size_t own = choice_.at(x, y);
    std::size_t most = own;
    for (std::size_t k = 0; k < layers_.size(); ++k) {
      if (votes[k] > votes[most]) most = k;
    }
    choice_.at(x, y) = static_cast<std::uint16_t>(most);
  });
  for_each_pixel(in.labels, segment.box, segment.label,
                 [&](int x, int y) { in.labels.at(x, y) = static_cast<std::uint16_t>(first + choice_.at(x, y)); });
  for (std::size_t k = 0; k < layers_.size(); ++k) {
    add_candidate(in, static_cast<std::uint16_t>(first + k), segment.box, layers_[k].claim, blob);
  }
}

void Detector::measure(const Input& in, Candidate& candidate) noexcept {
  const Blob blob = measure_region(in.labels, candidate.box, candidate.label);
  candidate.area = blob.area;
  if (blob.area == 0) return;
  candidate.box = blob.box;
  Appearance::Counts colours;
  candidate.valid = 0;
  candidate.has_depth = false;
  const bool stereo = !in.disparity.empty();
  int first_value = kNoDisparity;
  int last_value = -1;
  for_each_run(in.labels, candidate.box, candidate.label, [&](int y, int begin, int end) {
    const bool grey = in.cb.empty();
    colours.add(in.y.row(y) + begin, grey ? nullptr : in.cb.row(y) + begin, grey ? nullptr : in.cr.row(y) + begin,
                end - begin);
    if (!stereo) return;
    const std::uint16_t* d = in.disparity.row(y);
    for (int x = begin; x < end; ++x) {
      ++histogram_[static_cast<std::size_t>(x & 1) * kBins + d[x] / kBin];
      // The next value of kNoDisparity is 0.
      first_value = std::min<int>(first_value, d[x]);
      last_value = std::max<int>(last_value, static_cast<std::uint16_t>(d[x] + 1) - 1);
    }
  });
  candidate.appearance = Appearance(colours);
  if (!stereo) return;
  constexpr std::size_t kNone = kNoDisparity / kBin;
  candidate.valid = candidate.area - static_cast<int>(histogram_[kNone] + histogram_[kBins + kNone]);
  histogram_[kNone] = histogram_[kBins + kNone] = 0;
  if (candidate.valid == 0) return;
  const auto first = static_cast<std::size_t>(first_value / kBin);
  const auto last = static_cast<std::size_t>(last_value / kBin);
  for (std::size_t i = first; i <= last; ++i) histogram_[i] += histogram_[kBins + i];
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
  for (const std::size_t table : {std::size_t{0}, kBins}) {
    std::fill_n(histogram_.begin() + static_cast<std::ptrdiff_t>(table + first), last - first + 1, 0U);
  }
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
  for (std::size_t i = 0; i < candidates_.size(); ++i) {
    if (candidates_[i].area == 0) candidates_[root_of(i)].grown = true;
  }
  for (Candidate& candidate : candidates_) {
    if (candidate.area > 0 && candidate.grown) measure(in, candidate);
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
  claim();
  merge(in);
  claim();
  std::size_t kept = 0;
  for (std::size_t i = 0; i < candidates_.size(); ++i) {
    if (candidates_[i].area == 0) continue;
    if (kept < i) candidates_[kept] = candidates_[i];
    ++kept;
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
  int places_known = 0;
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  double u_sum = 0;
  double v_sum = 0;
  const bool stereo = candidate.has_depth && in.rectifier != nullptr;
  const double reach = 3 * candidate.scatter + 1;
  int last_raw = kNoDisparity;
  double scale = stereo ? in.rectifier->geometry().baseline / candidate.disparity : 0;
  for_each_run(in.labels, candidate.box, candidate.label, [&](int y, int begin, int end) {
    const std::uint8_t* strengths = in.strength.row(y);
    std::uint32_t strength_of_run = 0;
    for (int x = begin; x < end; ++x) strength_of_run += strengths[x];
    strength += strength_of_run;
    if (!stereo) return;
    const RectifiedGeometry& g = in.rectifier->geometry();
    const Rectifier::PointF* places = in.rectifier->rectified_from_raw().row(y);
    const std::uint16_t* disparity = in.disparity.empty() ? nullptr : in.disparity.row(y);
    for (int x = begin; x < end; ++x) {
      const Rectifier::PointF place = places[x];
      if (!place.valid()) continue;
      const int raw = disparity == nullptr ? kNoDisparity : disparity[x];
      if (raw != last_raw) {  // neighbours' mostly are alike
        double d = raw == kNoDisparity ? candidate.disparity : raw / static_cast<double>(kDisparityScale);
        if (std::abs(d - candidate.disparity) > reach || d < kMinDisparity) d = candidate.disparity;
        scale = g.baseline / d;
        last_raw = raw;
      }
      mean += Eigen::Vector3d((place.x - g.cx_left) * scale, (place.y - g.cy) * scale, g.f * scale);
      u_sum += place.x;
      v_sum += place.y;
      ++places_known;
    }
  });
  out.strength = std::min(static_cast<double>(strength) / candidate.area / 80.0, 1.0);
  const double placed = places_known;
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

void Detector::reject(const Input& in, const Candidate& candidate, Rejection why, double size_m) noexcept {
  reject(why);
  in.observer.tell(
      RejectedCandidate{why, candidate.box, candidate.area, candidate.has_depth, candidate.disparity, size_m});
}

void Detector::distrust_depth() noexcept {
  for (Detection& detection : detections_) {
    detection.has_depth = false;
    detection.may_begin = false;
  }
}

std::span<const Detection> Detector::conclude(const Input& in) noexcept {
  detections_.clear();
  // A candidate is large: their places are sorted.
  std::array<std::uint16_t, kMaxCandidates> order;
  const auto count = static_cast<std::ptrdiff_t>(candidates_.size());
  std::iota(order.begin(), order.begin() + count, std::uint16_t{0});
  std::sort(order.begin(), order.begin() + count, [this](std::uint16_t i, std::uint16_t j) {
    const Candidate& a = candidates_[i];
    const Candidate& b = candidates_[j];
    return a.area != b.area ? a.area > b.area : a.label < b.label;
  });
  const std::uint16_t offset = 0x8000;
  for (std::ptrdiff_t i = 0; i < count; ++i) {
    const Candidate& candidate = candidates_[order[static_cast<std::size_t>(i)]];
    if (candidate.area < min_area_) {
      reject(in, candidate, Rejection::kSmall);
      continue;
    }
    const bool known = candidate.claim >= 0;
    if (in.rectifier != nullptr && !candidate.has_depth && !known) {
      reject(in, candidate, Rejection::kNoTexture);
      continue;
    }
    if (candidate.has_depth && candidate.scatter > std::max(config_.most_scatter * candidate.disparity, 1.5) &&
        !known) {
      reject(in, candidate, Rejection::kInconsistent);
      continue;
    }
    if (candidate.own_surface) {
      reject(in, candidate, Rejection::kOwnSurface);
      continue;
    }
    Detection detection;
    if (detections_.full() || !describe(in, candidate, detection)) {
      reject(in, candidate, Rejection::kNoRoom);
      continue;
    }
    if (in.rules != nullptr) {
      const ZoneRules::Verdict verdict = in.rules->judge(detection, known, in.rectifier);
      if (verdict.why) {
        reject(in, candidate, *verdict.why, verdict.size_m);
        continue;
      }
      detection.may_begin = in.rules->may_begin(detection);
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
