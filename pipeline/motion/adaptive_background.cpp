#include "pipeline/motion/adaptive_background.hpp"

#include <algorithm>

#include "pipeline/motion/distance_kernel.hpp"
#include "pipeline/motion/learn_kernel.hpp"

namespace stereotrack {

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
  self.range_ = arena.array<std::uint8_t>(static_cast<std::size_t>(width));
  const auto samples = [](int size) { return static_cast<std::size_t>((size + kGainStep - 1) / kGainStep); };
  self.bins_ = arena.array<std::uint16_t>(samples(width) * samples(height));
  self.foreground_ = arena.image<std::uint8_t>(width, static_cast<int>(samples(height)));
  if (arena.failed()) return fail(Fault::kOutOfMemory);
  return self;
}

int AdaptiveBackground::estimate_gain(ImageView<const std::uint8_t> y) const noexcept {
  const int columns = (y.width + kGainStep - 1) / kGainStep;
  int count = 0;
  for (int v = 0; v < y.height; v += kGainStep, count += columns) {
    gain_bins(y.row(v), y_.mean.row(v), foreground_.row(v / kGainStep), columns, bins_.data() + count);
  }
  const int total = count_up_to(bins_.data(), count, kGainBins - 1);
  if (total < 64) return 256;
  // The median by halving: the ratio that more than half of the pixels do not exceed. A histogram would be one pass,
  // but not in vectors.
  int low = 0;
  int high = kGainBins - 1;
  while (low < high) {
    const int middle = (low + high) / 2;
    if (count_up_to(bins_.data(), count, middle) > total / 2) {
      high = middle;
    } else {
      low = middle + 1;
    }
  }
  return std::clamp(low, 64, 1023);
}

void AdaptiveBackground::distance(const Planes& picture, ImageView<std::uint8_t> out) noexcept {
  const int width = out.width;
  const int height = out.height;
  if (!started_) {
    for (int y = 0; y < height; ++y) std::fill_n(out.row(y), width, std::uint8_t{0});
    return;
  }
  gain_ = estimate_gain(picture.y);
  const auto channel = [](ImageView<const std::uint8_t> plane, const Channel& known, int y) {
    return ChannelRow{plane.row(y), known.mean.row(y), known.deviation.row(y), known.shown.row(y)};
  };
  // Row by row, so that each is still at hand when its neighbours need it.
  lit_row(y_.mean.row(0), gain_, width, y_.shown.row(0));
  for (int y = 0; y < height; ++y) {
    if (y + 1 < height) lit_row(y_.mean.row(y + 1), gain_, width, y_.shown.row(y + 1));
    range_row({y_.shown.row(std::max(y - 1, 0)), y_.shown.row(y), y_.shown.row(std::min(y + 1, height - 1))}, width,
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
    if (started_ && y % kGainStep == 0) std::copy_n(mask.row(y), age_.width, foreground_.row(y / kGainStep));
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
  started_ = true;
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
