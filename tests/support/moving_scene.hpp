#pragma once

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdint>
#include <cstdlib>
#include <string>
#include <vector>

#include "pipeline/core/rect.hpp"
#include "pipeline/frame.hpp"
#include "pipeline/geometry/calibration.hpp"
#include "tests/support/pixel_layouts.hpp"

namespace stereotrack::test {

/// A layout of pixels that the pipeline reads, and how BGR pixels are laid out so.
struct SceneFormat {
  const char* name;
  PixelFormat format;
  bool colour;
  void (*pack)(const std::vector<std::uint8_t>& bgr, int width, int height, std::vector<std::uint8_t>& out);
};

template <PixelFormat kFormat>
void pack_as(const std::vector<std::uint8_t>& bgr, int width, int height, std::vector<std::uint8_t>& out) {
  lay_out({bgr.data(), width, height, std::ptrdiff_t{width} * 3, PixelFormat::kBgr8}, kFormat,
          static_cast<std::ptrdiff_t>(row_bytes(kFormat, width)), out);
}

/// Every format of pipeline/frame.hpp. A new one needs a line here and nothing else.
inline constexpr std::array<SceneFormat, 5> kSceneFormats{
    {{"bgr8", PixelFormat::kBgr8, true,
      [](const std::vector<std::uint8_t>& bgr, int, int, std::vector<std::uint8_t>& out) { out = bgr; }},
     {"grey8", PixelFormat::kGrey8, false,
      [](const std::vector<std::uint8_t>& bgr, int width, int height, std::vector<std::uint8_t>& out) {
        out.resize(static_cast<std::size_t>(width) * height);
        for (std::size_t i = 0; i < out.size(); ++i) {
          out[i] = static_cast<std::uint8_t>((bgr[3 * i] + 2 * bgr[3 * i + 1] + bgr[3 * i + 2] + 2) / 4);
        }
      }},
     {"yuyv", PixelFormat::kYuyv, true, pack_as<PixelFormat::kYuyv>},
     {"uyvy", PixelFormat::kUyvy, true, pack_as<PixelFormat::kUyvy>},
     {"nv12", PixelFormat::kNv12, true, pack_as<PixelFormat::kNv12>}}};

/// Textured boards before a textured wall, 160 x 120 px, two ideal cameras: integer shifts of noise, microseconds a
/// pair. From frame 41 on one board goes to and fro, stops (frame 301), leaves (361); from 401 three boards cross each
/// other in three depths, one of them large; at 701 the light drops by a third and the wall is another at once, black
/// and white squares; from 751 two boards again.
class MovingScene {
 public:
  static constexpr int kWidth = 160;
  static constexpr int kHeight = 120;
  static constexpr int kFrames = 1000;

  explicit MovingScene(const SceneFormat& format) : format_(format) {
    wall_ = texture(kWidth + 16, kHeight, 40, 130, 1);
    later_wall_ = texture(kWidth + 16, kHeight, 0, 30, 3);
    for (std::size_t i = 0; i < later_wall_.bgr.size(); ++i) {
      const std::size_t pixel = i / 3;
      const bool bright = (pixel % later_wall_.width / 20 + pixel / later_wall_.width / 20) % 2 == 0;
      if (bright) later_wall_.bgr[i] = static_cast<std::uint8_t>(later_wall_.bgr[i] + 220);
    }
    board_ = texture(80, 80, 120, 250, 2);
  }

  [[nodiscard]] static StereoCalibration calibration() {
    StereoCalibration rig;
    for (CameraModel* camera : {&rig.left, &rig.right}) {
      camera->fx = camera->fy = 150;
      camera->cx = (kWidth - 1) / 2.0;
      camera->cy = (kHeight - 1) / 2.0;
      camera->width = kWidth;
      camera->height = kHeight;
    }
    rig.t_right_left = {-0.2, 0, 0};
    return rig;
  }

  /// The pair of `ordinal`, from 1; valid until the next call.
  [[nodiscard]] FramePair pair(int ordinal, bool stereo) {
    FramePair pair;
    pair.ordinal = static_cast<std::uint64_t>(ordinal);
    pair.capture_time = CaptureTime(std::chrono::nanoseconds(std::int64_t{33'333'333} * ordinal));
    paint(ordinal, false);
    pair.left = packed(left_);
    if (stereo) {
      paint(ordinal, true);
      pair.right = packed(right_);
    }
    return pair;
  }

 private:
  struct Texture {
    int width = 0;
    std::vector<std::uint8_t> bgr;
  };

  // Noise of a linear congruential generator, smoothed along rows so that block matching has sub-pixel slopes.
  static Texture texture(int width, int height, int low, int high, std::uint32_t seed) {
    Texture made{width, std::vector<std::uint8_t>(static_cast<std::size_t>(width) * height * 3)};
    std::uint32_t state = seed;
    for (std::uint8_t& value : made.bgr) {
      state = state * 1664525U + 1013904223U;
      value = static_cast<std::uint8_t>(low + static_cast<int>((state >> 16) % static_cast<std::uint32_t>(high - low)));
    }
    for (std::size_t i = 3; i < made.bgr.size(); ++i) {
      made.bgr[i] = static_cast<std::uint8_t>((made.bgr[i] + made.bgr[i - 3] + 1) / 2);
    }
    return made;
  }

  // 0, step, 2 step, ..., reach, ..., 0, ...
  static int to_and_fro(int time, int step, int reach) {
    const int phase = time * step % (2 * reach);
    return phase <= reach ? phase : 2 * reach - phase;
  }

  void paint(int ordinal, bool right) {
    canvas_.resize(static_cast<std::size_t>(kWidth) * kHeight * 3);
    const Texture& wall = ordinal > 700 ? later_wall_ : wall_;
    for (int y = 0; y < kHeight; ++y) {
      const std::size_t from = (static_cast<std::size_t>(y) * wall.width + (right ? 3 : 0)) * 3;
      std::copy_n(wall.bgr.begin() + static_cast<std::ptrdiff_t>(from), kWidth * 3,
                  canvas_.begin() + std::ptrdiff_t{y} * kWidth * 3);
    }
    const auto board = [&](Rect place, int disparity) { put(place, right ? disparity : 0); };
    if (ordinal > 40 && ordinal <= 360) board({to_and_fro(std::min(ordinal, 301) - 41, 3, 130), 40, 30, 30}, 12);
    if (ordinal > 400 && ordinal <= 700) {
      board({to_and_fro(ordinal - 401, 1, 110), 20, 44, 60}, 8);
      board({125 - to_and_fro(ordinal - 401, 2, 120), 50, 24, 36}, 13);
      board({20 + to_and_fro(ordinal - 401, 3, 110), 70, 18, 40}, 19);
    }
    if (ordinal > 750) {
      board({to_and_fro(ordinal - 751, 2, 126), 10, 32, 32}, 10);
      board({128 - to_and_fro(ordinal - 751, 2, 126), 70, 28, 40}, 15);
    }
    if (ordinal > 700) {
      for (std::uint8_t& value : canvas_) value = static_cast<std::uint8_t>(value * 2 / 3);
    }
    // Noise of a sensor: one level, another in each frame.
    std::uint32_t state = static_cast<std::uint32_t>(ordinal) * 2U + (right ? 1U : 0U);
    for (std::uint8_t& value : canvas_) {
      state = state * 1664525U + 1013904223U;
      value = static_cast<std::uint8_t>(value + ((state >> 28) & 1U));
    }
    format_.pack(canvas_, kWidth, kHeight, right ? right_ : left_);
  }

  void put(const Rect& place, int disparity) {
    for (int y = 0; y < place.height; ++y) {
      for (int x = 0; x < place.width; ++x) {
        const int u = place.left + x - disparity;
        if (u < 0 || u >= kWidth || place.top + y >= kHeight) continue;
        const auto* from = &board_.bgr[(static_cast<std::size_t>(y) * board_.width + x) * 3];
        std::copy_n(from, 3, &canvas_[(static_cast<std::size_t>(place.top + y) * kWidth + u) * 3]);
      }
    }
  }

  [[nodiscard]] Picture packed(const std::vector<std::uint8_t>& pixels) const {
    const auto stride = static_cast<std::ptrdiff_t>(row_bytes(format_.format, kWidth));
    return {pixels.data(), kWidth, kHeight, stride, format_.format};
  }

  const SceneFormat& format_;
  Texture wall_;
  Texture later_wall_;
  Texture board_;
  std::vector<std::uint8_t> canvas_;
  std::vector<std::uint8_t> left_;
  std::vector<std::uint8_t> right_;
};

}  // namespace stereotrack::test
