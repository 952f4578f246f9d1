#include "pipeline/motion/adaptive_background.hpp"

#include <algorithm>
#include <array>
#include <numeric>

#include "pipeline/motion/distance_kernel.hpp"
#include "pipeline/motion/learn_kernel.hpp"

namespace stereotrack {

namespace {

constexpr int kSameLight = 256;  // a gain

}  // namespace

Result<AdaptiveBackground> AdaptiveBackground::create(const Config& config, int width, int height, bool colour,
                                                      Arena& arena) noexcept {
  if (config.window < 2 || config.window > 1024 || config.absorb_frames < 2 || config.absorb_frames > 60000 ||
      config.pull < 0 || config.pull > 8 || config.noise_floor < 1 || config.noise_floor > 4096 ||
      config.edge_percent < 0 || config.edge_percent > 200 || config.relearn_percent < 1 ||
      config.relearn_percent > 100) {
    return fail(Fault::kBadConfig);
  }
  if (width < 1 || height < 1) return fail(Fault::kBadSize);
  AdaptiveBackground self;
  self.config_ = config;
  self.colour_ = colour;
  const auto make = [&](Channel& channel) {
    channel.mean = arena.image<std::uint16_t>(width, height);
    channel.deviation = arena.image<std::uint16_t>(width, height);
    channel.candidate = arena.image<std::uint16_t>(width, height);
    channel.shown = arena.image<std::uint8_t>(width, height);
  };
  make(self.y_);
  if (colour) {
    make(self.cb_);
    make(self.cr_);
  }
  self.age_ = arena.image<std::uint16_t>(width, height);
  self.candidate_age_ = arena.image<std::uint16_t>(width, height);
  self.luma_ = arena.image<std::uint8_t>(width, height);
  self.range_ = arena.array<std::uint8_t>(static_cast<std::size_t>(width));
  self.bins_ = arena.array<std::uint16_t>(static_cast<std::size_t>(width));
  self.foreground_ = arena.image<std::uint8_t>(width, height);
  if (arena.failed()) return fail(Fault::kOutOfMemory);
  return self;
}

int AdaptiveBackground::estimate_gain(ImageView<const std::uint8_t> y) const noexcept {
  // Neighbours mostly fall into one bin, and four tables need not wait for each other's last count.
  constexpr int kTables = 4;
  std::array<std::array<std::uint32_t, kGainBins + 1>, kTables> histogram{};
  const int columns = (y.width + kGainStep - 1) / kGainStep;
  for (int v = 0; v < y.height; v += kGainStep) {
    gain_bins(y.row(v), y_.mean.row(v), foreground_.row(v), columns, bins_.data());
    for (int i = 0; i < columns; ++i) ++histogram[static_cast<std::size_t>(i % kTables)][bins_[i]];
  }
  for (int table = 1; table < kTables; ++table) {
    for (std::size_t bin = 0; bin < kGainBins; ++bin) histogram[0][bin] += histogram[table][bin];
  }
  const std::uint32_t total = std::accumulate(histogram[0].begin(), histogram[0].end() - 1, 0U);
  if (total < 64) return 256;
  std::uint32_t below = 0;
  int median = 0;
  while (below + histogram[0][static_cast<std::size_t>(median)] <= total / 2) {
    below += histogram[0][static_cast<std::size_t>(median)];
    ++median;
  }
  return std::clamp(median, 64, 1023);
}

void AdaptiveBackground::distance(const Planes& picture, ImageView<std::uint8_t> out) noexcept {
  const int width = out.width;
  const int height = out.height;
  if (seen_ == 0) {
    for (int y = 0; y < height; ++y) std::fill_n(out.row(y), width, std::uint8_t{0});
    return;
  }
  gain_ = estimate_gain(picture.y);
  for (int y = 0; y < height; ++y) {
    lit_row(y_.mean.row(y), gain_, width, luma_.row(y));
    if (colour_) {
      lit_row(cb_.mean.row(y), kSameLight, width, cb_.shown.row(y));
      lit_row(cr_.mean.row(y), kSameLight, width, cr_.shown.row(y));
    }
  }
  const auto channel = [](ImageView<const std::uint8_t> plane, const Channel& known, int y) {
    return ChannelRow{plane.row(y), known.mean.row(y), known.deviation.row(y)};
  };
  for (int y = 0; y < height; ++y) {
    range_row({luma_.row(std::max(y - 1, 0)), luma_.row(y), luma_.row(std::min(y + 1, height - 1))}, width,
              range_.data());
    distance_row({.y = channel(picture.y, y_, y),
                  .cb = colour_ ? channel(picture.cb, cb_, y) : ChannelRow{},
                  .cr = colour_ ? channel(picture.cr, cr_, y) : ChannelRow{},
                  .range = range_.data(),
                  .gain = gain_,
                  .noise_floor = config_.noise_floor,
                  .edge_percent = config_.edge_percent},
                 width, out.row(y));
  }
}

void AdaptiveBackground::learn(const Planes& picture, ImageView<const std::uint8_t> mask) noexcept {
  const LearnRates rates{.window = config_.window, .absorb = config_.absorb_frames, .pull = config_.pull};
  const auto channel = [](ImageView<const std::uint8_t> plane, const Channel& known, int y) {
    return LearnRow::Channel{plane.row(y), known.mean.row(y), known.deviation.row(y), known.candidate.row(y)};
  };
  std::uint64_t changed = 0;
  for (int y = 0; y < age_.height; ++y) {
    if (seen_ > 0) std::copy_n(mask.row(y), age_.width, foreground_.row(y));
    LearnRow row{.channels = {channel(picture.y, y_, y)},
                 .count = colour_ ? 3 : 1,
                 .age = age_.row(y),
                 .candidate_age = candidate_age_.row(y),
                 .mask = mask.row(y)};
    if (colour_) {
      row.channels[1] = channel(picture.cb, cb_, y);
      row.channels[2] = channel(picture.cr, cr_, y);
    }
    changed += static_cast<std::uint64_t>(learn_row(row, rates, age_.width));
  }
  ++seen_;
  const auto pixels = static_cast<std::uint64_t>(age_.width) * static_cast<std::uint64_t>(age_.height);
  if (changed * 100 > pixels * static_cast<std::uint64_t>(config_.relearn_percent)) restart();
}

void AdaptiveBackground::restart() noexcept {
  for (int y = 0; y < age_.height; ++y) {
    std::fill_n(age_.row(y), age_.width, std::uint16_t{0});
    std::fill_n(candidate_age_.row(y), age_.width, std::uint16_t{0});
  }
}

}  // namespace stereotrack
