#include <gtest/gtest.h>

#include <atomic>
#include <random>
#include <thread>

#include "tests/unit/stereo_cameras/rig.hpp"

// Four real threads: sensors, capture, frame loop, service; cameras are unplugged and come back all the time. Under
// ThreadSanitizer this shows that a camera changes hands whole; under AddressSanitizer, that nobody reads one that is
// gone.
namespace stereotrack::capture {
namespace {

using std::chrono::milliseconds;
using std::chrono::nanoseconds;
using test::CameraRig;
using test::number_of;

MonotonicTime real_now() {
  return MonotonicTime(std::chrono::duration_cast<nanoseconds>(std::chrono::steady_clock::now().time_since_epoch()));
}

TEST(StereoCamerasExchange, CamerasComeAndGoWhileThreeThreadsWork) {
  constexpr nanoseconds kFast = milliseconds(2);
  StereoCameras::Config config;
  config.timeout = milliseconds(20);
  config.back_off_first = milliseconds(3);
  config.back_off_most = milliseconds(10);
  CameraRig rig(config);
  for (test::SensorScript* sensor : {&rig.left, &rig.right}) {
    CameraInfo info = sensor->info();
    info.period = kFast;
    sensor->set_info(info);
  }
  rig.open();

  std::atomic<bool> stop{false};
  std::atomic<std::uint64_t> pairs{0};
  std::atomic<std::uint64_t> mono{0};
  std::thread capture([&] {
    while (!stop.load()) (void)rig.cameras->step(rig.outlet, real_now() + milliseconds(5));
    rig.pool.close();
  });
  std::thread frames([&] {
    for (;;) {
      if (rig.pool.wait(real_now() + milliseconds(5)) == FramePool::Wait::kClosed) break;
      const PairLease lease = rig.pool.take_newest();
      if (!lease) continue;
      const std::uint64_t left = number_of(lease->left);
      if (lease->right.empty()) {
        mono.fetch_add(1);
        continue;
      }
      EXPECT_EQ(number_of(lease->right), left);
      pairs.fetch_add(1);
    }
  });
  std::thread service([&] {
    std::vector<SourceNote> notes;
    while (!stop.load()) {
      rig.cameras->tend(notes);
      (void)rig.cameras->figures();
      std::this_thread::sleep_for(milliseconds(1));
    }
    EXPECT_FALSE(notes.empty());
  });
  std::mt19937 random(5);
  for (std::uint64_t n = 1; n <= 1500 || pairs.load() < 20 || mono.load() < 20; ++n) {
    if (n > 100'000) break;
    const nanoseconds time = real_now().time_since_epoch();
    (void)rig.left.expose({.number = n, .time = time});
    (void)rig.right.expose({.number = n, .time = time});
    if (random() % 40 == 0) rig.right.lose();
    if (random() % 80 == 0) rig.left.lose();
    std::this_thread::sleep_for(kFast);
  }
  stop.store(true);
  capture.join();
  frames.join();
  service.join();
  EXPECT_GE(pairs.load(), 20U);
  EXPECT_GE(mono.load(), 20U);
  EXPECT_GT(rig.cameras->figures().cameras[1].reopened, 3U);
  for (const test::SensorScript* sensor : {&rig.left, &rig.right}) {
    EXPECT_EQ(sensor->given_back_wrongly(), 0);
    EXPECT_EQ(sensor->lost_in_closing(), 0);
  }
}

}  // namespace
}  // namespace stereotrack::capture
