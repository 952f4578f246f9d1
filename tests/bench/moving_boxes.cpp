#include "tests/bench/moving_boxes.hpp"

#include <cstdlib>
#include <opencv2/imgproc.hpp>

namespace stereotrack::bench {

namespace {

constexpr int kSide = 24;       // of a box [px]
constexpr int kInARow = 8;      // cells
constexpr int kWall = 8;        // disparity [px]
constexpr int kNearest = 31;    // disparity [px]
constexpr int kTravel = 24;     // of a box in its cell [px]
constexpr double kNoise = 1.5;  // standard deviation [grey levels]
constexpr std::int64_t kPeriod_ns = 33'333'333;

// Gray blotches of a few pixels, so that every place looks like itself alone. All have the same greys: an equalisation
// of the whole picture does not change when boxes come.
cv::Mat blotches(cv::RNG& random, cv::Size size) {
  cv::Mat gray(size, CV_8U);
  random.fill(gray, cv::RNG::UNIFORM, 0, 256);
  cv::GaussianBlur(gray, gray, {5, 5}, 1.2);
  cv::normalize(gray, gray, 40, 215, cv::NORM_MINMAX);
  cv::Mat picture;
  cv::cvtColor(gray, picture, cv::COLOR_GRAY2BGR);
  return picture;
}

// Blue, green, red; the luma stays.
const cv::Scalar kTint(-30, -9, 30);

}  // namespace

MovingBoxes::MovingBoxes(int boxes, int empty_frames) : boxes_(boxes), empty_frames_(empty_frames), random_(1) {
  info_.name = "moving boxes";
  info_.width = kWidth;
  info_.height = kHeight;
  info_.format = PixelFormat::kBgr8;
  info_.has_time = true;
  info_.period = std::chrono::nanoseconds(kPeriod_ns);
  wall_ = blotches(random_, {kWidth + kWall, kHeight});
  for (int i = 0; i < boxes; ++i) textures_.push_back(blotches(random_, {kSide, kSide}) + kTint);
  noise_.create(2 * kHeight, 2 * kWidth, CV_16SC3);
  random_.fill(noise_, cv::RNG::NORMAL, 0, kNoise);
}

capture::Next MovingBoxes::next(FramePair& out) noexcept {
  ++done_;
  draw(left_, 0, 0);
  draw(right_, kWall, 1);
  const auto picture = [](const cv::Mat& view) {
    return Picture{view.data, view.cols, view.rows, static_cast<std::ptrdiff_t>(view.step), PixelFormat::kBgr8};
  };
  out.ordinal = done_;
  out.capture_time = CaptureTime(std::chrono::nanoseconds(kPeriod_ns * static_cast<std::int64_t>(done_)));
  out.left = picture(left_);
  out.right = picture(right_);
  return capture::Next::kPair;
}

cv::Rect MovingBoxes::box(int i) const noexcept {
  // 29 and 64 have no common factor: a few boxes are spread over the picture, 64 fill all cells.
  const int cell = (29 * i + 36) % kMost;
  const int time = static_cast<int>(done_) + 5 * i;
  const int way = kTravel - std::abs(time % (2 * kTravel) - kTravel);
  // Room on the left of the first column's cells: in the right view the nearest box stands 31 px further left.
  const int x = cell % kInARow * (kWidth / kInARow) + kNearest + way;
  const int y = cell / kInARow * (kHeight / kInARow) + (kHeight / kInARow - kSide) / 2;
  return {x, y, kSide, kSide};
}

int MovingBoxes::disparity(int i) noexcept { return kNearest - i % 16; }

// boxes_shift: how many times its disparity a box stands further left.
void MovingBoxes::draw(cv::Mat& view, int wall_at, int boxes_shift) {
  wall_.colRange(wall_at, wall_at + kWidth).copyTo(view);
  const bool empty = done_ <= static_cast<std::uint64_t>(empty_frames_);
  for (int i = 0; i < (empty ? 0 : boxes_); ++i) {
    const cv::Rect place = box(i) - cv::Point(boxes_shift * disparity(i), 0);
    const cv::Rect seen = place & cv::Rect(0, 0, kWidth, kHeight);
    textures_[static_cast<std::size_t>(i)](seen - place.tl()).copyTo(view(seen));
  }
  const cv::Rect part(random_.uniform(0, kWidth), random_.uniform(0, kHeight), kWidth, kHeight);
  cv::add(view, noise_(part), view, cv::noArray(), CV_8U);
}

}  // namespace stereotrack::bench
