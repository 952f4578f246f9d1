#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "pipeline/core/arena.hpp"
#include "pipeline/core/image_view.hpp"
#include "pipeline/core/result.hpp"
#include "pipeline/core/stage.hpp"
#include "pipeline/effort.hpp"
#include "pipeline/frame.hpp"
#include "pipeline/geometry/lazy_canvas.hpp"
#include "pipeline/geometry/rectify.hpp"
#include "pipeline/memory_use.hpp"
#include "pipeline/motion/mean_background.hpp"
#include "pipeline/motion/umbra_test.hpp"
#include "pipeline/photometry/ingest.hpp"
#include "pipeline/pipeline_config.hpp"
#include "pipeline/shape/contour_fill.hpp"
#include "pipeline/shape/morphology.hpp"
#include "pipeline/shape/sobel.hpp"
#include "pipeline/stereo/background_disparity.hpp"
#include "pipeline/stereo/block_matcher.hpp"
#include "pipeline/stereo/region_matcher.hpp"
#include "pipeline/track/pair_check.hpp"
#include "pipeline/track/track_report.hpp"
#include "pipeline/track/zone_rules.hpp"

namespace stereotrack {

/// The stages as they are timed and shed: each ends where the next begins.
enum class Stage : std::uint8_t { kIngest, kForeground, kDisparity, kShadow, kObjects, kTracking, kBackground };
inline constexpr std::size_t kStages = 7;
[[nodiscard]] constexpr const char* to_string(Stage stage) noexcept {
  constexpr std::array<const char*, kStages> kNames{"ingest",  "foreground", "disparity", "shadow",
                                                    "objects", "tracking",   "background"};
  return kNames[static_cast<std::size_t>(stage)];
}

/// Told when a stage has ended. The pipeline has no clock; who times it, brings one.
struct StageObserver {
  void (*ended)(void* context, Stage stage) noexcept = nullptr;
  void* context = nullptr;
};

/// What is true of a frame beside its targets. Bits.
enum FrameFlag : std::uint32_t {
  kFlagMono = 1,         ///< no second view, or none in this frame: 2-D tracks, depth coasts
  kFlagNoColour = 2,     ///< grey source: the chroma tests did not run
  kFlagLearning = 4,     ///< fewer than background.frames frames seen so far
  kFlagLightChange = 8,  ///< so much changed at once that the background starts anew
  kFlagWrongPair = 16,   ///< what moves tells that the right picture is of another instant: its depths are not used
};

/// What one pair gave. Views live until the pipeline's next run.
struct FrameResult {
  std::uint64_t ordinal = 0;
  CaptureTime capture_time{};
  std::uint32_t flags = 0;                ///< FrameFlag bits
  EffortBits left_out = 0;                ///< efforts that this frame did without
  std::span<const TrackReport> tracks;    ///< in the order of their ids
  ImageView<const std::uint8_t> mask;     ///< final object mask, raw left picture, 0 or 255
  ImageView<const std::uint16_t> labels;  ///< detection of each pixel, 0 = none
  std::span<const Detection> detections;
  RejectionCounts rejections{};     ///< candidates rejected, by Rejection
  std::uint64_t hulls_reduced = 0;  ///< hulls with more vertices than there is room for, since create(): see ConvexHull
};

/// The whole algorithm: pairs in, targets out. A function of its state, the pixels, the capture times and the efforts
/// that it is told to leave out.
/// The order of the stages is that of the document; run() reads like its table of contents.
/// One thread. No allocation, no lock, no I/O after create().
class Pipeline {
 public:
  struct Setup {
    int width = 0;                                   ///< of one raw picture [px]
    int height = 0;                                  ///< [px]
    bool colour = false;                             ///< the source's formats have colour
    const StereoCalibration* calibration = nullptr;  ///< null: mono
    StageObserver observer;
    DecisionObserver decisions = {};  ///< of the detector and the tracker
  };

  /// Faults: those of the stages. The arena must outlive the pipeline.
  [[nodiscard]] static Result<Pipeline> create(const PipelineConfig& config, const Setup& setup, Arena& arena) noexcept;

  /// Pixels are read until Stage::kIngest has ended, and not after. An empty right picture where there are two views (a
  /// camera is gone) makes a frame in mono: new targets have no depth, known ones keep theirs for a while, predicted.
  /// Faults, state untouched: kBadSize, kBadFormat.
  [[nodiscard]] Result<FrameResult> run(const FramePair& pair, EffortBits leave_out = 0) noexcept;

  /// Everything that crosses frames as one block (pipeline/core/state_block.hpp): a pipeline of the same configuration
  /// and set-up that takes it goes on to the byte as this one does. Between runs, when nothing changes it: as a whole,
  ///     save_state(out)                      returns its size; fault, out untouched: kBadSize, out is too small
  /// or, where that would take longer than there is time between two frames, part by part, before the next run:
  ///     copy_state_part(first, out)          writes bytes [first, first + out.size()) of the block, returns how many
  ///                                          there were; fewer than out holds: that was the last
  ///     seal_state(block)                    once all parts are there; any thread
  /// O(bytes): 30 bytes a pixel in colour and stereo with the robust preset, docs/RECORDING.md has the time.
  [[nodiscard]] std::size_t state_bytes() const noexcept;  ///< the most that a block can have
  [[nodiscard]] Result<std::size_t> save_state(std::span<std::byte> out) const noexcept;
  [[nodiscard]] std::size_t copy_state_part(std::size_t first, std::span<std::byte> out) const noexcept;

  /// Fault: kBadState, state untouched (but by a block that was made up together with its checksum).
  [[nodiscard]] Result<void> restore_state(std::span<const std::byte> block) noexcept;

  /// Null for mono.
  [[nodiscard]] const Rectifier* rectifier() const noexcept { return rectifier_ ? &*rectifier_ : nullptr; }

  /// What create() took from the arena; nothing is added later.
  [[nodiscard]] const MemoryUse& memory() const noexcept { return memory_; }

 private:
  /// One view's planes, raw size.
  struct Planes {
    ImageView<std::uint8_t> y;
    ImageView<std::uint8_t> smooth_y;
    ImageView<std::uint8_t> cb;
    ImageView<std::uint8_t> cr;
    ImageView<std::uint8_t> smooth_cb;
    ImageView<std::uint8_t> smooth_cr;
    ImageView<std::uint8_t> distance;
    ImageView<std::uint8_t> mask;
  };

  explicit Pipeline(const PipelineConfig& config, const Setup& setup) noexcept : config_(config), setup_(setup) {}

  template <class Self, class Archive>
  static void visit_state(Self& self, Archive& archive) noexcept;
  [[nodiscard]] std::uint64_t fingerprint() const noexcept;
  [[nodiscard]] Result<void> create_foreground(Arena& arena) noexcept;
  [[nodiscard]] Result<void> create_stereo(Arena& arena) noexcept;
  void ended(Stage stage) const noexcept {
    if (setup_.observer.ended != nullptr) setup_.observer.ended(setup_.observer.context, stage);
  }

  void ingest(const FramePair& pair) noexcept;
  [[nodiscard]] BitMask ignored() const noexcept { return zone_rules_ ? zone_rules_->ignored() : BitMask{}; }
  void clear_ignored(ImageView<std::uint8_t> picture) const noexcept;
  void find_foreground() noexcept;
  void count_no_room(int dropped) noexcept;
  void find_blobs(ImageView<const std::uint8_t> mask) noexcept;
  void foreground_from_edges() noexcept;
  void foreground_from_model() noexcept;
  [[nodiscard]] DisparityMode disparity_mode() const noexcept;
  void find_disparity() noexcept;
  void match_blob(const Blob& blob) noexcept;
  [[nodiscard]] bool is_explained(const Blob& blob) const noexcept;
  void forget_disparity(const Blob& blob) noexcept;
  void reject_background() noexcept;
  [[nodiscard]] bool resembles_background(const Rect& box, std::uint16_t label, int area) noexcept;
  [[nodiscard]] ShadowTest::Input shadow_input() const noexcept;
  void remove_shadows() noexcept;
  void refine_blobs() noexcept;
  void match_whole(Detector::Candidate& candidate, const Detector::Input& in) noexcept;
  [[nodiscard]] bool fits_at(double disparity, const Rect& roi, double cost) noexcept;
  void check_pair(std::span<const Detection> detections) noexcept;
  [[nodiscard]] std::optional<double> disparity_behind(const Rect& box, std::uint16_t label, int area) const noexcept;
  [[nodiscard]] double surface_limit(double disparity, double disparity_sd) const noexcept;
  void confirm_background(std::span<const Detection> detections) noexcept;
  void learn_background(std::span<const Detection> detections) noexcept;
  [[nodiscard]] AdaptiveBackground::Planes left_planes() const noexcept;
  [[nodiscard]] ImageView<const std::uint16_t> disparity_now() const noexcept;
  [[nodiscard]] DisparityRange range_for(const Blob& blob) const noexcept;
  [[nodiscard]] RegionMatch match_region(CanvasPair& pair, LazyCanvas& right_moving, const Rect& roi,
                                         const RegionMatcher::Search& search) noexcept;

  PipelineConfig config_;
  Setup setup_;
  MemoryUse memory_;
  bool started_ = false;
  bool light_change_ = false;
  EffortBits left_out_ = 0;  ///< in this frame
  bool sees_both_ = false;   ///< in this frame: there are two views
  bool wrong_pair_ = false;  ///< in this frame
  int frames_ = 0;           ///< seen, counted to one more than background.frames
  int full_range_ = 0;
  CaptureTime last_time_{};
  double dt_ = 0;  ///< since the frame before [s]
  std::span<const Prediction> predictions_;
  BlobSet blobs_;
  RejectionCounts rejections_{};

  Planes left_;
  Planes right_;
  ImageView<std::uint8_t> scratch_;
  ImageView<std::uint8_t> moving_;          ///< what learn() of the left background is told
  ImageView<std::uint16_t> disparity_;      ///< raw left picture [1/16 px]
  ImageView<std::uint16_t> old_disparity_;  ///< the background's, raw left picture
  ImageView<std::uint8_t> wanted_;          ///< canvas: pixels to be matched
  ImageView<std::uint16_t> canvas_disparity_;
  CanvasPair canvases_;             ///< luma
  CanvasPair background_canvases_;  ///< the backgrounds' luma
  LazyCanvas right_moving_;         ///< right canvas: foreground of the right view

  std::optional<ZoneRules> zone_rules_;  ///< where there are any
  std::optional<Ingest> ingest_;
  Equalise equalise_left_{{}};
  Equalise equalise_right_{{}};
  std::optional<MeanBackground> mean_y_;
  std::optional<MeanBackground> mean_cb_;
  std::optional<MeanBackground> mean_cr_;
  std::optional<AdaptiveBackground> background_left_;
  std::optional<AdaptiveBackground> background_right_;
  std::optional<ForegroundMask> foreground_left_;
  std::optional<ForegroundMask> foreground_right_;
  std::optional<Sobel> sobel_;
  std::optional<ContourFill> contour_fill_;
  std::optional<Opening> opening_;
  std::optional<Closing> closing_;
  std::optional<BlobExtractor> blob_extractor_;
  std::optional<ConvexHull> convex_hull_;
  std::optional<LevelSet> level_set_;
  std::optional<ShadowTest> shadow_test_;
  std::optional<UmbraTest> umbra_test_;
  std::optional<Rectifier> rectifier_;
  std::optional<BlockMatcher> matcher_;
  std::optional<BackgroundDisparity> background_disparity_;
  std::optional<RegionMatcher> region_matcher_;
  std::optional<Detector> detector_;
  PairCheck pair_check_;
  std::optional<Tracker> tracker_;
};
static_assert(RealTimeStage<Pipeline, &Pipeline::run, &Pipeline::save_state, &Pipeline::copy_state_part>);

}  // namespace stereotrack
