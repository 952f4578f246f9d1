#include "drivers/capture/v4l2/discovery.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <linux/videodev2.h>

#include <stdexcept>

namespace stereotrack::capture::v4l2 {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr std::uint32_t kCamera = V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_STREAMING;

const std::vector<Node> kNodes = {
    {"/dev/video0", "Eye", "usb-1", "uvcvideo", kCamera, ""},
    {"/dev/video1", "Eye", "usb-1", "uvcvideo", V4L2_CAP_META_CAPTURE | V4L2_CAP_STREAMING, ""},
    {"/dev/video2", "Eye", "usb-2", "uvcvideo", kCamera, ""},
    {"/dev/video3", "unicam", "platform:csi", "unicam", V4L2_CAP_VIDEO_CAPTURE_MPLANE | V4L2_CAP_STREAMING, ""},
    {"/dev/video4", "codec", "platform:codec", "codec", V4L2_CAP_VIDEO_M2M | V4L2_CAP_STREAMING, ""},
};

std::string refusal(const std::string& name, std::span<const Node> nodes = kNodes) {
  try {
    (void)choose_node(name, nodes);
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  return {};
}

TEST(ChooseNode, ByBusAndByName) {
  EXPECT_EQ(choose_node("bus:usb-1", kNodes), "/dev/video0");
  EXPECT_EQ(choose_node("bus:usb-2", kNodes), "/dev/video2");
  EXPECT_EQ(choose_node("name:unicam", kNodes), "/dev/video3");
  EXPECT_EQ(choose_node("bus:platform:csi", kNodes), "/dev/video3");
}

TEST(ChooseNode, SeveralOfThatNameAreRefusedWithTheirPlaces) {
  EXPECT_THAT(refusal("name:Eye"),
              AllOf(HasSubstr("camera name:Eye: several are called that: name one by its path or bus; there is "
                              "/dev/video0 (bus:usb-1, name:Eye), /dev/video2 (bus:usb-2, name:Eye), /dev/video3"),
                    Not(HasSubstr("/dev/video1")), Not(HasSubstr("/dev/video4"))));
}

TEST(ChooseNode, WhatCannotCaptureIsNotChosen) { EXPECT_THAT(refusal("name:codec"), HasSubstr("none is called that")); }

TEST(ChooseNode, NoneAtAll) {
  EXPECT_THAT(refusal("bus:usb-3", {}), HasSubstr("none is on that bus; there is no camera at all"));
}

TEST(ChooseNode, OneThatMayNotBeAskedIsNamed) {
  std::vector<Node> nodes = kNodes;
  nodes.push_back({"/dev/video5", "", "", "", 0, "no permission for /dev/video5: ..."});
  EXPECT_THAT(refusal("bus:usb-3", nodes), HasSubstr("; no permission for /dev/video5"));
}

TEST(ChooseNode, HowANameIsWrittenIsTold) {
  EXPECT_THAT(refusal("video0"), HasSubstr("want /dev/videoN, a link to it, bus:BUS or name:CARD"));
}

TEST(Node, PlanesAreSpokenWhereNothingElseIs) {
  EXPECT_FALSE(has_planes(kNodes[0]));
  EXPECT_TRUE(has_planes(kNodes[3]));
}

}  // namespace
}  // namespace stereotrack::capture::v4l2
