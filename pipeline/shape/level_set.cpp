#include "pipeline/shape/level_set.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <utility>

#include "pipeline/shape/bits_kernel.hpp"
#include "pipeline/shape/region.hpp"

namespace stereotrack {
namespace {

constexpr std::int8_t kIn = 1;
constexpr std::int8_t kOut = -1;
constexpr std::int8_t kNone = 0;

// The disc of 37 pixels within sqrt(10) px: half widths of its rows. A straight contour along a row parts
// 15 + 8 + 3 = 26 pairs a pixel.
constexpr int kReach = 3;
constexpr std::array<int, 2 * kReach + 1> kHalfWidth = {1, 2, 3, 3, 3, 2, 1};
constexpr int kPairsPerPixel = 26;

// A sum of 0, so that sums of -37..37 are bytes without a sign, which eight at a time may change by two.
constexpr std::uint8_t kNoSum = 64;

// Twos in the bytes of a row of eight that begins kReach before the disc's middle, where the disc is.
static_assert(std::endian::native == std::endian::little, "the first pixel must be a word's lowest byte");
constexpr std::array<std::uint64_t, kHalfWidth.size()> kTwos = [] {
  std::array<std::uint64_t, kHalfWidth.size()> rows{};
  for (std::size_t i = 0; i < rows.size(); ++i) {
    for (int x = -kHalfWidth[i]; x <= kHalfWidth[i]; ++x) rows[i] |= std::uint64_t{2} << (8 * (x + kReach));
  }
  return rows;
}();

}  // namespace

Result<LevelSet> LevelSet::create(const Config& config, int width, int height, Arena& arena) noexcept {
  if (width <= 0 || height <= 0 || config.margin_px < 0 || config.margin_px > 1000 || config.max_iterations < 0 ||
      config.contour_weight < 0 || config.contour_weight > 65025 || config.feature_cap < 1 ||
      config.feature_cap > 255) {
    return fail(Fault::kBadConfig);
  }
  LevelSet stage;
  stage.config_ = config;
  stage.width_ = width;
  stage.height_ = height;
  const std::size_t framed =
      (static_cast<std::size_t>(width) + 2 * kReach) * (static_cast<std::size_t>(height) + 2 * kReach);
  stage.side_ = arena.array<std::int8_t>(framed);
  stage.around_ = arena.array<std::uint8_t>(framed + sizeof(std::uint64_t));
  for (std::span<std::int8_t>& sums : stage.row_sums_) sums = arena.array<std::int8_t>(static_cast<std::size_t>(width));
  stage.feature_ = arena.array<std::uint8_t>(framed);
  stage.marks_ = arena.array<std::uint8_t>(static_cast<std::size_t>(width));
  stage.queued_ = arena.array<std::uint8_t>(framed);
  stage.band_ = arena.array<std::int32_t>(framed);
  stage.next_band_ = arena.array<std::int32_t>(framed);
  if (stage.side_.empty() || stage.around_.empty() || stage.row_sums_.back().empty() || stage.feature_.empty() ||
      stage.marks_.empty() || stage.queued_.empty() || stage.band_.empty() || stage.next_band_.empty()) {
    return fail(Fault::kOutOfMemory);
  }
  return stage;
}

Result<LevelSet::Outcome> LevelSet::run(ImageView<const std::uint8_t> feature, ImageView<std::uint16_t> labels,
                                        const Rect& box, std::uint16_t label) noexcept {
  if (feature.width != width_ || feature.height != height_ || !feature.same_size(labels)) {
    return fail(Fault::kBadSize);
  }
  if (label == 0) return fail(Fault::kBadConfig);
  Outcome outcome;
  outcome.blob.label = label;
  const Rect picture{0, 0, width_, height_};
  const Rect start = intersect(box, picture);
  if (start.empty()) {
    outcome.converged = true;
    return outcome;
  }
  domain_ = intersect(grown(start, config_.margin_px), picture);
  load(feature, labels, label);
  const std::int64_t data_start = in_.energy() + out_.energy();
  while (!outcome.converged && outcome.iterations < config_.max_iterations) {
    outcome.converged = sweep() == 0;
    ++outcome.iterations;
    in_.renew_mean();
    out_.renew_mean();
  }
  outcome.energy_drop = data_start - in_.energy() - out_.energy() - pair_weight() * parted_;
  outcome.mean_in = static_cast<int>(in_.mean);
  outcome.mean_out = static_cast<int>(out_.mean);

  const int width = domain_.width;
  for (int y = 0; y < domain_.height; ++y) {
    const std::int8_t* side = &side_[at(0, y)];
    std::uint16_t* row = labels.row(domain_.top + y) + domain_.left;
    for (int x = 0; x < width; ++x) {
      const std::uint16_t mine = side[x] == kIn ? label : std::uint16_t{0};
      row[x] = side[x] == kNone ? row[x] : mine;
    }
  }
  outcome.blob = measure_region(labels, domain_, label);
  return outcome;
}

void LevelSet::load(ImageView<const std::uint8_t> feature, ImageView<const std::uint16_t> labels,
                    std::uint16_t label) noexcept {
  stride_ = domain_.width + 2 * kReach;
  const std::int32_t framed = stride_ * (domain_.height + 2 * kReach);
  std::fill_n(side_.begin(), framed, kNone);
  std::fill_n(queued_.begin(), framed, std::uint8_t{0});
  std::fill_n(around_.begin(), static_cast<std::size_t>(framed) + sizeof(std::uint64_t), kNoSum);
  in_ = {};
  out_ = {};
  parted_ = 0;
  next_size_ = 0;
  visit_ = 1;
  // Locals, which bytes written do not alias: else nothing is vectorised.
  const int width = domain_.width;
  const auto cap = static_cast<std::uint8_t>(config_.feature_cap);
  for (int y = 0; y < domain_.height; ++y) {
    const std::uint16_t* row = labels.row(domain_.top + y) + domain_.left;
    const std::uint8_t* from = feature.row(domain_.top + y) + domain_.left;
    std::int8_t* side = &side_[at(0, y)];
    std::uint8_t* values = &feature_[at(0, y)];
    for (int x = 0; x < width; ++x) values[x] = std::min(from[x], cap);
    for (int x = 0; x < width; ++x)
      side[x] = static_cast<std::int8_t>((row[x] == label ? 1 : 0) - (row[x] == 0 ? 1 : 0));
    // A row's sums are at most 8192 times 255^2: 32 bits. A square takes 16.
    std::array<std::int32_t, 6> sums{};
    for (int x = 0; x < width; ++x) {
      const std::uint16_t value = values[x];
      const auto square = static_cast<std::uint16_t>(value * value);
      const auto in = static_cast<std::uint16_t>(side[x] == kIn ? 0xFFFF : 0);
      const auto out = static_cast<std::uint16_t>(side[x] == kOut ? 0xFFFF : 0);
      sums[0] += in & 1;
      sums[1] += value & in;
      sums[2] += square & in;
      sums[3] += out & 1;
      sums[4] += value & out;
      sums[5] += square & out;
    }
    in_.add(sums[0], sums[1], sums[2]);
    out_.add(sums[3], sums[4], sums[5]);
  }
  in_.renew_mean();
  out_.renew_mean();
  sum_discs();
  for (int y = 0; y < domain_.height; ++y) queue_contour(y);
}

// Pixels of one row with a neighbour on the other side.
void LevelSet::queue_contour(int y) noexcept {
  const int width = domain_.width;
  const std::int8_t* side = &side_[at(0, y)];
  const std::int8_t* above = side - stride_;
  const std::int8_t* below = side + stride_;
  std::uint8_t* marks = marks_.data();
  // 1 and -1, and no other two, differ in all bits but the lowest.
  constexpr int kOpposite = 0xFE;
  static_assert(((kIn ^ kOut) & 0xFF) == kOpposite);
  for (int x = 0; x < width; ++x) {
    const auto parts = [own = side[x]](std::int8_t other) {
      return static_cast<std::uint8_t>(static_cast<std::uint8_t>(own ^ other) == kOpposite ? 1 : 0);
    };
    marks[x] = static_cast<std::uint8_t>(parts(side[x - 1]) | parts(side[x + 1]) | parts(above[x]) | parts(below[x]));
  }
  for_each_set_run(marks, width, [&](int begin, int end) {
    for (int x = begin; x < end; ++x) {
      queued_[at(x, y)] = visit_;
      next_band_[next_size_++] = at(x, y);
    }
  });
}

int LevelSet::sweep() noexcept {
  std::swap(band_, next_band_);
  const std::int32_t band_size = next_size_;
  if (visit_ == UINT8_MAX) {
    std::fill_n(queued_.begin(), stride_ * (domain_.height + 2 * kReach), std::uint8_t{0});
    visit_ = 0;
  }
  ++visit_;

  // (I - c_out)^2 - (I - c_in)^2: what belonging inside is worth.
  const std::int64_t span = out_.mean - in_.mean;
  const std::int64_t sum = out_.mean + in_.mean;
  const auto worth = [span, sum](int value) { return span * (sum - 512 * value); };

  // Locals, which bytes written do not alias: the members would be read again after each.
  const std::int64_t weight = pair_weight();
  const std::ptrdiff_t stride = stride_;
  const std::uint8_t visit = visit_;
  const std::int8_t* const sides = side_.data();
  std::uint8_t* const queued = queued_.data();
  const std::uint8_t* const around = around_.data();
  const std::uint8_t* const values = feature_.data();
  const std::int32_t* const band = band_.data();
  std::int32_t* next = next_band_.data();
  // No branches but the one on what changes, which is rare: others would be guessed wrong often. What is not wanted is
  // written over by the next.
  const auto queue = [&next, queued, visit](std::ptrdiff_t p, bool wanted) {
    const std::uint8_t before = queued[p];
    *next = static_cast<std::int32_t>(p);
    next += static_cast<int>(wanted) & static_cast<int>(before != visit);
    queued[p] = wanted ? visit : before;
  };
  int changed = 0;
  for (std::int32_t i = 0; i < band_size; ++i) {
    const std::ptrdiff_t p = band[i];
    const std::int8_t* const here = sides + p;
    const int side = *here;  // what is in the band is on one of the two
    const int other = -side;
    const bool on_contour =
        (here[-1] == other) | (here[1] == other) | (here[-stride] == other) | (here[stride] == other);
    queue(p, on_contour);
    const int value = values[p];
    // Neighbours on its side are parted from it, those on the other joined.
    const int parted = around[p] - kNoSum - side;
    const bool gains = side * (worth(value) + weight * parted) < 0;
    if (!(on_contour & gains)) continue;
    in_.add(-side, -side * value, -side * value * value);
    out_.add(side, side * value, side * value * value);
    parted_ += side * parted;
    flip(static_cast<std::int32_t>(p));
    ++changed;
    for (const std::ptrdiff_t neighbour : {p - stride, p - 1, p + 1, p + stride}) {
      queue(neighbour, sides[neighbour] != kNone);
    }
  }
  next_size_ = static_cast<std::int32_t>(next - next_band_.data());
  return changed;
}

// Of the whole domain, from nothing; flip() keeps them up to date. Each row of sides is summed over 3, 5 and 7 pixels,
// and what a disc around a pixel above or below takes of it is added there.
void LevelSet::sum_discs() noexcept {
  const int width = domain_.width;
  for (int y = 0; y < domain_.height; ++y) {
    const std::int8_t* row = &side_[at(0, y)];
    const std::array<std::int8_t*, kReach> sums{row_sums_[0].data(), row_sums_[1].data(), row_sums_[2].data()};
    for (int x = 0; x < width; ++x) {
      const int three = row[x - 1] + row[x] + row[x + 1];
      const int five = three + row[x - 2] + row[x + 2];
      sums[0][x] = static_cast<std::int8_t>(three);
      sums[1][x] = static_cast<std::int8_t>(five);
      sums[2][x] = static_cast<std::int8_t>(five + row[x - 3] + row[x + 3]);
    }
    for (int v = -kReach; v <= kReach; ++v) {
      const std::int8_t* part = sums[static_cast<std::size_t>(kHalfWidth[static_cast<std::size_t>(v + kReach)]) - 1];
      std::uint8_t* around = &around_[at(0, y + v)];
      for (int x = 0; x < width; ++x) around[x] = static_cast<std::uint8_t>(around[x] + part[x]);
    }
  }
}

// To the other side. Sums in the frame around the domain change with the others: nobody reads them, and as their discs
// lie mostly outside they stay bytes, too.
void LevelSet::flip(std::int32_t p) noexcept {
  const bool leaves = side_[p] == kIn;
  side_[p] = leaves ? kOut : kIn;
  std::uint8_t* row = &around_[p] - kReach * stride_ - kReach;
  for (const std::uint64_t twos : kTwos) {
    std::uint64_t eight;
    std::memcpy(&eight, row, sizeof eight);
    eight = leaves ? eight - twos : eight + twos;
    std::memcpy(row, &eight, sizeof eight);
    row += stride_;
  }
}

std::int64_t LevelSet::pair_weight() const noexcept {
  return static_cast<std::int64_t>(config_.contour_weight) * 65536 / kPairsPerPixel;
}

std::int32_t LevelSet::at(int x, int y) const noexcept { return (y + kReach) * stride_ + x + kReach; }

}  // namespace stereotrack
