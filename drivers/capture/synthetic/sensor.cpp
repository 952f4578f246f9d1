#include "drivers/capture/synthetic/sensor.hpp"

#include <algorithm>
#include <cmath>

#include "drivers/capture/synthetic/random.hpp"

namespace stereotrack::capture::synthetic {
namespace {

constexpr int kLevelShift = 7;                                    // levels are worked with x 128
constexpr std::int32_t kChannelSigma = (19 << kLevelShift) / 10;  // 1.9 levels

/// x^(29/64), 29/64 = 1/4 + 1/8 + 1/16 + 1/64.
double curve(double x) noexcept {
  const double r2 = std::sqrt(std::sqrt(x));
  const double r3 = std::sqrt(r2);
  const double r4 = std::sqrt(r3);
  return r2 * r3 * r4 * std::sqrt(std::sqrt(r4));
}

}  // namespace

Sensor::Sensor(const Config& config) : config_(config) {
  curve_.resize(kCurveSize);
  for (int i = 0; i < kCurveSize; ++i) {
    const double level = 255.0 * curve((i + 0.5) / kCurveSize);
    curve_[static_cast<std::size_t>(i)] = static_cast<std::uint16_t>(level * (1 << kLevelShift) + 0.5);
  }
  for (int level = 0; level < 256; ++level) {
    luma_sigma_[static_cast<std::size_t>(level)] =
        static_cast<std::int32_t>(std::sqrt(2.9 * 2.9 + 0.022 * level) * config.noise * (1 << kLevelShift) + 0.5);
  }
  channel_sigma_ = static_cast<std::int32_t>(kChannelSigma * config.noise);
  const double half_diagonal2 =
      0.25 * (static_cast<double>(config.width) * config.width + static_cast<double>(config.height) * config.height);
  column_fall_off_.resize(static_cast<std::size_t>(config.width));
  for (int x = 0; x < config.width; ++x) {
    const double dx = x - 0.5 * (config.width - 1);
    column_fall_off_[static_cast<std::size_t>(x)] = static_cast<float>(config.vignetting * dx * dx / half_diagonal2);
  }
}

void Sensor::expose(const float* light, int y, std::uint64_t frame, std::uint8_t* bgr, double exposure) const noexcept {
  const auto& normal = normal_quantiles();
  const double half_diagonal2 = 0.25 * (static_cast<double>(config_.width) * config_.width +
                                        static_cast<double>(config_.height) * config_.height);
  const double dy = y - 0.5 * (config_.height - 1);
  const auto row_fall_off = static_cast<float>(1.0 - config_.vignetting * dy * dy / half_diagonal2);
  const float gain[3] = {static_cast<float>(config_.gain.x * exposure * kCurveSize),
                         static_cast<float>(config_.gain.y * exposure * kCurveSize),
                         static_cast<float>(config_.gain.z * exposure * kCurveSize)};
  const std::uint64_t key = mix_bits(mix_bits(config_.seed * 2 + static_cast<std::uint64_t>(config_.camera)) + frame);
  std::uint64_t counter = key + static_cast<std::uint64_t>(y) * static_cast<std::uint64_t>(config_.width);
  constexpr std::uint64_t kMask = (1U << kNormalBits) - 1;
  for (int x = 0; x < config_.width; ++x) {
    const float fall_off = row_fall_off - column_fall_off_[static_cast<std::size_t>(x)];
    std::int32_t level[3];
    for (int c = 0; c < 3; ++c) {
      const auto index = static_cast<std::int32_t>(light[3 * x + c] * fall_off * gain[c]);
      level[c] = curve_[static_cast<std::size_t>(std::clamp(index, 0, kCurveSize - 1))];
    }
    const std::int32_t luma = (level[0] + 2 * level[1] + level[2]) >> (2 + kLevelShift);
    const std::uint64_t bits = mix_bits(counter++);
    const std::int32_t common =
        luma_sigma_[static_cast<std::size_t>(luma)] * normal[static_cast<std::size_t>(bits & kMask)];
    for (int c = 0; c < 3; ++c) {
      const std::int32_t own = channel_sigma_ * normal[static_cast<std::size_t>((bits >> (16 * (c + 1))) & kMask)];
      // Sigma x 128 times quantile x 4096.
      const std::int32_t value = (level[c] + ((common + own) >> 12) + (1 << (kLevelShift - 1))) >> kLevelShift;
      bgr[3 * x + 2 - c] = static_cast<std::uint8_t>(std::clamp(value, 0, 255));
    }
  }
}

}  // namespace stereotrack::capture::synthetic
