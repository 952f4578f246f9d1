// What breaks, by the driver's own errors on demand and by taking it away: each is counted or told, and another opening
// goes on.
#include <gmock/gmock.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>

#include "tests/rt/heap_watch.hpp"
#include "tests/system/board/capture/vivid.hpp"

namespace stereotrack::capture::v4l2::test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

class Faults : public VividTest {
 protected:
  /// Takes and gives back until the stream is over.
  static ::testing::AssertionResult ends(Camera& camera) {
    SensorFrame frame;
    for (int i = 0; i < 200; ++i) {
      const Camera::Take take = wait_take(camera, frame, 500);
      if (take == Camera::Take::kLost) return ::testing::AssertionSuccess();
      if (take == Camera::Take::kNothing) return ::testing::AssertionFailure() << "it is silent";
      camera.give_back(frame.buffer);
    }
    return ::testing::AssertionFailure() << "it goes on";
  }
  static void expect_works() {
    const auto camera = started(settings());
    camera->give_back(nth_frame(*camera, 3).buffer);
  }
};

TEST_F(Faults, AFrameWithAnErrorIsDamagedAndTheNextIsNot) {
  const Other other(kLeft);
  const auto camera = started(settings());
  camera->give_back(nth_frame(*camera, 2).buffer);
  other.set("Inject V4L2_BUF_FLAG_ERROR");
  int damaged = 0;
  for (int i = 0; i < 10; ++i) {
    const SensorFrame frame = nth_frame(*camera);
    damaged += frame.damaged ? 1 : 0;
    camera->give_back(frame.buffer);
  }
  EXPECT_EQ(damaged, 1);
  EXPECT_EQ(camera->counters().damaged, 1U);
  EXPECT_EQ(camera->counters().lost, 0U);
}

TEST_F(Faults, AFatalErrorOfTheStreamLosesTheCamera) {
  const Other other(kLeft);
  {
    const auto camera = started(settings());
    camera->give_back(nth_frame(*camera, 2).buffer);
    other.set("Inject Fatal Streaming Error");
    EXPECT_TRUE(ends(*camera));
    EXPECT_THAT(camera->failure(), AllOf(HasSubstr("camera /dev/video0 (vivid, platform:vivid-000): "),
                                         HasSubstr("errno 5"), HasSubstr("open it anew"), Not(HasSubstr("\n"))));
    SensorFrame frame;
    EXPECT_EQ(camera->take(frame), Camera::Take::kLost);
  }
  expect_works();
}

TEST_F(Faults, ADriverThatDoesNotStartIsNamedAndTheNextOpeningWorks) {
  Other(kLeft).set("Inject VIDIOC_STREAMON Error");
  EXPECT_THAT(refusal([&] { (void)started(settings()); }),
              AllOf(HasSubstr("camera /dev/video0: does not start to stream"), HasSubstr("errno 22")));
  expect_works();
}

TEST_F(Faults, ADriverThatGivesNoBuffersIsNamed) {
  Other(kLeft).set("Inject VIDIOC_REQBUFS Error");
  EXPECT_THAT(refusal([&] { (void)started(settings()); }),
              AllOf(HasSubstr("camera /dev/video0: gives no 8 buffers"), HasSubstr("errno 22")));
  expect_works();
}

TEST_F(Faults, ADriverThatTakesNoBufferAtTheStartIsNamed) {
  const auto camera = open(settings());
  Other(kLeft).set("Inject VIDIOC_QBUF Error");
  EXPECT_THAT(refusal([&] { camera->start(); }),
              AllOf(HasSubstr("camera /dev/video0: does not take its buffers"), HasSubstr("errno 22")));
}

TEST_F(Faults, ABufferThatIsRefusedOnceIsOfferedAgain) {
  const Other other(kLeft);
  const auto camera = started(settings());
  for (int round = 0; round < 3; ++round) {
    const SensorFrame frame = nth_frame(*camera);
    other.set("Inject VIDIOC_QBUF Error");
    camera->give_back(frame.buffer);
  }
  std::vector<std::uint32_t> buffers;
  SensorFrame frame;
  for (int i = 0; i < 8; ++i) {
    ASSERT_EQ(wait_take(*camera, frame), Camera::Take::kFrame);
    buffers.push_back(frame.buffer);
  }
  std::sort(buffers.begin(), buffers.end());
  EXPECT_EQ(buffers, (std::vector<std::uint32_t>{0, 1, 2, 3, 4, 5, 6, 7}));
}

TEST_F(Faults, ADisconnectedCameraIsLostAndComesBackWithTheNextOpening) {
  {
    const auto camera = started(settings());
    const SensorFrame held = nth_frame(*camera, 2);
    const std::uint8_t before = camera->picture(held.buffer).data[1000];
    Other(kLeft).set("Disconnect");
    const stereotrack::test::HeapWatch watch;
    EXPECT_TRUE(ends(*camera));
    EXPECT_EQ(watch.calls(), 0U);
    EXPECT_THAT(camera->failure(), AllOf(HasSubstr("is gone"), HasSubstr("errno 19"), HasSubstr("plug and power")));
    // A lease outlives the device.
    EXPECT_EQ(camera->picture(held.buffer).data[1000], before);
    camera->give_back(held.buffer);
    EXPECT_THAT(refusal([&] { (void)open(settings()); }), HasSubstr("/dev/video0"));
  }
  expect_works();
}

TEST_F(Faults, AnUnpluggedCameraIsLostAndAPluggedOneOpensAnew) {
  for (int round = 0; round < 3; ++round) {
    auto camera = started(settings());
    const SensorFrame held = nth_frame(*camera, 2);
    write_file("/sys/bus/platform/drivers/vivid/unbind", "vivid.0");
    EXPECT_TRUE(ends(*camera));
    EXPECT_THAT(camera->failure(), AllOf(HasSubstr("is gone"), HasSubstr("plug and power")));
    std::printf("%s\n", camera->failure().c_str());
    (void)camera->picture(held.buffer).data[1000];
    camera->give_back(held.buffer);
    EXPECT_THAT(refusal([&] { (void)open(settings()); }), HasSubstr("camera /dev/video0: is not there"));
    camera.reset();
    write_file("/sys/bus/platform/drivers/vivid/bind", "vivid.0");
    ASSERT_EQ(std::system("udevadm settle"), 0);
    SetUp();
    expect_works();
  }
}

TEST_F(Faults, OpeningAHundredTimesLeavesNoDescriptorBehind) {
  const auto descriptors = [] {
    return std::distance(std::filesystem::directory_iterator("/proc/self/fd"), std::filesystem::directory_iterator());
  };
  const auto before = descriptors();
  Settings wanted = settings();
  for (int i = 0; i < 100; ++i) {
    wanted.memory = i % 2 == 0 ? Memory::kMapped : Memory::kExported;
    { (void)started(wanted); }
    wanted.device = i % 3 == 0 ? kLeft : "bus:platform:vivid-001";
  }
  Other(kLeft).set("Inject VIDIOC_STREAMON Error");
  (void)refusal([&] { (void)started(settings()); });
  EXPECT_EQ(descriptors(), before);
}

}  // namespace
}  // namespace stereotrack::capture::v4l2::test
