// Prints what the pipeline makes of the moving scene, in each of its ways to run: a line a case, a hash of everything
// that leaves Pipeline::run. Compiled twice, against the pipeline that ships and against one without vectors.
//     pipeline_hash targets    the instruction sets of this build on this machine
//     pipeline_hash TARGET     the hashes with one of them
#include <cstdint>
#include <cstdio>
#include <exception>
#include <stdexcept>
#include <string>
#include <type_traits>

#include "pipeline/core/arena.hpp"
#include "pipeline/core/simd.hpp"
#include "pipeline/pipeline.hpp"
#include "tests/support/moving_scene.hpp"
#include "tests/support/scene_cases.hpp"

namespace stereotrack::test {
namespace {

// FNV-1a, 64 bit.
class Hash {
 public:
  void add(const void* data, std::size_t bytes) {
    const auto* first = static_cast<const unsigned char*>(data);
    for (std::size_t i = 0; i < bytes; ++i) value_ = (value_ ^ first[i]) * 0x100000001B3U;
  }
  template <class T>
  void add(const T& value) {
    static_assert(std::is_arithmetic_v<T> || std::is_enum_v<T>);
    add(&value, sizeof value);
  }
  void add(const Rect& box) {
    for (const int side : {box.left, box.top, box.width, box.height}) add(side);
  }
  template <class T>
  void add(const ImageView<T>& picture) {
    for (int y = 0; y < picture.height; ++y) add(picture.row(y), sizeof(T) * static_cast<std::size_t>(picture.width));
  }
  [[nodiscard]] std::uint64_t value() const { return value_; }

 private:
  std::uint64_t value_ = 0xCBF29CE484222325U;
};

void add(Hash& hash, const TrackReport& track) {
  hash.add(track.id);
  hash.add(track.state);
  hash.add(track.measured);
  hash.add(track.has_depth);
  hash.add(track.box);
  for (const Point& corner : track.hull) {
    hash.add(corner.x);
    hash.add(corner.y);
  }
  for (const double value :
       {track.image_x, track.image_y, track.image_vx, track.image_vy, track.confidence, track.age_s})
    hash.add(value);
  for (int i = 0; i < 3; ++i) {
    hash.add(track.position[i]);
    hash.add(track.velocity[i]);
  }
  for (int i = 0; i < 36; ++i) hash.add(track.covariance(i / 6, i % 6));
}

void run(const SceneCase& one) {
  MovingScene scene(*one.format);
  const StereoCalibration calibration = MovingScene::calibration();
  Pipeline::Setup setup;
  setup.width = MovingScene::kWidth;
  setup.height = MovingScene::kHeight;
  setup.colour = one.format->colour;
  setup.calibration = one.stereo() ? &calibration : nullptr;
  Arena arena;
  Result<Pipeline> pipeline = Pipeline::create(scene_config(one), setup, arena);
  if (!pipeline.has_value()) throw std::runtime_error(to_string(pipeline.error()));
  Hash hash;
  std::uint64_t reports = 0;
  // Each part of the scene where something begins or ends.
  constexpr int kParts[][2] = {{1, 70}, {298, 306}, {358, 364}, {396, 430}, {696, 708}, {748, 765}};
  for (const auto& part : kParts) {
    for (int ordinal = part[0]; ordinal <= part[1]; ++ordinal) {
      const Result<FrameResult> result = pipeline->run(scene.pair(ordinal, one.stereo()));
      if (!result.has_value()) throw std::runtime_error(to_string(result.error()));
      hash.add(result->flags);
      hash.add(result->mask);
      hash.add(result->labels);
      for (const std::uint32_t count : result->rejections) hash.add(count);
      for (const TrackReport& track : result->tracks) add(hash, track);
      reports += result->tracks.size();
    }
  }
  (void)std::printf("%s %016llx of %llu reports\n", one.name().c_str(), static_cast<unsigned long long>(hash.value()),
                    static_cast<unsigned long long>(reports));
}

int main_of(const std::string& what) {
  if (what == "targets") {
    for (const SimdTarget target : simd_targets()) (void)std::printf("%s\n", to_string(target));
    return 0;
  }
  for (const SimdTarget target : simd_targets()) {
    if (what != to_string(target) || !use_simd(target)) continue;
    for (const SceneCase& one : scene_cases()) run(one);
    return 0;
  }
  (void)std::fprintf(stderr, "pipeline_hash: no instruction set %s here\n", what.c_str());
  return 2;
}

}  // namespace
}  // namespace stereotrack::test

int main(int argc, char** argv) {
  try {
    return stereotrack::test::main_of(argc == 2 ? argv[1] : "");
  } catch (const std::exception& error) {
    (void)std::fprintf(stderr, "pipeline_hash: %s\n", error.what());
    return 1;
  }
}
