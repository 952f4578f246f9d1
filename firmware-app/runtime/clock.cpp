#include "firmware-app/runtime/clock.hpp"

#include <sys/timex.h>

#include <cerrno>
#include <ctime>

namespace stereotrack::runtime {

namespace {

std::chrono::nanoseconds read(clockid_t clock) noexcept {
  timespec now{};
  (void)clock_gettime(clock, &now);  // cannot fail with these clocks and a valid address
  return std::chrono::seconds(now.tv_sec) + std::chrono::nanoseconds(now.tv_nsec);
}

}  // namespace

MonotonicTime monotonic_now() noexcept { return MonotonicTime(read(CLOCK_MONOTONIC)); }

void sleep_until(MonotonicTime moment) noexcept {
  const auto since = moment.time_since_epoch();
  if (since.count() < 0) return;
  const auto whole = std::chrono::floor<std::chrono::seconds>(since);
  const timespec until{static_cast<time_t>(whole.count()), static_cast<long>((since - whole).count())};
  while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, nullptr) == EINTR) {
  }
}

void sleep_until(MonotonicTime moment, std::chrono::nanoseconds awake) noexcept {
  sleep_until(moment - awake);
  while (monotonic_now() < moment) {
  }
}

TaiReading read_tai() noexcept {
  const std::chrono::nanoseconds before = read(CLOCK_MONOTONIC);
  const std::chrono::nanoseconds tai = read(CLOCK_TAI);
  const std::chrono::nanoseconds after = read(CLOCK_MONOTONIC);
  TaiReading reading;
  reading.offset = tai - (before + (after - before) / 2);
  timex kernel{};
  const int state = adjtimex(&kernel);
  const bool kept = state >= 0 && state != TIME_ERROR && (kernel.status & STA_UNSYNC) == 0;
  if (kept && kernel.tai != 0) reading.error = std::chrono::microseconds(kernel.esterror) + (after - before) / 2;
  return reading;
}

}  // namespace stereotrack::runtime
