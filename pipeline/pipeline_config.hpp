#pragma once

#include <cstdint>

#include "pipeline/motion/adaptive_background.hpp"
#include "pipeline/motion/foreground_mask.hpp"
#include "pipeline/motion/shadow_test.hpp"
#include "pipeline/photometry/equalise.hpp"
#include "pipeline/shape/level_set.hpp"
#include "pipeline/stereo/block_matcher.hpp"
#include "pipeline/track/detector.hpp"
#include "pipeline/track/features.hpp"
#include "pipeline/track/tracker.hpp"
#include "pipeline/track/zone_rules.hpp"

namespace stereotrack {

enum class ForegroundMethod : std::uint8_t {
  kEdges,     ///< the document's: mean background, difference, Sobel, threshold, filled contours, opening
  kAdaptive,  ///< adaptive background with noise, light and edges accounted for
};

enum class ShadowMethod : std::uint8_t {
  kOff,
  kChroma,  ///< the document's sigma test of Cb and Cr, alone
  kStereo,  ///< disparity of the background first, then appearance
};

enum class DisparityMode : std::uint8_t {
  kRegions,  ///< only where something moves
  kDense,    ///< the whole picture
};

struct BackgroundConfig {
  ForegroundMethod method = ForegroundMethod::kAdaptive;
  int frames = 30;  ///< K of (3.7); also the frames over which `learning` is reported, 1..10000
  AdaptiveBackground::Config adaptive;
};

struct ShapeConfig {
  int edge_threshold = 60;  ///< (3.12) on the Sobel magnitude of the difference [grey levels], 1..255
  int opening = 1;          ///< 3x3 openings, 0..10
  int closing = 1;          ///< 3x3 closings, 0..10
  int hole_px = 3000;       ///< holes up to this area are filled, 0..10^6 [px]; kEdges fills all
  int max_blobs = 128;      ///< 1..1024
  int min_blob_px = 20;     ///< smaller blobs are not looked at, 1..10^6 [px]
  bool level_set = false;   ///< refine each blob's region by the level set
  LevelSet::Config level_set_config;
};

struct DisparityConfig {
  MatchMethod method = MatchMethod::kCensus;
  DisparityMode mode = DisparityMode::kRegions;
  int max = 128;       ///< largest disparity of the dense map [px], 1..4000
  int block = 9;       ///< odd, 3..21 [px]
  double reach = 0.7;  ///< largest disparity of a moving region, as a fraction of the width, 0.05..1
  int small_px = 600;  ///< objects up to this area are matched as a whole, 0..10^6 [px]
};

struct ShadowConfig {
  ShadowMethod method = ShadowMethod::kStereo;
  ShadowTest::Config test;
  bool deep = true;           ///< with one view alone: UmbraTest at an object's foot
  double own_depth_px = 1.0;  ///< a region this near to the background's own disparity is none, 0..16 [px]
};

/// What every stage is told. The defaults are the robust preset.
struct PipelineConfig {
  EqualiseMode equalise = EqualiseMode::kOff;
  BackgroundConfig background;
  ForegroundMask::Config foreground;
  ShapeConfig shape;
  DisparityConfig disparity;
  ShadowConfig shadow;
  Detector::Config objects;
  ZoneRules::Config zones;
  Features::Config features;
  Tracker::Config track;
};

}  // namespace stereotrack
