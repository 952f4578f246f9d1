#include "drivers/capture/replay/video_source.hpp"

#include <cmath>
#include <exception>
#include <filesystem>
#include <stdexcept>
#include <utility>

#include "drivers/capture/replay/adjust.hpp"
#include "drivers/capture/replay/pairing.hpp"

namespace stereotrack::capture {
namespace {

using std::chrono::nanoseconds;

constexpr double kMaxFps = 1000;
constexpr double kOnGrid = 0.1;              ///< [periods]; a container's clock of 1 ms is 0.06 at 120 Hz
constexpr std::uint64_t kEstimateError = 2;  ///< [pictures] by which containers without an index guess wrong

}  // namespace

nanoseconds video_time(double stamp_s, nanoseconds before, double fps) {
  const double periods = stamp_s * fps;
  const double whole = std::round(periods);
  if (periods > 0 && periods < 1e12) {
    const nanoseconds time = std::abs(periods - whole) < kOnGrid ? at_rate(static_cast<std::uint64_t>(whole), fps)
                                                                 : nanoseconds(std::llround(stamp_s * 1e9));
    if (time > before) return time;
  }
  return before + at_rate(1, fps);
}

VideoFile::VideoFile(const std::string& path, double fallback_fps) : path_(path) {
  if (!std::filesystem::exists(path)) throw std::runtime_error(path + ": no such video: check the path");
  open();
  if (!capture_.isOpened()) {
    throw std::runtime_error(path + ": cannot be opened as a video: convert it to MJPEG or H.264 in AVI, MP4 or MKV");
  }
  fps_ = capture_.get(cv::CAP_PROP_FPS);
  has_time_ = fps_ > 0 && fps_ <= kMaxFps;
  if (!has_time_) fps_ = fallback_fps;
  const double count = capture_.get(cv::CAP_PROP_FRAME_COUNT);
  if (count >= 1 && count < 1e12) announced_ = static_cast<std::uint64_t>(count);
  while (width_ == 0 && capture_.grab()) {
    if (capture_.retrieve(picture_) && picture_.type() == CV_8UC3) {
      width_ = picture_.cols;
      height_ = picture_.rows;
      format_ = format_of(picture_);
    }
  }
  if (width_ == 0) throw std::runtime_error(path + ": no picture can be decoded: the video is damaged or empty");
  open();
}

void VideoFile::open() { capture_.open(path_, cv::CAP_FFMPEG); }

bool VideoFile::grab() {
  if (!capture_.grab()) return false;
  ++grabbed_;
  const double stamp_s = capture_.get(cv::CAP_PROP_POS_MSEC) * 1e-3;
  if (grabbed_ == 1) {
    first_stamp_s_ = stamp_s;
  } else if (has_time_) {
    time_ = video_time(stamp_s - first_stamp_s_, time_, fps_);
  } else {
    time_ = at_rate(grabbed_ - 1, fps_);
  }
  return true;
}

cv::Mat& VideoFile::retrieve() {
  fault_.clear();
  if (!capture_.retrieve(picture_) || picture_.type() != CV_8UC3) {
    fault_ = path_ + ": picture " + std::to_string(grabbed_) + " cannot be decoded";
  } else if (picture_.cols != width_ || picture_.rows != height_) {
    fault_ = path_ + ": picture " + std::to_string(grabbed_) + " is of another size than the first";
  }
  if (!fault_.empty()) picture_.release();
  return picture_;
}

VideoSource::VideoSource(std::string name, Layout layout, const std::string& left, const std::string& right,
                         const ReplayOptions& options)
    : layout_(layout), options_(options), left_(left, options.fps) {
  if (layout_ == Layout::kTwoFiles) {
    right_.emplace(right, options.fps);
    if (right_->width() != left_.width() || right_->height() != left_.height()) {
      throw std::runtime_error(right + ": is not of the size of " + left + ": give two videos of one recording");
    }
    if (std::abs(right_->fps() - left_.fps()) > 0.01 * left_.fps()) {
      throw std::runtime_error(right + ": has not the rate of " + left + ": give two videos of one recording");
    }
  }
  info_.name = std::move(name);
  info_.width = left_.width();
  info_.height = left_.height();
  if (layout_ == Layout::kSideBySide) {
    if (info_.width % 2 != 0) {
      throw std::runtime_error(left + ": " + std::to_string(info_.width) +
                               " columns cannot be two views side by side: the width must be even");
    }
    info_.width /= 2;
  }
  if (std::abs(options_.shift_rows) >= info_.height) {
    throw std::runtime_error(info_.name + ": a shift of " + std::to_string(options_.shift_rows) +
                             " rows leaves nothing of a picture of " + std::to_string(info_.height) + " rows");
  }
  info_.format = left_.format();
  info_.stereo = layout_ != Layout::kMono;
  info_.has_time = left_.has_time();
  info_.period = at_rate(1, left_.fps());
  if (left_.announced() > 0) info_.pairs = left_.announced();
}

Next VideoSource::skip(std::string reason) {
  reason_ = std::move(reason);
  return Next::kSkipped;
}

Next VideoSource::at_end(bool left, bool right) {
  if (left != right) {
    const VideoFile& shorter = left ? *right_ : left_;
    const VideoFile& longer = left ? left_ : *right_;
    return skip(shorter.path() + ": ends after " + std::to_string(shorter.grabbed()) + " pictures, " + longer.path() +
                " goes on");
  }
  ended_ = true;
  if (left_.grabbed() + kEstimateError < left_.announced()) {
    return skip(left_.path() + ": ends after " + std::to_string(left_.grabbed()) + " of " +
                std::to_string(left_.announced()) + " pictures: it is cut off or damaged");
  }
  return Next::kEnd;
}

Next VideoSource::read_next(FramePair& out) {
  const bool left = left_.grab();
  const bool right = right_ ? right_->grab() : left;
  time_ = left ? left_.time() : time_ + info_.period;
  out.capture_time = CaptureTime(time_);
  if (!left || !right) return at_end(left, right);

  views_[0] = left_.retrieve();
  if (!left_.fault().empty()) return skip(left_.fault());
  if (layout_ == Layout::kSideBySide) {
    const cv::Mat both = views_[0];
    const int first = options_.swap ? info_.width : 0;
    views_[0] = both.colRange(first, first + info_.width);
    views_[1] = both.colRange(info_.width - first, 2 * info_.width - first);
  } else if (right_) {
    views_[1] = right_->retrieve();
    if (!right_->fault().empty()) return skip(right_->fault());
  }
  convert(views_[0], info_.format);
  if (options_.flip) flip_rows(views_[0]);
  out.left = view_of(views_[0]);
  if (info_.stereo) {
    convert(views_[1], info_.format);
    if (options_.flip) flip_rows(views_[1]);
    shift_rows_down(views_[1], options_.shift_rows);
    out.right = view_of(views_[1]);
  }
  return Next::kPair;
}

Next VideoSource::next(FramePair& out) noexcept {
  out = {};
  if (ended_) return Next::kEnd;
  const std::uint64_t ordinal = ++ordinal_;
  out.ordinal = ordinal;
  Next result = Next::kEnd;
  try {
    result = read_next(out);
  } catch (const std::exception& error) {
    reason_ = left_.path() + ": picture " + std::to_string(ordinal) + ": " + error.what();
    result = Next::kSkipped;
  }
  return result;
}

void VideoSource::skip_to(std::uint64_t ordinal) noexcept {
  try {
    for (; ordinal_ < ordinal; ++ordinal_) {
      const bool left = left_.grab();
      const bool right = right_ ? right_->grab() : left;
      time_ = left ? left_.time() : time_ + info_.period;
      if (!left && !right) return;
    }
  } catch (const std::exception&) {
    ended_ = true;
  }
}

}  // namespace stereotrack::capture
