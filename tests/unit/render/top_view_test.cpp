#include "firmware-app/render/top_view.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <vector>

#include "firmware-app/render/style.hpp"
#include "scene.hpp"

namespace stereotrack::render {
namespace {

// f b = 60: a tenth of the width is 32 px, Z = 1.875, so the view starts with 2 units; 2 px is Z = 30.
constexpr RectifiedGeometry kGeometry{320, 320, 240, 300, 160, 160, 120, 0.2, 0};
constexpr int kSide = 400;
constexpr int kFloor = 374;  ///< row of the camera: 26 px above the lower edge

class TopViewTest : public ::testing::Test {
 protected:
  const cv::Mat& draw(std::vector<TrackReport> tracks) {
    tracks_ = std::move(tracks);
    result_.tracks = tracks_;
    trails_.add(result_);
    view_.draw(picture_, result_, trails_);
    return picture_;
  }
  /// Column and row in a view that shows `reach` units.
  static cv::Point pixel(double x, double z, double reach) {
    return {static_cast<int>(0.5 * kSide + x * kFloor / reach), static_cast<int>(kFloor - z * kFloor / reach)};
  }
  bool has_dot(cv::Point at, std::uint32_t id) const {
    const cv::Vec3b is = picture_.at<cv::Vec3b>(at);
    const cv::Scalar wanted = colour_of(id);
    return is == cv::Vec3b(static_cast<unsigned char>(wanted[0]), static_cast<unsigned char>(wanted[1]),
                           static_cast<unsigned char>(wanted[2]));
  }

  TopView view_{kGeometry, {}};
  Trails trails_;
  FrameResult result_;
  std::vector<TrackReport> tracks_;
  cv::Mat picture_ = cv::Mat(kSide, kSide, CV_8UC3);
};

TEST_F(TopViewTest, TrackStandsWhereItIs) {
  draw({track_at(1, TrackState::kConfirmed, 0.4, 1.5)});
  EXPECT_TRUE(has_dot(pixel(0.4, 1.5, 2), 1));
}

TEST_F(TopViewTest, GrowsForAConfirmedTrackAndNeverShrinks) {
  draw({track_at(1, TrackState::kConfirmed, 0.4, 6)});
  EXPECT_TRUE(has_dot(pixel(0.4, 6, 7), 1));
  draw({track_at(2, TrackState::kConfirmed, 0.4, 1.5)});
  EXPECT_TRUE(has_dot(pixel(0.4, 1.5, 7), 2));
}

TEST_F(TopViewTest, GrowsForATrackAtTheSide) {
  draw({track_at(1, TrackState::kConfirmed, 2.5, 1.5)});
  EXPECT_TRUE(has_dot(pixel(2.5, 1.5, 5), 1));
}

TEST_F(TopViewTest, DoesNotGrowForWhatIsNotBelieved) {
  TrackReport stray = track_at(1, TrackState::kTentative, 0, 20);
  TrackReport coasting = track_at(2, TrackState::kCoasting, 0.1, 25);
  draw({stray, coasting, track_at(3, TrackState::kConfirmed, 0.4, 1.5)});
  EXPECT_TRUE(has_dot(pixel(0.4, 1.5, 2), 3));
}

TEST_F(TopViewTest, DoesNotGrowForWhatHasJustComeIntoView) {
  TrackReport young = track_at(1, TrackState::kConfirmed, 0, 20);
  young.age_s = 0.9;
  draw({young, track_at(3, TrackState::kConfirmed, 0.4, 1.5)});
  EXPECT_TRUE(has_dot(pixel(0.4, 1.5, 2), 3));
}

TEST_F(TopViewTest, DoesNotGrowBeyondWhereDisparityEnds) {
  draw({track_at(1, TrackState::kConfirmed, 0, 4000), track_at(2, TrackState::kConfirmed, 4, 15)});
  EXPECT_TRUE(has_dot(pixel(4, 15, 30), 2));
  EXPECT_TRUE(has_dot({kSide / 2 + 4, 6}, 1));  // hollow, on the upper edge
}

TEST_F(TopViewTest, TrackWithoutDepthOrWithNonFiniteNumbersIsLeftOut) {
  const cv::Mat empty = draw({}).clone();
  TrackReport flat = track_at(1, TrackState::kConfirmed, 0.4, 1.5);
  flat.has_depth = false;
  TrackReport broken = track_at(2, TrackState::kConfirmed, 0.2, 1.5);
  broken.position.z() = std::numeric_limits<double>::quiet_NaN();
  draw({flat, broken});
  EXPECT_EQ(cv::norm(empty, picture_, cv::NORM_INF), 0);
}

TEST_F(TopViewTest, EllipseIsTheCovarianceAlongTheRay) {
  TrackReport track = track_at(1, TrackState::kConfirmed, 0, 1);
  track.velocity.setZero();
  const cv::Mat none = [&] {
    TrackReport certain = track;
    certain.covariance.setZero();
    return draw({certain}).clone();
  }();
  track.covariance(0, 0) = 0.1 * 0.1;
  track.covariance(2, 2) = 0.5 * 0.5;
  draw({track});
  EXPECT_NE(picture_.at<cv::Vec3b>(pixel(0, 1.48, 2)), none.at<cv::Vec3b>(pixel(0, 1.48, 2)));
  EXPECT_EQ(picture_.at<cv::Vec3b>(pixel(0, 1.55, 2)), none.at<cv::Vec3b>(pixel(0, 1.55, 2)));
  EXPECT_NE(picture_.at<cv::Vec3b>(pixel(-0.09, 1, 2)), none.at<cv::Vec3b>(pixel(-0.09, 1, 2)));
  EXPECT_EQ(picture_.at<cv::Vec3b>(pixel(-0.15, 1, 2)), none.at<cv::Vec3b>(pixel(-0.15, 1, 2)));
}

TEST_F(TopViewTest, KnownUnitScalesTheView) {
  TopView metres(kGeometry, {0.1, "m"});
  tracks_ = {track_at(1, TrackState::kConfirmed, 0.4, 1.5)};
  result_.tracks = tracks_;
  trails_.add(result_);
  metres.draw(picture_, result_, trails_);
  EXPECT_TRUE(has_dot(pixel(0.04, 0.15, 0.2), 1));
}

}  // namespace
}  // namespace stereotrack::render
