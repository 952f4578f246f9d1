#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "pipeline/track/track_report.hpp"

/// How things look: colours, text and lines that are legible on dark and on light. Lines take places in
/// [px] of the picture drawn on, with fractions; what lies outside is clipped.
namespace stereotrack::render {

inline const cv::Scalar kBackground{28, 25, 23};
inline const cv::Scalar kBright{238, 236, 232};
inline const cv::Scalar kFaint{166, 158, 150};
inline const cv::Scalar kTentative{190, 190, 190};
inline const cv::Scalar kWarning{60, 190, 255};

/// One of twelve hues, always the same for an id; neighbouring ids differ most.
[[nodiscard]] cv::Scalar colour_of(std::uint32_t id);

/// How a track in this state is drawn: confirmed solid, coasting dashed and dimmed, tentative thin and grey.
struct Pen {
  cv::Scalar colour;
  double strength = 1;  ///< of the colour over what is beneath, 0..1
  int thickness = 2;    ///< [px]
  bool dashed = false;
};
[[nodiscard]] Pen pen_of(const TrackReport& track);

using Polyline = std::vector<cv::Point2d>;

void draw_line(cv::Mat& picture, const Polyline& points, bool closed, const Pen& pen);
void draw_outlined_line(cv::Mat& picture, const Polyline& points, bool closed, const Pen& pen);
/// strengths[i]: of the colour from points[i] to points[i + 1], 0..1.
void draw_fading_line(cv::Mat& picture, const Polyline& points, const std::vector<double>& strengths,
                      const cv::Scalar& colour, int thickness);
void fill(cv::Mat& picture, const Polyline& convex, const cv::Scalar& colour, double strength);
void draw_dot(cv::Mat& picture, cv::Point2d centre, double radius, const cv::Scalar& colour);
/// From `from` along `by`, shortened to `longest`; nothing under 5 px.
void draw_arrow(cv::Mat& picture, cv::Point2d from, cv::Point2d by, double longest, const Pen& pen);

[[nodiscard]] cv::Size text_size(const std::string& text, double scale);
/// `origin`: left end of the base line.
void draw_text(cv::Mat& picture, const std::string& text, cv::Point origin, double scale, const cv::Scalar& colour);

/// Writes names beside things so that they do not cover each other, as far as there is room.
class Labels {
 public:
  /// tags: on dark tags, for pictures of anything.
  Labels(cv::Mat& picture, bool tags) : picture_(picture), tags_(tags) {}

  /// Names should not cover this either.
  void keep_clear(const cv::Rect& thing) { taken_.push_back(thing); }
  void draw(const std::string& text, const cv::Rect& thing, double scale, const cv::Scalar& colour);

 private:
  cv::Mat& picture_;
  bool tags_;
  std::vector<cv::Rect> taken_;
};

/// "#7".
[[nodiscard]] std::string id_text(std::uint32_t id);

/// A number with two or three digits that count: 0.42, 4.2, 42.1, 421.
[[nodiscard]] std::string number_text(double value);

}  // namespace stereotrack::render
