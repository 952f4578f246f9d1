#include "firmware-app/render/painter.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <opencv2/imgproc.hpp>
#include <string>
#include <utility>
#include <vector>

#include "firmware-app/render/style.hpp"
#include "pipeline/photometry/ingest_kernel.hpp"

namespace stereotrack::render {
namespace {

constexpr int kHeader_px = 36;
constexpr int kGap_px = 8;
constexpr double kText = 0.52;
constexpr double kSmall = 0.42;
constexpr double kLookAhead_s = 0.5;
constexpr double kLongestArrow_px = 110;
constexpr double kSmall_px = 28;

int even(double value) { return 2 * static_cast<int>(std::lround(value / 2)); }

double picture_scale(int width, int height) {
  const double tall = std::min(720.0 / height, 1280.0 / width);
  const double flat = std::min(480.0 / height, 1600.0 / width);
  return std::max(tall, flat);
}

/// The largest place of this shape within `area`, in its middle.
cv::Rect fit(cv::Size shape, cv::Rect area) {
  const double scale =
      std::min(area.width / static_cast<double>(shape.width), area.height / static_cast<double>(shape.height));
  const int width = std::max(1, static_cast<int>(shape.width * scale));
  const int height = std::max(1, static_cast<int>(shape.height * scale));
  return {area.x + (area.width - width) / 2, area.y + (area.height - height) / 2, width, height};
}

// What has one sample a pixel, as 8 bits.
cv::Mat samples_of(const Picture& raw) {
  cv::Mat samples(raw.height, raw.width, CV_8UC1);
  for (int y = 0; y < raw.height; ++y) unpack_row(raw.row(y), sample_layout(raw.format), raw.width, samples.ptr(y));
  return samples;
}

// OpenCV names a mosaic after the square that begins at its second row and column.
int demosaicing_of(PixelFormat format) {
  const BayerRed red = bayer_red(format);
  if (red.y == 0) return red.x == 0 ? cv::COLOR_BayerBG2BGR : cv::COLOR_BayerGB2BGR;
  return red.x == 0 ? cv::COLOR_BayerGR2BGR : cv::COLOR_BayerRG2BGR;
}

cv::Mat to_bgr(const Picture& raw) {
  // OpenCV has no Mat over const pixels; they are only read.
  auto* pixels = const_cast<std::uint8_t*>(raw.data);
  const auto stride = static_cast<std::size_t>(raw.stride_bytes);
  const auto memory = [&](int type) {
    return cv::Mat(memory_rows(raw.format, raw.height), raw.width, type, pixels, stride);
  };
  cv::Mat colour;
  switch (raw.format) {
    case PixelFormat::kBgr8: return memory(CV_8UC3);
    case PixelFormat::kRgb8: cv::cvtColor(memory(CV_8UC3), colour, cv::COLOR_RGB2BGR); break;
    case PixelFormat::kYuyv: cv::cvtColor(memory(CV_8UC2), colour, cv::COLOR_YUV2BGR_YUYV); break;
    case PixelFormat::kUyvy: cv::cvtColor(memory(CV_8UC2), colour, cv::COLOR_YUV2BGR_UYVY); break;
    case PixelFormat::kNv12: cv::cvtColor(memory(CV_8UC1), colour, cv::COLOR_YUV2BGR_NV12); break;
    default:
      cv::cvtColor(samples_of(raw), colour, is_bayer(raw.format) ? demosaicing_of(raw.format) : cv::COLOR_GRAY2BGR);
      break;
  }
  return colour;
}

cv::Mat resized(const cv::Mat& from, cv::Size size) {
  cv::Mat to;
  cv::resize(from, to, size, 0, 0, size.width < from.cols ? cv::INTER_AREA : cv::INTER_LINEAR);
  return to;
}

Polyline corners(const Rect& box, double scale) {
  const double left = box.left * scale - 0.5;
  const double top = box.top * scale - 0.5;
  const double right = box.right() * scale - 0.5;
  const double bottom = box.bottom() * scale - 0.5;
  return {{left, top}, {right, top}, {right, bottom}, {left, bottom}};
}

bool is_target(const TrackReport& track) { return track.state != TrackState::kTentative; }

}  // namespace

Painter::Painter(int width, int height, const RectifiedGeometry* geometry, LengthUnit unit,
                 std::vector<ShownZone> zones)
    : scale_(picture_scale(width, height)), unit_(std::move(unit)) {
  const cv::Size picture(std::max(1, static_cast<int>(std::lround(width * scale_))),
                         std::max(1, static_cast<int>(std::lround(height * scale_))));
  const int column = std::max(picture.width, 320);
  const int body = std::max(picture.height, 480);
  const int panel = geometry != nullptr ? even(std::clamp(body * 0.75, 400.0, 540.0)) : std::min(column, 640);
  const int panel_x = column + kGap_px;
  canvas_.create(even(kHeader_px + body + 1), even(panel_x + panel + 1), CV_8UC3);
  picture_area_ = {(column - picture.width) / 2, kHeader_px + (body - picture.height) / 2, picture.width,
                   picture.height};
  for (const ShownZone& zone : zones) {
    DrawnZone drawn{zone, zone.floor, {}};
    if (zone.zone.kind == Zone::Kind::kPicture) {
      drawn.outline.emplace_back();
      for (const Zone::Corner& corner : zone.zone.corners) drawn.outline.back().emplace_back(corner.x, corner.y);
      drawn.outline.back().push_back(drawn.outline.back().front());
      if (zone.use == ShownZone::Use::kIgnored) drawn.ignored = mask_of(zone.zone, picture, scale_);
    }
    for (Polyline& line : drawn.outline) {
      for (cv::Point2d& p : line) p = {(p.x + 0.5) * scale_ - 0.5, (p.y + 0.5) * scale_ - 0.5};
    }
    zones_.push_back(std::move(drawn));
  }
  const cv::Rect side(panel_x, kHeader_px, panel, body);
  if (geometry == nullptr) {
    mask_area_ = fit({width, height}, side);
    mask_area_.y = side.y;
    return;
  }
  top_view_.emplace(*geometry, unit_, std::move(zones));
  view_area_ = side;
  if (body < 640) return;
  view_area_.height = body - 200 - kGap_px;
  mask_area_ = fit({width, height}, {side.x, side.y + body - 200, panel, 200});
}

const cv::Mat& Painter::draw(const FramePair& pair, const FrameResult& result, const Annotation* annotation) {
  if (!first_) first_ = result.capture_time;
  trails_.add(result);
  canvas_.setTo(kBackground);
  draw_header(result);
  draw_picture(pair.left, result);
  if (top_view_) {
    cv::Mat view = canvas_(view_area_);
    top_view_->draw(view, result, trails_);
  }
  if (!mask_area_.empty()) draw_mask(mask_area_, result);
  if (annotation != nullptr) draw_annotation(*annotation);
  return canvas_;
}

void Painter::draw_header(const FrameResult& result) {
  cv::Mat header = canvas_(cv::Rect(0, 0, canvas_.cols, kHeader_px));
  constexpr int kBase = 23;
  const auto targets = std::count_if(result.tracks.begin(), result.tracks.end(), is_target);
  std::array<char, 128> text{};
  std::snprintf(text.data(), text.size(), "frame %llu", static_cast<unsigned long long>(result.ordinal));
  draw_text(header, text.data(), {10, kBase}, kText, kBright);
  std::snprintf(text.data(), text.size(), "%.2f s", seconds_between(*first_, result.capture_time));
  draw_text(header, text.data(), {136, kBase}, kText, kBright);
  std::snprintf(text.data(), text.size(), "%td target%s", targets, targets == 1 ? "" : "s");
  draw_text(header, text.data(), {236, kBase}, kText, kBright);

  constexpr std::array<std::pair<FrameFlag, const char*>, 5> kWords{{{kFlagMono, "mono"},
                                                                     {kFlagNoColour, "grey"},
                                                                     {kFlagLearning, "learning background"},
                                                                     {kFlagLightChange, "light change"},
                                                                     {kFlagWrongPair, "wrong pair"}}};
  int x = 350;
  for (const auto& [flag, word] : kWords) {
    if ((result.flags & flag) == 0) continue;
    const bool passing = flag != kFlagMono && flag != kFlagNoColour;
    draw_text(header, word, {x, kBase}, kText, passing ? kWarning : kFaint);
    x += text_size(word, kText).width + 18;
  }

  const auto legend = [](TrackState state) {
    TrackReport track;
    track.id = 3;
    track.state = state;
    return pen_of(track);
  };
  constexpr std::array<std::pair<TrackState, const char*>, 3> kStates{{{TrackState::kConfirmed, "confirmed"},
                                                                       {TrackState::kCoasting, "coasting"},
                                                                       {TrackState::kTentative, "tentative"}}};
  constexpr int kSample_px = 26;
  int width = 0;
  for (const auto& state : kStates) width += kSample_px + 6 + text_size(state.second, kSmall).width + 18;
  int at = header.cols - width;
  if (at < x) return;
  for (const auto& [state, word] : kStates) {
    draw_line(header, {{at + 0.0, 18}, {at + 0.0 + kSample_px, 18}}, false, legend(state));
    draw_text(header, word, {at + kSample_px + 6, kBase - 1}, kSmall, kFaint);
    at += kSample_px + 6 + text_size(word, kSmall).width + 18;
  }
}

void Painter::draw_picture(const Picture& raw, const FrameResult& result) {
  cv::Mat picture = canvas_(picture_area_);
  if (!raw.empty()) resized(to_bgr(raw), picture_area_.size()).copyTo(picture);
  draw_zones(picture);
  const auto drawn = [&](double x, double y) {
    return cv::Point2d((x + 0.5) * scale_ - 0.5, (y + 0.5) * scale_ - 0.5);
  };
  for (const TrackReport& track : result.tracks) {
    const Pen pen = pen_of(track);
    if (!is_target(track)) continue;
    Polyline trail;
    std::vector<double> strengths;
    for (const Trails::Place& at : trails_.of(track.id)) {
      trail.push_back(drawn(at.image_x, at.image_y));
      strengths.push_back(pen.strength * trails_.strength(at));
    }
    draw_fading_line(picture, trail, strengths, pen.colour, 2);
  }
  for (const TrackReport& track : result.tracks) {
    Pen pen = pen_of(track);
    // Thick lines would hide what is small.
    if (std::min(track.box.width, track.box.height) * scale_ < kSmall_px) pen.thickness = 1;
    Polyline hull;
    for (const Point& p : track.hull) hull.push_back(drawn(p.x, p.y));
    if (is_target(track)) fill(picture, hull, pen.colour, 0.14);
    draw_outlined_line(picture, hull, true, pen);
    draw_line(picture, corners(track.box, scale_), true, {pen.colour, 0.6 * pen.strength, 1, pen.dashed});
  }
  for (const TrackReport& track : result.tracks) {
    if (!is_target(track)) continue;
    const cv::Point2d by(track.image_vx * kLookAhead_s * scale_, track.image_vy * kLookAhead_s * scale_);
    draw_arrow(picture, drawn(track.image_x, track.image_y), by, kLongestArrow_px, pen_of(track));
  }
  Labels labels(picture, true);
  for (const TrackReport& track : result.tracks) {
    if (!is_target(track)) continue;
    std::string text = id_text(track.id);
    if (track.has_depth && track.position.allFinite()) {
      text.append(" ").append(number_text(track.position.norm() * unit_.per_unit)).append(" ").append(unit_.name);
    }
    const Polyline box = corners(track.box, scale_);
    labels.draw(text, cv::Rect(cv::Point(box[0]), cv::Point(box[2])), kText, pen_of(track).colour);
  }
}

void Painter::draw_zones(cv::Mat& picture) const {
  for (const DrawnZone& drawn : zones_) {
    const Pen pen = pen_of(drawn.zone);
    if (!drawn.ignored.empty()) hatch(picture, drawn.ignored, pen.colour);
    for (const Polyline& line : drawn.outline) draw_outlined_line(picture, line, false, pen);
  }
  const cv::Rect2d whole(0, 0, picture.cols, picture.rows);
  for (const DrawnZone& drawn : zones_) {
    // At its highest corner that is seen, within.
    cv::Point2d at(-1, picture.rows);
    for (const Polyline& line : drawn.outline) {
      for (const cv::Point2d& p : line) {
        if (p.y < at.y && whole.contains(p)) at = p;
      }
    }
    const std::string text = text_of(drawn.zone);
    const int last = picture.cols - text_size(text, kSmall).width - 4;
    if (at.x < 0) continue;
    draw_text(picture, text,
              {std::clamp(static_cast<int>(at.x) + 6, 4, std::max(last, 4)), static_cast<int>(at.y) + 16}, kSmall,
              pen_of(drawn.zone).colour);
  }
}

// Marks where things are, then the lines, as many as a third of the picture has room for, cut where it ends.
void Painter::draw_annotation(const Annotation& annotation) {
  cv::Mat picture = canvas_(picture_area_);
  Labels labels(picture, true);
  for (const Annotation::Mark& mark : annotation.marks) {
    const bool rejected = mark.kind == Annotation::Kind::kRejected;
    const cv::Scalar colour = rejected ? kWarning : kBright;
    const Polyline box = corners(mark.box, scale_);
    draw_line(picture, box, true, {colour, 0.9, 1, mark.kind != Annotation::Kind::kDetection});
    if (mark.kind == Annotation::Kind::kDetection) {  // inside, where no name of a target is
      draw_text(picture, mark.text, cv::Point(box[3]) + cv::Point(4, -5), kText, colour);
    } else {
      labels.draw(mark.text, cv::Rect(cv::Point(box[0]), cv::Point(box[2])), kSmall, colour);
    }
  }
  constexpr int kLine_px = 16;
  const auto room = static_cast<std::size_t>(std::max(picture.rows / 3 / kLine_px, 1));
  const std::size_t shown = std::min(annotation.lines.size(), room);
  if (shown == 0) return;
  const int height = static_cast<int>(shown) * kLine_px + 8;
  cv::Mat foot = picture.rowRange(std::max(picture.rows - height, 0), picture.rows);
  foot *= 0.25;
  for (std::size_t i = 0; i < shown; ++i) {
    const bool more = i + 1 == shown && shown < annotation.lines.size();
    const std::string text = more ? "..." : annotation.lines[i];
    draw_text(foot, text, {8, static_cast<int>(i + 1) * kLine_px}, kSmall, kBright);
  }
}

void Painter::draw_mask(cv::Rect area, const FrameResult& result) {
  cv::Mat panel = canvas_(area);
  panel.setTo(cv::Scalar::all(0));
  if (!result.mask.empty()) {
    const cv::Mat mask(result.mask.height, result.mask.width, CV_8UC1, const_cast<std::uint8_t*>(result.mask.data),
                       static_cast<std::size_t>(result.mask.stride));
    cv::cvtColor(resized(mask, area.size()), panel, cv::COLOR_GRAY2BGR);
  }
  const double scale = scale_ * area.width / picture_area_.width;
  for (const TrackReport& track : result.tracks) {
    if (is_target(track)) draw_line(panel, corners(track.box, scale), true, {colour_of(track.id), 1, 1, false});
  }
  cv::rectangle(panel, cv::Rect(cv::Point(), panel.size()), cv::Scalar(66, 60, 55));
  draw_text(panel, "foreground", {8, 16}, kSmall, kFaint);
}

}  // namespace stereotrack::render
