#pragma once

#include <cstdint>
#include <span>

#include "pipeline/core/arena.hpp"
#include "pipeline/core/image_view.hpp"
#include "pipeline/core/result.hpp"
#include "pipeline/core/stage.hpp"

namespace stereotrack {

/// Still background as the mean of the first K pictures.
///     g(x, y) = 1/K sum of g_i(x, y), i = 1..K                            (3.7)
/// Until K pictures were seen the mean is over those seen, so that detection can start with the second.
/// After K it is frozen. One instance a plane and thread. O(pixels) a picture while learning, then O(1).
class MeanBackground {
 public:
  /// frames: K, 1..65535. Faults: kBadConfig, kBadSize, kOutOfMemory.
  [[nodiscard]] static Result<MeanBackground> create(int frames, int width, int height, Arena& arena) noexcept {
    if (frames < 1 || frames > 65535) return fail(Fault::kBadConfig);
    if (width < 1 || height < 1) return fail(Fault::kBadSize);
    MeanBackground self;
    self.frames_ = frames;
    self.sum_ = arena.image<std::int32_t>(width, height);
    self.mean_ = arena.image<std::uint8_t>(width, height);
    if (arena.failed()) return fail(Fault::kOutOfMemory);
    return self;
  }

  /// Adds one picture of the size of create(). Beyond K pictures nothing happens.
  void learn(ImageView<const std::uint8_t> picture) noexcept {
    if (seen_ >= frames_) return;
    ++seen_;
    // In floats, which compilers divide several at a time. Exact: numerator and divisor are below 2^24, and a quotient
    // under a whole number is so by 1/n > 2^-16 at least, where a float up to 256 is rounded by at most 2^-17.
    const auto n = static_cast<float>(seen_);
    const std::int32_t half = seen_ / 2;
    const int width = mean_.width;  // bytes may alias members, locals not: without this nothing is vectorised
    for (int y = 0; y < mean_.height; ++y) {
      const std::uint8_t* in = picture.row(y);
      std::int32_t* sum = sum_.row(y);
      std::uint8_t* mean = mean_.row(y);
      for (int x = 0; x < width; ++x) {
        sum[x] += in[x];
        mean[x] = static_cast<std::uint8_t>(static_cast<int>(static_cast<float>(sum[x] + half) / n));
      }
    }
  }

  /// The mean, rounded half up; all 0 before the first picture.
  [[nodiscard]] ImageView<const std::uint8_t> mean() const noexcept { return mean_; }
  [[nodiscard]] int seen() const noexcept { return seen_; }
  [[nodiscard]] bool complete() const noexcept { return seen_ >= frames_; }

  /// What crosses frames: pipeline/core/state.hpp.
  template <class Self, class Archive>
  static void visit_state(Self& self, Archive& archive) noexcept {
    archive.bounded(self.seen_, 0, self.frames_);
    archive(self.sum_, self.mean_);
  }

 private:
  int frames_ = 0;
  int seen_ = 0;
  ImageView<std::int32_t> sum_;
  ImageView<std::uint8_t> mean_;
};
static_assert(RealTimeStage<MeanBackground, &MeanBackground::learn>);

}  // namespace stereotrack
