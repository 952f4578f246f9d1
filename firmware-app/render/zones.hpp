#pragma once

#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "firmware-app/render/style.hpp"
#include "pipeline/geometry/rectify.hpp"
#include "pipeline/track/zone.hpp"

namespace stereotrack::render {

/// A zone of the configuration, and what it is for.
struct ShownZone {
  enum class Use {
    kSignals,    ///< of signals alone, or with limits of size
    kNoneBegin,  ///< no target begins there
    kIgnored,    ///< nothing is tracked there
    kVolume,     ///< nothing is tracked elsewhere
  };
  std::string name;
  Zone zone;
  Use use = Use::kSignals;
  std::vector<Polyline> floor = {};  ///< of a box, in the raw left picture [px]; make_renderer() finds it: floor_of()
};

/// How its outline is drawn: thin and dashed, so that it is not taken for a target's, in the colour of its use.
[[nodiscard]] Pen pen_of(const ShownZone& zone);

/// Its name, and its use in a word.
[[nodiscard]] std::string text_of(const ShownZone& zone);

/// The edges of a box's floor in the raw left picture [px], in pieces where a part of one is not seen. Sides that are
/// anywhere end where they are not seen any more. Nothing for a box without a floor (y_m anywhere).
[[nodiscard]] std::vector<Polyline> floor_of(const Zone& box, const Rectifier& rectifier, double unit_m);

/// 255 where a drawn pixel lies in the polygon, else 0; scale: drawn px in a raw px.
[[nodiscard]] cv::Mat mask_of(const Zone& polygon, cv::Size drawn, double scale);

/// Dims and hatches what the mask, of the picture's size, holds.
void hatch(cv::Mat& picture, const cv::Mat& mask, const cv::Scalar& colour);

}  // namespace stereotrack::render
