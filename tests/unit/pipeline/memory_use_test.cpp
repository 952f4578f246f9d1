#include "pipeline/memory_use.hpp"

#include <gtest/gtest.h>

#include <initializer_list>
#include <set>
#include <string>
#include <vector>

#include "config/load.hpp"
#include "pipeline/pipeline.hpp"

namespace stereotrack {
namespace {

constexpr int kWidth = 96;
constexpr int kHeight = 64;

TEST(MemoryUse, EachChargeIsWhatTheArenaGaveSinceTheOneBefore) {
  Arena arena;
  (void)arena.array<std::uint8_t>(1000);  // somebody else's
  MemoryUse use(arena);
  EXPECT_EQ(use.total(), 0U);
  (void)arena.array<std::uint8_t>(10);
  (void)arena.array<std::uint8_t>(7);
  use.charge(MemoryPart::kPlanes, arena);
  (void)arena.array<std::uint8_t>(5);
  use.charge(MemoryPart::kTracker, arena);
  use.charge(MemoryPart::kShadow, arena);
  (void)arena.array<std::uint8_t>(1);
  use.charge(MemoryPart::kPlanes, arena);
  EXPECT_EQ(use.bytes(MemoryPart::kPlanes), 18U);
  EXPECT_EQ(use.bytes(MemoryPart::kTracker), 5U);
  EXPECT_EQ(use.bytes(MemoryPart::kShadow), 0U);
  EXPECT_EQ(use.total(), 23U);
}

TEST(MemoryUse, PartsHaveNamesOfTheirOwn) {
  std::set<std::string> names;
  for (std::size_t i = 0; i < kMemoryParts; ++i) names.insert(to_string(static_cast<MemoryPart>(i)));
  EXPECT_EQ(names.size(), kMemoryParts);
  EXPECT_STREQ(to_string(MemoryPart::kTracker), "tracker");
}

StereoCalibration rig() {
  StereoCalibration calibration;
  for (CameraModel* camera : {&calibration.left, &calibration.right}) {
    camera->width = kWidth;
    camera->height = kHeight;
    camera->fx = camera->fy = 90;
    camera->cx = (kWidth - 1) / 2.0;
    camera->cy = (kHeight - 1) / 2.0;
  }
  calibration.t_right_left = {-0.2, 0, 0};
  return calibration;
}

struct Made {
  MemoryUse use;
  std::size_t arena_bytes = 0;
};

Made make(const std::string& preset, bool colour, bool stereo) {
  const StereoCalibration calibration = rig();
  Pipeline::Setup setup;
  setup.width = kWidth;
  setup.height = kHeight;
  setup.colour = colour;
  setup.calibration = stereo ? &calibration : nullptr;
  const std::vector<config::Layer> layers{config::override_layer("preset=" + preset)};
  Arena arena;
  const Result<Pipeline> pipeline = Pipeline::create(config::load(layers).configuration.pipeline, setup, arena);
  EXPECT_TRUE(pipeline.has_value());
  return {pipeline.has_value() ? pipeline->memory() : MemoryUse(), arena.bytes_used()};
}

std::size_t sum_of(const MemoryUse& use) {
  std::size_t sum = 0;
  for (std::size_t i = 0; i < kMemoryParts; ++i) sum += use.bytes(static_cast<MemoryPart>(i));
  return sum;
}

TEST(PipelineMemory, PartsAddUpToWhatTheArenaGave) {
  for (const char* preset : {"robust", "thesis"}) {
    for (const bool colour : {false, true}) {
      for (const bool stereo : {false, true}) {
        SCOPED_TRACE(std::string(preset) + (colour ? " colour" : " grey") + (stereo ? " stereo" : " mono"));
        const Made made = make(preset, colour, stereo);
        EXPECT_GT(made.arena_bytes, 0U);
        EXPECT_EQ(sum_of(made.use), made.arena_bytes);
        EXPECT_EQ(made.use.total(), made.arena_bytes);
      }
    }
  }
}

TEST(PipelineMemory, EachPartIsThereWhereItsStageIsAndNowhereElse) {
  const std::initializer_list<MemoryPart> of_stereo{MemoryPart::kRectifier, MemoryPart::kMatcher, MemoryPart::kRegions,
                                                    MemoryPart::kCanvases, MemoryPart::kDisparity};
  for (const char* preset : {"robust", "thesis"}) {
    for (const bool stereo : {false, true}) {
      SCOPED_TRACE(std::string(preset) + (stereo ? " stereo" : " mono"));
      const MemoryUse use = make(preset, true, stereo).use;
      for (const MemoryPart part : of_stereo) EXPECT_EQ(use.bytes(part) > 0, stereo) << to_string(part);
      for (const MemoryPart part : {MemoryPart::kPlanes, MemoryPart::kBackground, MemoryPart::kShapes,
                                    MemoryPart::kShadow, MemoryPart::kDetector, MemoryPart::kTracker}) {
        EXPECT_GT(use.bytes(part), 0U) << to_string(part);
      }
      const bool is_thesis = std::string(preset) == "thesis";
      EXPECT_EQ(use.bytes(MemoryPart::kLevelSet) > 0, is_thesis);
      // The edges of the document are found without memory of their own.
      EXPECT_EQ(use.bytes(MemoryPart::kForeground) > 0, !is_thesis);
    }
  }
}

TEST(PipelineMemory, PlanesAreWorkedByHand) {
  // A row of 96 bytes takes two lines of 64 and one of padding: 192; a plane 192 x 64 = 12288. Grey and mono:
  // luma, smoothed, distance, mask; scratch, moving. And three lines of a mosaic, each with a margin of 64: 3 x 256.
  EXPECT_EQ(make("robust", false, false).use.bytes(MemoryPart::kPlanes), 6U * 12288 + 768);
  // Colour: four planes more of the left view. Stereo: four of the right one, which is never looked at in colour.
  EXPECT_EQ(make("robust", true, true).use.bytes(MemoryPart::kPlanes), 14U * 12288 + 768);
}

}  // namespace
}  // namespace stereotrack
