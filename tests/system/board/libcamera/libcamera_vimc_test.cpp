// The board's two vimc cameras through the module: found, opened in one process, leased, timed, and silent once
// unplugged.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <poll.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdint>
#include <cstdlib>
#include <fstream>
#include <iostream>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "drivers/capture/libcamera/libcamera.hpp"
#include "drivers/capture/libcamera/stream.hpp"
#include "tests/rt/heap_watch.hpp"

namespace stereotrack::capture::libcamera {
namespace {

using namespace std::chrono_literals;
using std::chrono::nanoseconds;
using ::testing::HasSubstr;
using ::testing::MatchesRegex;

// Small pictures, and few, for vimc computes each pixel, and libcamera after 0.0.3 lets it compute 1920x1080 whatever
// the size: there a frame takes two seconds of the emulated CPU and may come three after its stamp. The rate that is
// told says how late it may.
constexpr int kWidth = 102;
constexpr int kHeight = 60;

class Vimc : public ::testing::Test {
 protected:
  static Settings settings(const char* device) {
    Settings wish;
    wish.device = device;
    wish.width = kWidth;
    wish.height = kHeight;
    wish.format = "rgb8";
    wish.fps = 1;
    return wish;
  }
  static std::unique_ptr<Camera> started(const char* device, std::vector<std::string>* notes = nullptr) {
    auto camera = open(settings(device), notes);
    camera->start();
    return camera;
  }
  static Camera::Take wait_take(Camera& camera, SensorFrame& frame, int limit_ms = 5000) {
    const Camera::Take take = camera.take(frame);
    if (take != Camera::Take::kNothing) return take;
    pollfd waits{camera.descriptor(), POLLIN, 0};
    (void)::poll(&waits, 1, limit_ms);
    return camera.take(frame);
  }
  /// Empty: it was opened.
  static std::string refusal(const Settings& wish) {
    try {
      (void)open(wish);
    } catch (const std::runtime_error& error) {
      return error.what();
    }
    return {};
  }
  static void write_file(const std::string& path, const std::string& text) {
    std::ofstream file(path);
    file << text << std::flush;
    EXPECT_TRUE(file.good()) << path;
  }
};

TEST_F(Vimc, BothAreListedWithWhatTheyOffer) {
  const Listing listing = list_cameras();
  ASSERT_EQ(listing.cameras.size(), 2U) << (listing.problems.empty() ? "" : listing.problems.front());
  EXPECT_THAT(listing.module, MatchesRegex("libcamera v0\\..*, /payload/stereotrack-libcamera-0\\..*\\.so"));
  for (const CameraFacts& camera : listing.cameras) {
    EXPECT_THAT(camera.id, HasSubstr("vimc"));
    const auto rgb = std::find_if(camera.formats.begin(), camera.formats.end(),
                                  [](const CameraFacts::Format& format) { return format.name == "rgb8"; });
    ASSERT_NE(rgb, camera.formats.end());
    EXPECT_FALSE(rgb->sizes.empty());
    RecordProperty("camera", camera.id + " " + camera.model);
  }
  EXPECT_NE(listing.cameras[0].id, listing.cameras[1].id);
}

TEST_F(Vimc, WhatCannotBeHadIsALineWithWhatCan) {
  Settings wish = settings("0");
  wish.format = "grey8";
  EXPECT_THAT(refusal(wish), HasSubstr("has no format grey8; it has "));
  wish = settings("0");
  wish.width = kWidth + 3;  // libcamera 0.0.3 wants a multiple of six, later ones an even number
  EXPECT_THAT(refusal(wish), HasSubstr("cannot deliver 105x60 rgb8, libcamera would make 10"));
  EXPECT_THAT(refusal(wish), HasSubstr("x60 rgb8 of it; it offers "));
  EXPECT_THAT(refusal(settings("imx219")), HasSubstr("libcamera has none of that name; it knows 0: "));
  const auto first = open(settings("0"));
  EXPECT_THAT(refusal(settings("0")), HasSubstr("another program has it"));
}

TEST_F(Vimc, BothGiveFramesInOneProcessOnTheMonotonicClockWithoutTheHeap) {
  std::vector<std::string> notes;
  std::vector<std::unique_ptr<Camera>> cameras;
  cameras.push_back(started("0", &notes));
  cameras.push_back(started("1", &notes));
  for (const std::string& note : notes) std::cout << "# " << note << '\n';
  for (const auto& camera : cameras) {
    EXPECT_EQ(camera->info().format, PixelFormat::kRgb8);
    EXPECT_EQ(camera->info().width, kWidth);
    EXPECT_GE(camera->info().buffers, 2U);
  }
  constexpr int kFrames = 30;
  std::array<CaptureTime, 2> first{};
  std::array<CaptureTime, 2> last{};
  std::array<std::set<std::uint32_t>, 2> buffers;
  std::uint64_t heap_calls = 0;
  nanoseconds latest{0};
  for (int n = 0; n < kFrames; ++n) {
    for (std::size_t side = 0; side < 2; ++side) {
      Camera& camera = *cameras[side];
      SensorFrame frame;
      const test::HeapWatch watch;
      ASSERT_EQ(wait_take(camera, frame), Camera::Take::kFrame) << camera.failure();
      const Picture picture = camera.picture(frame.buffer);
      const std::uint8_t* const row = picture.row(picture.height - 1);
      volatile std::uint8_t read = row[3 * picture.width - 1];  // its memory is there, to the end
      (void)read;
      const CaptureTime time = frame.mid_exposure;
      const nanoseconds age = frame.arrived - camera.clock_map().to_monotonic(time);
      camera.give_back(frame.buffer);
      heap_calls += watch.calls();
      EXPECT_FALSE(frame.damaged);
      EXPECT_GE(age.count(), 0);
      latest = std::max(latest, age);
      if (n == 0) first.at(side) = time;
      EXPECT_TRUE(n == 0 || time > last.at(side));
      last.at(side) = time;
      buffers.at(side).insert(frame.buffer);
    }
  }
  EXPECT_EQ(heap_calls, 0U);
  for (std::size_t side = 0; side < 2; ++side) {
    const auto* const stream = dynamic_cast<const Stream*>(cameras[side].get());
    ASSERT_NE(stream, nullptr);
    EXPECT_EQ(stream->clock(), ClockFinder::Clock::kMonotonic);
    EXPECT_EQ(cameras[side]->counters().steps, 0U);
    EXPECT_EQ(cameras[side]->counters().damaged, 0U);
    EXPECT_EQ(buffers.at(side).size(), cameras[side]->info().buffers);  // all go round
    std::cout << "# camera " << side << ": "
              << std::chrono::duration<double>(last.at(side) - first.at(side)).count() / (kFrames - 1) * 1e3
              << " ms a frame, " << cameras[side]->counters().lost << " lost, the latest came "
              << std::chrono::duration<double>(latest).count() * 1e3 << " ms after its stamp\n";
  }
}

TEST_F(Vimc, ThatHasNoBufferLeftGoesOnOnceOneComesBack) {
  const auto camera = started("0");
  std::vector<SensorFrame> leased(camera->info().buffers);
  for (SensorFrame& frame : leased) ASSERT_EQ(wait_take(*camera, frame), Camera::Take::kFrame);
  SensorFrame frame;
  EXPECT_EQ(wait_take(*camera, frame, 300), Camera::Take::kNothing);
  camera->give_back(leased[1].buffer);
  ASSERT_EQ(wait_take(*camera, frame), Camera::Take::kFrame);
  EXPECT_EQ(frame.buffer, leased[1].buffer);
}

TEST_F(Vimc, OneIsClosedAndOpenedAnewWhileTheOtherGoesOn) {
  const auto left = started("0");
  for (int n = 0; n < 5; ++n) {
    const auto right = started("1");
    SensorFrame frame;
    for (int i = 0; i < 3; ++i) {
      ASSERT_EQ(wait_take(*right, frame), Camera::Take::kFrame) << n;
      right->give_back(frame.buffer);
      ASSERT_EQ(wait_take(*left, frame), Camera::Take::kFrame) << n;
      left->give_back(frame.buffer);
    }
  }
}

// libcamera 0.0.3 ends the process of who stops a camera that is gone, and of who sees it come back: the module keeps
// both from happening. What is left of it is a silence, for which StereoCameras has its time-out.
TEST_F(Vimc, ThatIsUnpluggedEndsHarmsNobodyAndComesBack) {
  auto left = started("vimc.0");
  auto right = started("vimc.1");
  SensorFrame frame;
  ASSERT_EQ(wait_take(*right, frame), Camera::Take::kFrame);
  right->give_back(frame.buffer);
  write_file("/sys/bus/platform/drivers/vimc/unbind", "vimc.1");
  int more = -1;
  Camera::Take end = Camera::Take::kFrame;
  for (; end == Camera::Take::kFrame && more < 100; ++more) {
    end = wait_take(*right, frame, 1000);
    if (end == Camera::Take::kFrame) right->give_back(frame.buffer);
  }
  // Silent, or told of at once where libcamera had a request to queue just then.
  ASSERT_NE(end, Camera::Take::kFrame);
  if (end != Camera::Take::kNothing) {
    EXPECT_THAT(right->failure(), HasSubstr("check its cable"));
  }
  std::cout << "# " << more << " frames after it was unplugged\n";
  right.reset();
  const auto left_goes_on = [&] {
    for (int i = 0; i < 10; ++i) {
      ASSERT_EQ(wait_take(*left, frame), Camera::Take::kFrame) << left->failure();
      left->give_back(frame.buffer);
    }
  };
  left_goes_on();
  EXPECT_THAT(refusal(settings("vimc.1")), HasSubstr("is not connected any more: check its plug and power"));
  left_goes_on();
  write_file("/sys/bus/platform/drivers/vimc/bind", "vimc.1");
  ASSERT_EQ(std::system("udevadm settle"), 0);
  left_goes_on();
  EXPECT_THAT(refusal(settings("vimc.1")), HasSubstr("devices were plugged in meanwhile"));
  while (wait_take(*left, frame) == Camera::Take::kFrame) left->give_back(frame.buffer);
  EXPECT_THAT(left->failure(), HasSubstr("has to be opened anew"));
  left.reset();
  left = started("vimc.0");
  right = started("vimc.1");
  left_goes_on();
  ASSERT_EQ(wait_take(*right, frame), Camera::Take::kFrame);
}

}  // namespace
}  // namespace stereotrack::capture::libcamera
