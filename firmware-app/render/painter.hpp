#pragma once

#include <opencv2/core.hpp>
#include <optional>

#include "firmware-app/render/annotation.hpp"
#include "firmware-app/render/top_view.hpp"
#include "firmware-app/render/trails.hpp"
#include "firmware-app/render/zones.hpp"
#include "pipeline/frame.hpp"

namespace stereotrack::render {

/// One picture a frame. Above: frame, time, number of targets (confirmed and coasting), flags in words, legend.
/// Left: the raw left picture, scaled; per track hull, box, `#id distance` (from the left camera; none without
/// depth), where it will be in 0.5 s, trail; per zone its polygon, ignored ones dimmed, or its floor. Right: with a
/// geometry the top view and the foreground mask below it, where there is room; without one (mono) the mask alone.
///
/// Scale of the picture: 720 px high, at most 1280 wide; flatter pictures up to 480 px high, at most 1600 wide.
/// A function of the frames drawn so far: the same frames give the same pixels. One thread.
class Painter {
 public:
  /// width, height: of the raw pictures [px], at least 1.
  Painter(int width, int height, const RectifiedGeometry* geometry, LengthUnit unit, std::vector<ShownZone> zones = {});

  /// Of every picture; even numbers, as video encoders want them.
  [[nodiscard]] cv::Size size() const { return canvas_.size(); }

  /// kBgr8; valid until the next call.
  /// `annotation`: marks in the picture and lines over its foot; null for none.
  [[nodiscard]] const cv::Mat& draw(const FramePair& pair, const FrameResult& result,
                                    const Annotation* annotation = nullptr);

 private:
  void draw_header(const FrameResult& result);
  void draw_picture(const Picture& raw, const FrameResult& result);
  void draw_zones(cv::Mat& picture) const;
  void draw_annotation(const Annotation& annotation);
  void draw_mask(cv::Rect area, const FrameResult& result);

  cv::Rect picture_area_;
  cv::Rect view_area_;  ///< empty for mono
  cv::Rect mask_area_;  ///< empty where there is no room
  double scale_ = 1;    ///< drawn px in a raw px
  LengthUnit unit_;
  std::optional<TopView> top_view_;
  /// What of a zone is seen in the picture drawn.
  struct DrawnZone {
    ShownZone zone;
    std::vector<Polyline> outline;  ///< polygon or floor, drawn [px]
    cv::Mat ignored;                ///< empty: not ignored
  };
  std::vector<DrawnZone> zones_;
  std::optional<CaptureTime> first_;
  Trails trails_;
  cv::Mat canvas_;
};

}  // namespace stereotrack::render
