// Two cameras whose pictures are known: plays recorded pairs into two v4l2loopback devices.
//
//     play_loopback SOURCE LEFT_DEVICE RIGHT_DEVICE FPS
//
// SOURCE as for `stereotrack replay`. All pictures are read first. Then both devices have their format and are ready
// for readers, "ready" is said, and nothing is written until a line comes on standard input: whoever reads the devices
// by then gets each picture once, in order. Pair k is written at begin + k / FPS by CLOCK_MONOTONIC, left, right: a
// sleep that ends late moves no later one. At its end it says how many and how late, and keeps the devices until
// standard input ends.
#include <linux/videodev2.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <stdexcept>
#include <string>
#include <vector>

#include "drivers/capture/replay/replay.hpp"
#include "tests/system/board/live/loopback_writer.hpp"

namespace stereotrack {
namespace {

using capture::v4l2::Device;

std::int64_t to_ns(const timespec& time) { return time.tv_sec * std::int64_t{1'000'000'000} + time.tv_nsec; }

std::int64_t monotonic_ns() {
  timespec now{};
  (void)clock_gettime(CLOCK_MONOTONIC, &now);
  return to_ns(now);
}

void sleep_until(std::int64_t ns) {
  const timespec until{static_cast<time_t>(ns / 1'000'000'000), static_cast<long>(ns % 1'000'000'000)};
  while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, nullptr) == EINTR) {
  }
}

/// What a driver writes of a frame: its rows, without what lies between.
std::vector<std::uint8_t> bytes_of(const Picture& picture) {
  std::vector<std::uint8_t> bytes;
  const std::size_t row = picture_bytes(picture.format, picture.width, 1);
  for (int y = 0; y < picture.height; ++y) bytes.insert(bytes.end(), picture.row(y), picture.row(y) + row);
  return bytes;
}

Device open_for(const std::string& path, const capture::SourceInfo& info, double fps) {
  const std::uint32_t pixels = info.format == PixelFormat::kBgr8 ? V4L2_PIX_FMT_BGR24 : V4L2_PIX_FMT_GREY;
  return test::open_loopback(path, info.width, info.height, pixels, fps);
}

void put(const Device& device, const std::vector<std::uint8_t>& bytes) {
  if (::write(device.descriptor(), bytes.data(), bytes.size()) != static_cast<ssize_t>(bytes.size())) {
    throw std::runtime_error(std::string("a picture was not written: ") + std::strerror(errno));
  }
}

/// False: standard input has ended.
bool wait_for_line() {
  char one = 0;
  while (::read(STDIN_FILENO, &one, 1) == 1) {
    if (one == '\n') return true;
  }
  return false;
}

int play(const std::string& name, const std::string& left_path, const std::string& right_path, double fps) {
  const auto source = capture::open_replay(name, {.fps = fps});
  std::vector<std::vector<std::uint8_t>> left;
  std::vector<std::vector<std::uint8_t>> right;
  FramePair pair;
  for (capture::Next next = source->next(pair); next != capture::Next::kEnd; next = source->next(pair)) {
    if (next == capture::Next::kSkipped) throw std::runtime_error(source->skip_reason());
    left.push_back(bytes_of(pair.left));
    right.push_back(bytes_of(pair.right));
  }
  const Device left_device = open_for(left_path, source->info(), fps);
  const Device right_device = open_for(right_path, source->info(), fps);
  (void)std::printf("ready\n");
  (void)std::fflush(stdout);
  if (!wait_for_line()) return 0;

  const std::int64_t begin = monotonic_ns();
  std::int64_t latest = 0;
  for (std::size_t k = 0; k < left.size(); ++k) {
    const std::int64_t due = begin + static_cast<std::int64_t>(static_cast<double>(k) * 1e9 / fps);
    sleep_until(due);
    latest = std::max(latest, monotonic_ns() - due);
    put(left_device, left[k]);
    put(right_device, right[k]);
  }
  (void)std::printf("played %zu pairs, %.3f ms late at most\n", left.size(), static_cast<double>(latest) * 1e-6);
  (void)std::fflush(stdout);
  while (wait_for_line()) {
  }
  return 0;
}

}  // namespace
}  // namespace stereotrack

int main(int count, char** words) {
  if (count != 5) {
    (void)std::fprintf(stderr, "usage: play_loopback SOURCE LEFT_DEVICE RIGHT_DEVICE FPS\n");
    return 2;
  }
  try {
    return stereotrack::play(words[1], words[2], words[3], std::atof(words[4]));
  } catch (const std::exception& error) {
    (void)std::fprintf(stderr, "play_loopback: %s\n", error.what());
    return 1;
  }
}
