#pragma once

#include <cstdint>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "drivers/capture/frame_source.hpp"
#include "drivers/capture/synthetic/scene.hpp"
#include "drivers/capture/synthetic/sensor.hpp"
#include "drivers/capture/synthetic/view.hpp"
#include "pipeline/core/rect.hpp"
#include "pipeline/geometry/calibration.hpp"

namespace stereotrack::capture {

/// A scene that is not there or an option out of range: the user's words, not the machine, are at fault.
class SceneError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

struct SyntheticOptions {
  std::uint64_t seed = 1;
  std::uint64_t frames = 600;  ///< 1 .. 100000
  int width = 640;             ///< 64 .. 4096 [px]
  int height = 480;            ///< 48 .. 3072 [px]
  double fps = 30;             ///< 1 .. 1000
  bool truth = false;          ///< work out ground truth for every pair
};

/// What is true of one moving object in one frame; left picture.
/// Where the scene blurs what moves, a pixel is the object's that shows it for a quarter of the exposure or longer, and
/// all is that of the middle of the exposure else.
struct TrueObject {
  std::uint32_t id = 0;        ///< from 1
  Rect box;                    ///< of the visible pixels [px]
  double x = 0, y = 0, z = 0;  ///< mean of the visible surface, left rectified camera frame [m]
  int visible_px = 0;          ///< pixels of which the object fills the most
  int hidden_px = 0;           ///< pixels it would fill if the other moving objects were not there, but does not
  int whole_px = 0;            ///< pixels of all of it, were nothing in front and the picture endless
  bool undecided = false;      ///< has stood since frame 1 and never moved
  [[nodiscard]] bool scored() const noexcept { return !undecided && 4 * visible_px >= whole_px; }
};

/// Labels are those of changedetection.net. 85, outside of the region of interest, does not occur: all of a
/// picture is known.
struct GroundTruth {
  static constexpr std::uint8_t kStill = 0;
  /// An object's shadow on what stands still: 16 % less light, 8 % in grey.
  static constexpr std::uint8_t kShadow = 50;
  /// An object that has stood since frame 1 and never moved: not scored.
  static constexpr std::uint8_t kUnknown = 170;
  static constexpr std::uint8_t kMoving = 255;  ///< an object that moves, or has moved and stands for a while

  std::vector<TrueObject> objects;       ///< with a visible pixel, by id
  std::vector<std::uint8_t> labels;      ///< width x height, the constants above (those of changedetection.net)
  std::vector<std::uint16_t> disparity;  ///< width x height, [px] x 256, of the left view; 0 = the sky
};

/// `synthetic:NAME`: a scene ray-cast into two cameras. Pictures are functions of (name, seed, size, fps, ordinal)
/// alone, the same bits on every machine. At 640 x 480: 2 to 4 s to open (two threads), 20 to 80 ms a pair, 100 ms
/// where the mast sways or leaves wave, up to 500 ms where something fast is blurred.
///
/// Where the scene says how pictures are delivered, ordinals count frames of which at least one picture came, as a
/// folder of pictures has them, so that capture times have gaps; one without its partner is kSkipped.
class SyntheticSource final : public FrameSource {
 public:
  /// Throws SceneError.
  SyntheticSource(const std::string& name, const SyntheticOptions& options);

  [[nodiscard]] const SourceInfo& info() const noexcept override { return info_; }
  [[nodiscard]] Next next(FramePair& out) noexcept override;
  [[nodiscard]] const std::string& skip_reason() const noexcept override { return skip_reason_; }
  void skip_to(std::uint64_t ordinal) noexcept override { done_ = ordinal; }

  /// True where each picture has a time stamp of its own and may be missing.
  [[nodiscard]] bool delivers() const noexcept { return static_cast<bool>(scene_.delivery); }
  /// How the pictures of the last ordinal came.
  [[nodiscard]] const synthetic::Delivery& delivery() const noexcept { return delivery_; }
  /// The picture of one side (0 left, 1 right) of the last ordinal, kSkipped ones too; empty where it never came.
  [[nodiscard]] Picture picture(int side) const noexcept;

  /// Of the two ideal cameras; unit metres.
  [[nodiscard]] const StereoCalibration& calibration() const noexcept { return calibration_; }
  /// Of the last pair; empty unless asked for in the options.
  [[nodiscard]] const GroundTruth& truth() const noexcept { return truth_; }

 private:
  void call_cast(double t_s);
  void pose_cast(double t_s);
  [[nodiscard]] int exposures(double t_s);
  void draw(std::uint64_t frame, bool left, bool right);
  void cover();
  void work_out_truth();

  SyntheticOptions options_;
  SourceInfo info_;
  std::string skip_reason_;
  StereoCalibration calibration_;
  synthetic::Scene scene_;
  std::vector<synthetic::View> views_;  ///< left, right
  std::vector<synthetic::Sensor> sensors_;
  std::vector<std::vector<std::uint8_t>> pixels_;

  std::uint64_t done_ = 0;             ///< last ordinal handed out
  std::vector<std::uint64_t> frames_;  ///< of each ordinal, where the scene says how they come; empty: the same
  synthetic::Delivery delivery_;
  std::vector<synthetic::Actor> cast_;
  std::int64_t act_ = -1;  ///< whose cast it is
  std::vector<synthetic::PosedActor> posed_;
  std::size_t posed_count_ = 0;
  synthetic::PosedFoliage foliage_;
  GroundTruth truth_;
  std::vector<std::uint8_t> stamp_;

  /// While the shutter is open: whom a pixel shows the most (an id, 0 nobody), how often, and the sum of 1 / depth.
  struct Cover {
    std::uint32_t id = 0;
    int count = 0;
    double inverse_depth = 0;
  };
  std::vector<Cover> covers_;
  int exposures_ = 1;  ///< of the last left picture
};

/// NAME of `synthetic:NAME`.
[[nodiscard]] std::unique_ptr<SyntheticSource> open_synthetic(const std::string& name,
                                                              const SyntheticOptions& options = {});

}  // namespace stereotrack::capture
