#pragma once

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "drivers/capture/film/film.hpp"
#include "tests/support/moving_scene.hpp"

namespace stereotrack::test {

/// MovingScene as a source, so many pairs from `first` on; those in `missing` cannot be read.
class SceneSource final : public capture::FrameSource {
 public:
  SceneSource(int first, int pairs, std::chrono::nanoseconds period, std::vector<int> missing = {})
      : scene_(kSceneFormats[0]), first_(first), pairs_(pairs), missing_(std::move(missing)) {
    info_.name = "moving scene";
    info_.width = MovingScene::kWidth;
    info_.height = MovingScene::kHeight;
    info_.format = PixelFormat::kBgr8;
    info_.period = period;
  }
  [[nodiscard]] const capture::SourceInfo& info() const noexcept override { return info_; }
  [[nodiscard]] capture::Next next(FramePair& out) noexcept override {
    if (done_ == pairs_) return capture::Next::kEnd;
    out = scene_.pair(first_ + done_, true);
    out.ordinal = static_cast<std::uint64_t>(++done_);
    out.capture_time = CaptureTime(info_.period * done_);
    const bool is_missing = std::find(missing_.begin(), missing_.end(), done_) != missing_.end();
    return is_missing ? capture::Next::kSkipped : capture::Next::kPair;
  }
  [[nodiscard]] const std::string& skip_reason() const noexcept override { return info_.name; }
  void skip_to(std::uint64_t) noexcept override {}

 private:
  MovingScene scene_;
  capture::SourceInfo info_;
  int first_;
  int pairs_;
  std::vector<int> missing_;
  int done_ = 0;
};

[[nodiscard]] inline std::unique_ptr<capture::Film> film_of_scene(
    int first, int pairs, std::chrono::nanoseconds period, capture::Film::Repeat repeat = capture::Film::Repeat::kOnce,
    std::vector<int> missing = {}) {
  SceneSource source(first, pairs, period, std::move(missing));
  return std::make_unique<capture::Film>(source, capture::Film::Config{.repeat = repeat});
}

}  // namespace stereotrack::test
