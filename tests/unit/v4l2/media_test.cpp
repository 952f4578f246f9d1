#include "drivers/capture/v4l2/media.hpp"

#include <gtest/gtest.h>

namespace stereotrack::capture::v4l2 {
namespace {

// Two sensors (1, 2), each with a way of its own into a scaler (3) and with a video node (5, 6); the scaler's node
// is 4. Pad numbers: tens are the entity.
MediaGraph graph() {
  MediaGraph made;
  made.entities = {{1, "imx219 a", true}, {2, "imx219 b", true}, {3, "scaler", false},
                   {4, "node", false},    {5, "raw a", false},   {6, "raw b", false}};
  made.pads = {{10, 1, 0, true},  {20, 2, 0, true},  {30, 3, 0, false}, {31, 3, 1, true},
               {40, 4, 0, false}, {50, 5, 0, false}, {60, 6, 0, false}};
  made.links = {
      {10, 30, true, false}, {20, 30, false, false}, {31, 40, true, true}, {10, 50, true, true}, {20, 60, true, true}};
  return made;
}

using Way = std::vector<std::size_t>;

TEST(WayFromSensor, TakesTheLinksThatAreEnabled) {
  EXPECT_EQ(way_from_sensor(graph(), 4, ""), (Way{0, 2}));
  EXPECT_EQ(way_from_sensor(graph(), 5, ""), (Way{3}));
  MediaGraph other = graph();
  other.links[0].enabled = false;
  other.links[1].enabled = true;
  EXPECT_EQ(way_from_sensor(other, 4, ""), (Way{1, 2}));
}

TEST(WayFromSensor, OfTheSensorThatIsNamed) {
  EXPECT_EQ(way_from_sensor(graph(), 4, "imx219 b"), (Way{1, 2}));
  EXPECT_EQ(way_from_sensor(graph(), 4, "imx219 a"), (Way{0, 2}));
  EXPECT_EQ(way_from_sensor(graph(), 4, "imx219"), (Way{0, 2}));
}

TEST(WayFromSensor, ThereMayBeNone) {
  EXPECT_TRUE(way_from_sensor(graph(), 4, "ov9281").empty());
  EXPECT_TRUE(way_from_sensor(graph(), 6, "imx219 a").empty());
  EXPECT_TRUE(way_from_sensor({}, 4, "").empty());
}

TEST(WayFromSensor, ACircleEnds) {
  MediaGraph made = graph();
  made.links.push_back({31, 30, true, false});
  EXPECT_EQ(way_from_sensor(made, 4, ""), (Way{0, 2}));
}

}  // namespace
}  // namespace stereotrack::capture::v4l2
