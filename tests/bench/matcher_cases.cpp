#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>
#include <stdexcept>

#include "drivers/capture/synthetic/synthetic_source.hpp"
#include "firmware-app/runtime/large_pages.hpp"
#include "pipeline/core/simd.hpp"
#include "pipeline/stereo/census_matcher.hpp"
#include "pipeline/stereo/sad_matcher.hpp"
#include "tests/bench/cases.hpp"
#include "tests/bench/naive.hpp"

namespace stereotrack::bench {

namespace {

constexpr int kWidth = 640;
constexpr int kHeight = 480;
constexpr DisparityRange kRange{0, 63};
constexpr int kBlock = 9;
constexpr std::uint64_t kOrdinal = 150;

struct Pair {
  cv::Mat left;
  cv::Mat right;
};

// The cameras of synthetic:eleven are ideal: its pictures are rectified.
Pair rectified_pair() {
  const auto source = capture::open_synthetic("eleven");
  source->skip_to(kOrdinal - 1);
  FramePair frames;
  if (source->next(frames) != capture::Next::kPair) throw std::runtime_error(source->skip_reason());
  const auto gray = [](const Picture& picture) {
    // OpenCV's Mat takes no const memory; it is only read.
    const cv::Mat bgr(picture.height, picture.width, CV_8UC3, const_cast<std::uint8_t*>(picture.data),
                      static_cast<std::size_t>(picture.stride_bytes));
    cv::Mat out;
    cv::cvtColor(bgr, out, cv::COLOR_BGR2GRAY);
    return out;
  };
  return {gray(frames.left), gray(frames.right)};
}

ImageView<const std::uint8_t> view(const cv::Mat& m) {
  return {m.ptr<std::uint8_t>(), m.cols, m.rows, static_cast<std::ptrdiff_t>(m.step)};
}
ImageView<std::uint16_t> writable(cv::Mat& m) {
  return {m.ptr<std::uint16_t>(), m.cols, m.rows, static_cast<std::ptrdiff_t>(m.step / sizeof(std::uint16_t))};
}

// A matcher with its memory.
template <class Matcher>
struct Owned {
  explicit Owned(typename Matcher::Config config = {}) : matcher(Matcher::create(sized(config), arena)) {
    if (!matcher.has_value()) throw std::runtime_error(to_string(matcher.error()));
    arena.seal();
  }
  static typename Matcher::Config sized(typename Matcher::Config config) {
    config.width = kWidth;
    config.height = kHeight;
    config.block = kBlock;
    config.range = kRange;
    return config;
  }
  void run(const Pair& pair) { (void)matcher->run(view(pair.left), view(pair.right), writable(out)); }

  Arena arena{runtime::advise_large_pages};
  Result<Matcher> matcher;
  cv::Mat out{kHeight, kWidth, CV_16U, cv::Scalar(0)};
};

CensusMatcher::Config winner_alone() {
  CensusMatcher::Config config;
  config.texture = 0;
  config.uniqueness = 0;
  config.left_right_px = -1;
  config.filter = {.median = false, .speckle_size = 0, .speckle_step = 0, .fill_px = 0};
  return config;
}

// What moves: four upright boxes that together cover `percent` of the picture.
struct Regions {
  explicit Regions(int percent) {
    constexpr int kCount = 4;
    const int height = cvRound(std::sqrt(2.0 * percent * kWidth * kHeight / 100.0 / kCount));
    for (int i = 0; i < kCount; ++i) {
      const Rect box{40 + i * (kWidth - 80) / kCount, 60 + 35 * i, height / 2, height};
      mask(cv::Rect(box.left, box.top, box.width, box.height)).setTo(255);
      boxes.push_back(box);
    }
  }
  [[nodiscard]] double area() const { return cv::countNonZero(mask); }

  cv::Mat mask{kHeight, kWidth, CV_8U, cv::Scalar(0)};
  std::vector<Rect> boxes;
};

void run_regions(Owned<SadMatcher>& sad, const Pair& pair, const Regions& regions) {
  for (const Rect& box : regions.boxes) {
    (void)sad.matcher->run_region(view(pair.left), view(pair.right), box, view(regions.mask), kRange,
                                  writable(sad.out));
  }
}

void expect_equal(const cv::Mat& ours, const cv::Mat& naive, int tolerance, const std::string& what) {
  for (int y = 0; y < naive.rows; ++y) {
    for (int x = 0; x < naive.cols; ++x) {
      const int mine = ours.at<std::uint16_t>(y, x);
      const int right = naive.at<std::uint16_t>(y, x);
      const bool none = mine == kNoDisparity || right == kNoDisparity;
      if (none ? mine == right : std::abs(mine - right) <= tolerance) continue;
      throw std::runtime_error(what + " differs from the naive result at " + std::to_string(x) + "," +
                               std::to_string(y) + ": " + std::to_string(mine) + " instead of " +
                               std::to_string(right) + " sixteenths of a pixel");
    }
  }
}

cv::Mat in_sixteenths(cv::Mat whole) {
  for (auto& d : cv::Mat_<std::uint16_t>(whole)) {
    if (d != kNoDisparity) d = static_cast<std::uint16_t>(d * kDisparityScale);
  }
  return whole;
}

// Back to the best target when it goes out of scope.
struct BestTargetAgain {
  BestTargetAgain() = default;
  BestTargetAgain(const BestTargetAgain&) = delete;
  BestTargetAgain& operator=(const BestTargetAgain&) = delete;
  ~BestTargetAgain() { (void)use_simd(simd_targets().back()); }
};

std::optional<double> target_of(SimdTarget target) {
  if (target == SimdTarget::kAvx512) return 13;
  if (target == SimdTarget::kAvx2) return 8;
  return std::nullopt;
}

}  // namespace

std::vector<std::string> check_matchers() {
  const BestTargetAgain restore;
  const Pair pair = rectified_pair();
  const cv::Mat sad = in_sixteenths(naive_sad(pair.left, pair.right, kBlock, kRange));
  const cv::Mat census = in_sixteenths(naive_census(pair.left, pair.right, kBlock, kRange));
  cv::Mat census_scalar;
  std::vector<std::string> equal;
  for (const SimdTarget target : simd_targets()) {
    if (!use_simd(target)) throw std::runtime_error(std::string(to_string(target)) + ": cannot be used");
    const std::string on = std::string(" on ") + to_string(target);
    Owned<SadMatcher> dense;
    dense.run(pair);
    expect_equal(dense.out, sad, 0, "sad" + on);
    for (const int percent : {5, 20}) {
      const Regions regions(percent);
      Owned<SadMatcher> parts;
      parts.out.setTo(kNoDisparity);
      run_regions(parts, pair, regions);
      cv::Mat wanted(sad.size(), CV_16U, cv::Scalar(kNoDisparity));
      sad.copyTo(wanted, regions.mask);
      expect_equal(parts.out, wanted, 0, "sad on " + std::to_string(percent) + " %" + on);
    }
    // The winner's sub-pixel part is at most half a pixel.
    Owned<CensusMatcher> winner(winner_alone());
    winner.run(pair);
    expect_equal(winner.out, census, kDisparityScale / 2, "census" + on);
    Owned<CensusMatcher> whole;
    whole.run(pair);
    if (census_scalar.empty()) census_scalar = whole.out.clone();
    expect_equal(whole.out, census_scalar, 0, "census with gates and filters" + on + " against scalar");
    equal.push_back("sad dense, sad on 5 and 20 %, census" + on);
  }
  return equal;
}

void measure_matchers(const Plan& plan, const InstructionCounter& counter, Report& report) {
  const BestTargetAgain restore;
  const Pair pair = rectified_pair();
  const Regions few(5);
  const Regions many(20);
  Owned<SadMatcher> sad;
  Owned<CensusMatcher> census;
  const auto block_matcher = cv::StereoBM::create(kRange.count(), kBlock);
  // The settings of OpenCV's own sample stereo_match.cpp, block 5.
  const auto semi_global =
      cv::StereoSGBM::create(0, kRange.count(), 5, 8 * 25, 32 * 25, 1, 63, 10, 100, 32, cv::StereoSGBM::MODE_SGBM_3WAY);
  cv::Mat block_out;
  cv::Mat semi_global_out;

  Contest contest(counter);
  contest.add("StereoBM", [&] { block_matcher->compute(pair.left, pair.right, block_out); });
  contest.add("StereoSGBM_3WAY", [&] { semi_global->compute(pair.left, pair.right, semi_global_out); });
  for (const SimdTarget target : simd_targets()) {
    contest.add(std::string("sad_dense_") + to_string(target), [&, target] {
      (void)use_simd(target);
      sad.run(pair);
      (void)use_simd(simd_targets().back());
    });
  }
  contest.add("sad_5pct", [&] { run_regions(sad, pair, few); });
  contest.add("sad_20pct", [&] { run_regions(sad, pair, many); });
  contest.add("census", [&] { census.run(pair); });
  const int rounds = plan.quick ? std::min(plan.frames, 30) : plan.frames;
  contest.reserve(static_cast<std::size_t>(rounds));
  contest.round(false);
  for (int i = 0; i < rounds; ++i) contest.round(true);

  const auto add = [&](std::string name, std::string what, const std::string& ours, const std::string& theirs,
                       std::optional<double> target, double pixels) {
    Entry entry;
    entry.name = std::move(name);
    entry.what = std::move(what);
    entry.target = target;
    entry.ours = side_of(contest.of(ours), plan);
    entry.theirs = side_of(contest.of(theirs), plan);
    entry.bytes = pixels * 4;  // two greys read, one disparity of 16 bits written
    report.entries.push_back(std::move(entry));
  };
  const double all = static_cast<double>(kWidth) * kHeight;
  const std::string best = std::string("sad_dense_") + to_string(simd_targets().back());
  add("sad_dense_vga64", "SAD 9x9, whole picture | StereoBM 9x9", best, "StereoBM", 13, all);
  // Where instructions were counted without the best target of this machine, those of the best one there.
  Side& dense = report.entries.back().ours;
  const auto counted = plan.instructions.find("sad_dense_" + plan.counted_on);
  if (!dense.instructions && counted != plan.instructions.end()) dense.instructions = counted->second;
  for (const SimdTarget target : simd_targets()) {
    add(std::string("sad_dense_vga64_") + to_string(target),
        std::string("the same, ") + to_string(target) + " forced | StereoBM 9x9",
        std::string("sad_dense_") + to_string(target), "StereoBM", target_of(target), all);
  }
  add("sad_5pct_vga64", "SAD 9x9, four boxes of together 5 % | StereoBM 9x9", "sad_5pct", "StereoBM", 140, few.area());
  add("sad_20pct_vga64", "SAD 9x9, four boxes of together 20 % | StereoBM 9x9", "sad_20pct", "StereoBM", std::nullopt,
      many.area());
  add("robust_vs_sgbm3way", "census 9x9 with gates and filters | StereoSGBM MODE_SGBM_3WAY, block 5", "census",
      "StereoSGBM_3WAY", 8, all);
  add("robust_vs_stereobm", "census 9x9 with gates and filters | StereoBM 9x9", "census", "StereoBM", std::nullopt,
      all);
}

}  // namespace stereotrack::bench
