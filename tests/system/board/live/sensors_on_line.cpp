// The two sensors of a trigger line: watches the line where gpio-sim shows it and, on each rise, exposes a picture in
// each of two v4l2loopback devices, as sensors do that a pulse asks for one.
//
//     sensors_on_line VALUE_FILE LEFT_DEVICE RIGHT_DEVICE WIDTH HEIGHT FPS
//
// A picture is written kExposure after the rise, grey; its first eight bytes are the number of the exposure, low byte
// first: that of the rise, from 1, for both. Says "ready" once both devices have their format. Then a line on standard
// input does, at the next rise or at once:
//
//     miss SIDE                   the side sleeps over the next rise
//     double SIDE                 it has two pictures of the next one, kAgain apart; the second has kDoubled added
//     free SIDE FPS AFTER_MS      its trigger wire is off: it runs free, from AFTER_MS after the last rise on, by its
//     own
//                                 clock; numbers count on with kFree added
//     wire SIDE                   it is on again
//     count                       says "rises R left L right R": the line's, and pictures that were written
//
// Ends with standard input.
#include <fcntl.h>
#include <linux/videodev2.h>
#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <optional>
#include <sstream>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "tests/system/board/live/loopback_writer.hpp"

namespace stereotrack {
namespace {

using capture::v4l2::Device;

constexpr std::int64_t kMs = 1'000'000;
constexpr std::int64_t kExposure = 10 * kMs;
constexpr std::int64_t kAgain = 8 * kMs;
constexpr std::int64_t kLook = kMs;
constexpr std::uint64_t kDoubled = 1'000'000;
constexpr std::uint64_t kFree = 2'000'000;

std::int64_t monotonic_ns() {
  timespec now{};
  (void)clock_gettime(CLOCK_MONOTONIC, &now);
  return now.tv_sec * std::int64_t{1'000'000'000} + now.tv_nsec;
}

class Sensor {
 public:
  Sensor(const std::string& path, int width, int height, double fps)
      : path_(path), device_(test::open_loopback(path, width, height, V4L2_PIX_FMT_GREY, fps)) {
    // Steps of grey: something to see, that stands still.
    picture_.resize(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
    for (std::size_t i = 0; i < picture_.size(); ++i)
      picture_[i] = static_cast<std::uint8_t>(64 + i % static_cast<std::size_t>(width) / 16 * 8);
  }

  void miss() { misses_ = true; }
  void make_two() { doubles_ = true; }
  void run_free(double fps, std::int64_t from) {
    free_period_ = static_cast<std::int64_t>(1e9 / fps);
    next_free_ = from;
    while (*next_free_ < monotonic_ns()) *next_free_ += free_period_;
  }
  void follow() { next_free_.reset(); }

  void rise(std::uint64_t number, std::int64_t at) {
    if (next_free_) return;
    const bool misses = std::exchange(misses_, false);
    if (misses) return;
    due_.push_back({at + kExposure, number});
    if (std::exchange(doubles_, false)) due_.push_back({at + kExposure + kAgain, number + kDoubled});
  }
  /// Writes what is due.
  void go_on(std::int64_t now) {
    while (!due_.empty() && due_.front().at <= now) {
      write_one(due_.front().number);
      due_.erase(due_.begin());
    }
    while (next_free_ && *next_free_ <= now) {
      write_one(kFree + written_);
      *next_free_ += free_period_;
    }
  }
  [[nodiscard]] std::uint64_t written() const { return written_; }

 private:
  struct Due {
    std::int64_t at = 0;
    std::uint64_t number = 0;
  };
  void write_one(std::uint64_t number) {
    std::memcpy(picture_.data(), &number, sizeof number);
    if (::write(device_.descriptor(), picture_.data(), picture_.size()) != static_cast<ssize_t>(picture_.size())) {
      throw std::runtime_error(path_ + ": a picture was not written: " + std::strerror(errno));
    }
    ++written_;
  }

  std::string path_;
  Device device_;
  std::vector<std::uint8_t> picture_;
  std::vector<Due> due_;
  bool misses_ = false;
  bool doubles_ = false;
  std::optional<std::int64_t> next_free_;
  std::int64_t free_period_ = 0;
  std::uint64_t written_ = 0;
};

class Line {
 public:
  explicit Line(const std::string& path) : path_(path), file_(::open(path.c_str(), O_RDONLY | O_CLOEXEC)) {
    if (file_ < 0) throw std::runtime_error(path + ": " + std::strerror(errno));
  }
  Line(const Line&) = delete;
  Line& operator=(const Line&) = delete;
  ~Line() { (void)::close(file_); }

  [[nodiscard]] bool is_high() const {
    char value = 0;
    if (::pread(file_, &value, 1, 0) != 1) throw std::runtime_error(path_ + ": " + std::strerror(errno));
    return value == '1';
  }

 private:
  std::string path_;
  int file_ = -1;
};

void obey(const std::string& line, std::array<Sensor, 2>& sensors, std::uint64_t rises, std::int64_t last_rise) {
  std::istringstream words(line);
  std::string what;
  std::string side;
  double fps = 0;
  double after_ms = 0;
  words >> what >> side >> fps >> after_ms;
  if (what == "count") {
    (void)std::printf("rises %llu left %llu right %llu\n", static_cast<unsigned long long>(rises),
                      static_cast<unsigned long long>(sensors[0].written()),
                      static_cast<unsigned long long>(sensors[1].written()));
    (void)std::fflush(stdout);
    return;
  }
  if (side != "left" && side != "right") throw std::runtime_error("not understood: " + line);
  Sensor& sensor = sensors[side == "left" ? 0 : 1];
  if (what == "miss") {
    sensor.miss();
  } else if (what == "double") {
    sensor.make_two();
  } else if (what == "wire") {
    sensor.follow();
  } else if (what == "free" && fps > 0) {
    sensor.run_free(fps, last_rise + static_cast<std::int64_t>(after_ms * 1e6) + kExposure);
  } else {
    throw std::runtime_error("not understood: " + line);
  }
}

int run(char** words) {
  const Line line(words[1]);
  const int width = std::atoi(words[4]);
  const int height = std::atoi(words[5]);
  const double fps = std::atof(words[6]);
  std::array<Sensor, 2> sensors{Sensor(words[2], width, height, fps), Sensor(words[3], width, height, fps)};
  (void)std::printf("ready\n");
  (void)std::fflush(stdout);

  std::uint64_t rises = 0;
  std::int64_t last_rise = monotonic_ns();
  bool was_high = line.is_high();
  std::string typed;
  for (;;) {
    pollfd input{STDIN_FILENO, POLLIN, 0};
    const timespec look{0, kLook};
    if (::ppoll(&input, 1, &look, nullptr) > 0) {
      char text[256];
      const ssize_t size = ::read(STDIN_FILENO, text, sizeof text);
      if (size <= 0) return 0;
      typed.append(text, static_cast<std::size_t>(size));
      for (std::size_t end = typed.find('\n'); end != std::string::npos; end = typed.find('\n')) {
        obey(typed.substr(0, end), sensors, rises, last_rise);
        typed.erase(0, end + 1);
      }
    }
    const bool high = line.is_high();
    const std::int64_t now = monotonic_ns();
    if (high && !was_high) {
      last_rise = now;
      ++rises;
      for (Sensor& sensor : sensors) sensor.rise(rises, now);
    }
    was_high = high;
    for (Sensor& sensor : sensors) sensor.go_on(now);
  }
}

}  // namespace
}  // namespace stereotrack

int main(int count, char** words) {
  if (count != 7) {
    (void)std::fprintf(stderr, "usage: sensors_on_line VALUE_FILE LEFT_DEVICE RIGHT_DEVICE WIDTH HEIGHT FPS\n");
    return 2;
  }
  try {
    return stereotrack::run(words);
  } catch (const std::exception& error) {
    (void)std::fprintf(stderr, "sensors_on_line: %s\n", error.what());
    return 1;
  }
}
