#include <algorithm>
#include <map>
#include <memory>
#include <span>
#include <stdexcept>

#include "drivers/capture/synthetic/synthetic_source.hpp"
#include "firmware-app/runtime/large_pages.hpp"
#include "pipeline/pipeline.hpp"
#include "tests/bench/cases.hpp"
#include "tests/bench/moving_boxes.hpp"
#include "tests/bench/opencv_pipeline.hpp"
#include "tests/bench/settings.hpp"

namespace stereotrack::bench {

namespace {

std::vector<std::string> stage_names() {
  std::vector<std::string> names;
  for (std::size_t i = 0; i < kStages; ++i) names.emplace_back(to_string(static_cast<Stage>(i)));
  return names;
}

std::vector<std::string> call_names() {
  std::vector<std::string> names;
  for (std::size_t i = 0; i < kCvSteps; ++i) names.emplace_back(to_string(static_cast<CvStep>(i)));
  return names;
}

// Which of our stages does what this call of theirs does.
Stage stage_of(CvStep step) noexcept {
  switch (step) {
    case CvStep::kColour:
    case CvStep::kEqualise:
    case CvStep::kRectify: return Stage::kIngest;
    case CvStep::kBackground:
    case CvStep::kEdges:
    case CvStep::kContours:
    case CvStep::kOpening: return Stage::kForeground;
    case CvStep::kLevelSet:
    case CvStep::kMatching: return Stage::kDisparity;
    case CvStep::kChromaTest: return Stage::kShadow;
    case CvStep::kDepth: return Stage::kObjects;
    case CvStep::kTracking: break;
  }
  return Stage::kTracking;
}

cv::Mat camera_matrix(const CameraModel& camera) {
  return (cv::Mat_<double>(3, 3) << camera.fx, 0, camera.cx, 0, camera.fy, camera.cy, 0, 0, 1);
}

OpenCvPipeline::Rig to_opencv(const StereoCalibration& calibration, cv::Size size) {
  OpenCvPipeline::Rig rig;
  rig.size = size;
  rig.K1 = camera_matrix(calibration.left);
  rig.K2 = camera_matrix(calibration.right);
  rig.D1 =
      cv::Mat(std::vector<double>(calibration.left.distortion.begin(), calibration.left.distortion.begin() + 5), true);
  rig.D2 = cv::Mat(std::vector<double>(calibration.right.distortion.begin(), calibration.right.distortion.begin() + 5),
                   true);
  rig.R.create(3, 3, CV_64F);
  rig.T.create(3, 1, CV_64F);
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) rig.R.at<double>(i, j) = calibration.R_right_left(i, j);
    rig.T.at<double>(i) = calibration.t_right_left(i);
  }
  return rig;
}

cv::Mat to_opencv(const Picture& picture) {
  // OpenCV's Mat takes no const memory; it is only read.
  return {picture.height, picture.width, CV_8UC3, const_cast<std::uint8_t*>(picture.data),
          static_cast<std::size_t>(picture.stride_bytes)};
}

// Our pipeline with its memory and clock.
class Ours {
 public:
  Ours(const PipelineConfig& config, const capture::SourceInfo& info, const StereoCalibration& calibration)
      : clock_(stage_names()), pipeline_(make(config, info, calibration)) {
    arena_.seal();
  }
  void run(const FramePair& pair) {
    const Result<FrameResult> result = pipeline_.run(pair);
    if (!result.has_value()) throw std::runtime_error("our pipeline refuses the bench's pictures");
    tracks_ = result->tracks;
  }
  [[nodiscard]] int targets() const {
    return static_cast<int>(std::count_if(tracks_.begin(), tracks_.end(),
                                          [](const TrackReport& t) { return t.state == TrackState::kConfirmed; }));
  }
  [[nodiscard]] StageClock& clock() noexcept { return clock_; }

 private:
  Pipeline make(const PipelineConfig& config, const capture::SourceInfo& info, const StereoCalibration& calibration) {
    Pipeline::Setup setup;
    setup.width = info.width;
    setup.height = info.height;
    setup.colour = true;
    setup.calibration = &calibration;
    setup.observer.context = &clock_;
    setup.observer.ended = [](void* clock, Stage stage) noexcept {
      static_cast<StageClock*>(clock)->ended(static_cast<std::size_t>(stage));
    };
    const Result<Pipeline> made = Pipeline::create(config, setup, arena_);
    if (!made.has_value()) throw std::runtime_error(std::string("our pipeline: ") + to_string(made.error()));
    return *made;
  }

  StageClock clock_;
  Arena arena_{runtime::advise_large_pages};
  Pipeline pipeline_;
  std::span<const TrackReport> tracks_;
};

// The composition of OpenCV's calls, with the same numbers as the thesis preset.
class Theirs {
 public:
  Theirs(const PipelineConfig& thesis, int disparities, const OpenCvPipeline::Rig& rig)
      : clock_(call_names()), pipeline_(config_of(thesis, disparities), rig, observer()) {}
  void run(const FramePair& pair, double dt) { pipeline_.run(to_opencv(pair.left), to_opencv(pair.right), dt); }
  [[nodiscard]] int targets() const {
    const auto targets = pipeline_.targets();
    return static_cast<int>(std::count_if(targets.begin(), targets.end(), [](const OpenCvPipeline::Target& target) {
      return target.hits >= OpenCvPipeline::kConfirmHits && target.misses == 0;
    }));
  }
  [[nodiscard]] StageClock& clock() noexcept { return clock_; }

 private:
  static OpenCvPipeline::Config config_of(const PipelineConfig& thesis, int disparities) {
    OpenCvPipeline::Config config;
    config.disparities = disparities;
    config.block = thesis.disparity.block;
    config.background_frames = thesis.background.frames;
    config.edge_threshold = thesis.shape.edge_threshold;
    config.min_blob_px = thesis.shape.min_blob_px;
    config.max_blobs = thesis.shape.max_blobs;
    config.level_set_margin_px = thesis.shape.level_set_config.margin_px;
    config.level_set_iterations = thesis.shape.level_set_config.max_iterations;
    return config;
  }
  CvObserver observer() noexcept {
    return {[](void* clock, CvStep step) noexcept {
              static_cast<StageClock*>(clock)->ended(static_cast<std::size_t>(step));
            },
            &clock_};
  }

  StageClock clock_;
  OpenCvPipeline pipeline_;
};

// Pipelines that all see the same frames.
class Pass {
 public:
  Pass(std::string name, std::unique_ptr<capture::FrameSource> source, const StereoCalibration& calibration,
       const Plan& plan, const InstructionCounter& counter)
      : name_(std::move(name)),
        plan_(plan),
        source_(std::move(source)),
        calibration_(with_lens(calibration)),
        contest_(counter) {}

  void add_ours(const std::string& name, const std::vector<std::string>& settings) {
    const config::Configuration configuration = configured(settings);
    const auto& ours = ours_[name] = std::make_unique<Ours>(configuration.pipeline, source_->info(), calibration_);
    contest_.add(
        name_ + "/" + name, [this, it = ours.get()] { it->run(pair_); }, &ours->clock());
  }
  void add_theirs(int disparities) {
    const capture::SourceInfo& info = source_->info();
    theirs_ = std::make_unique<Theirs>(configured(thesis()).pipeline, disparities,
                                       to_opencv(calibration_, {info.width, info.height}));
    contest_.add(
        name_ + "/opencv", [this] { theirs_->run(pair_, dt_); }, &theirs_->clock());
  }
  [[nodiscard]] std::vector<std::string> thesis() const { return thesis_settings(plan_.warm_up); }

  void run(int warm_up, int frames) {
    contest_.reserve(static_cast<std::size_t>(frames));
    for (int i = 0; i < warm_up + frames; ++i) {
      const CaptureTime before = pair_.capture_time;
      if (source_->next(pair_) != capture::Next::kPair) throw std::runtime_error(name_ + ": the pictures ran out");
      dt_ = i == 0 ? 0.0 : seconds_between(before, pair_.capture_time);
      contest_.round(i >= warm_up);
    }
  }

  [[nodiscard]] double ms(const std::string& name) const { return median_of(contest_.of(name_ + "/" + name).ms); }

  [[nodiscard]] Entry entry(std::string name, std::string what, const std::string& ours,
                            std::optional<double> target) const {
    const Measured& mine = contest_.of(name_ + "/" + ours);
    const Measured& rival = contest_.of(name_ + "/opencv");
    const capture::SourceInfo& info = source_->info();
    Entry entry;
    entry.name = std::move(name);
    entry.what = std::move(what);
    entry.target = target;
    entry.ours = side_of(mine, plan_);
    entry.theirs = side_of(rival, plan_);
    entry.ours.targets = ours_.at(ours)->targets();
    entry.theirs.targets = theirs_->targets();
    entry.bytes = 7.0 * info.width * info.height;  // two colour pictures read, one mask written
    for (std::size_t i = 0; i < kStages; ++i) {
      StageRow row{mine.stages->names()[i], times_of(mine.stages->ms(i)), std::nullopt};
      std::vector<double> sums(rival.ms.size(), 0.0);
      bool any = false;
      for (std::size_t step = 0; step < kCvSteps; ++step) {
        if (stage_of(static_cast<CvStep>(step)) != static_cast<Stage>(i)) continue;
        any = true;
        const std::vector<double>& ms = rival.stages->ms(step);
        std::transform(sums.begin(), sums.end(), ms.begin(), sums.begin(), std::plus<>());
      }
      if (any) row.theirs = times_of(std::move(sums));
      entry.stages.push_back(std::move(row));
    }
    for (std::size_t step = 0; step < kCvSteps; ++step) {
      entry.calls.push_back({rival.stages->names()[step], std::nullopt, times_of(rival.stages->ms(step))});
    }
    return entry;
  }

 private:
  std::string name_;
  Plan plan_;
  std::unique_ptr<capture::FrameSource> source_;
  StereoCalibration calibration_;
  std::map<std::string, std::unique_ptr<Ours>> ours_;
  std::unique_ptr<Theirs> theirs_;
  Contest contest_;
  FramePair pair_;
  double dt_ = 0;
};

std::unique_ptr<Pass> eleven(const std::string& name, int width, int height, const Plan& plan,
                             const InstructionCounter& counter) {
  capture::SyntheticOptions options;
  options.width = width;
  options.height = height;
  options.frames = kFirstFrame + static_cast<std::uint64_t>(plan.warm_up + plan.frames);
  auto source = capture::open_synthetic("eleven", options);
  source->skip_to(kFirstFrame);
  const StereoCalibration calibration = source->calibration();
  return std::make_unique<Pass>(name, std::move(source), calibration, plan, counter);
}

void add_both(Pass& pass, const std::string& suffix, int width, int disparities) {
  const std::vector<std::string> range = range_settings(width, disparities);
  pass.add_ours("thesis" + suffix, joined(pass.thesis(), range));
  pass.add_ours("robust" + suffix, joined({"preset=robust"}, range));
}

double ns_a_pixel(double ms, int width, int height) { return ms * 1e6 / width / height; }

}  // namespace

void measure_pipelines(const Plan& plan, const InstructionCounter& counter, Report& report) {
  // Pictures of 1280x800 take longest to draw.
  const int large_frames = plan.quick ? std::max(plan.frames / 3, 1) : plan.frames;

  const auto vga = eleven("vga", 640, 480, plan, counter);
  vga->add_theirs(64);
  add_both(*vga, "", 640, 64);
  vga->add_ours("robust as it ships", {"preset=robust"});
  vga->run(plan.warm_up, plan.frames);
  report.entries.push_back(vga->entry("pipeline_thesis_vga64", "thesis preset, dense", "thesis", 13));
  report.entries.push_back(vga->entry("pipeline_robust_vga64", "robust preset, regions", "robust", 22));
  report.entries.push_back(vga->entry("pipeline_robust_default_vga",
                                      "robust preset untouched: regions reach 448 disparities | the same 64 as above",
                                      "robust as it ships", std::nullopt));

  const auto large = eleven("1280x800", 1280, 800, plan, counter);
  large->add_theirs(128);
  add_both(*large, "", 1280, 128);
  add_both(*large, "64", 1280, 64);
  large->run(plan.warm_up, large_frames);
  report.entries.push_back(large->entry("pipeline_thesis_1280x128", "thesis preset, dense", "thesis", 13));
  report.entries.push_back(large->entry("pipeline_robust_1280x128", "robust preset, regions", "robust", 22));

  const auto small = eleven("320x240", 320, 240, plan, counter);
  small->add_theirs(64);
  add_both(*small, "", 320, 64);
  small->run(plan.warm_up, plan.frames);
  report.entries.push_back(small->entry("pipeline_thesis_320x64", "thesis preset, dense", "thesis", std::nullopt));
  report.entries.push_back(small->entry("pipeline_robust_320x64", "robust preset, regions", "robust", std::nullopt));

  const auto boxes = [&](int count) {
    auto pass = std::make_unique<Pass>(
        std::to_string(count) + " boxes", std::make_unique<MovingBoxes>(count, plan.warm_up * 3 / 4),
        capture::synthetic::Rig().calibration(MovingBoxes::kWidth, MovingBoxes::kHeight), plan, counter);
    pass->add_theirs(64);
    add_both(*pass, "", 640, 64);
    pass->run(plan.warm_up, plan.frames);
    return pass;
  };
  const auto one = boxes(1);
  const auto all = boxes(MovingBoxes::kMost);
  for (const std::string preset : {"thesis", "robust"}) {
    const std::string what = preset + (preset == "thesis" ? " preset, dense, " : " preset, regions, ");
    report.entries.push_back(one->entry("objects_1_" + preset + "_vga64", what + "1 moving square", preset, {}));
    report.entries.push_back(all->entry("objects_64_" + preset + "_vga64", what + "64 moving squares", preset, {}));
  }

  for (const std::string preset : {"thesis", "robust"}) {
    report.scalings.push_back({"cost_a_pixel_" + preset,
                               preset + " preset, 64 disparities, by picture size",
                               "ns/px",
                               {{"320x240", ns_a_pixel(small->ms(preset), 320, 240)},
                                {"640x480", ns_a_pixel(vga->ms(preset), 640, 480)},
                                {"1280x800", ns_a_pixel(large->ms(preset + "64"), 1280, 800)}},
                               1.25});
    report.scalings.push_back({"objects_" + preset,
                               preset + " preset, by number of moving squares of 24 px",
                               "ms",
                               {{"1", one->ms(preset)}, {"64", all->ms(preset)}},
                               2.0});
  }
}

}  // namespace stereotrack::bench
