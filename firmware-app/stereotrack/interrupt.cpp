#include "firmware-app/stereotrack/interrupt.hpp"

#include <poll.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>

namespace stereotrack {

namespace {

volatile std::sig_atomic_t asked_for_end = 0;

}  // namespace

Interrupts::Interrupts() {
  asked_for_end = 0;
  struct sigaction action {};
  action.sa_handler = [](int) { asked_for_end = 1; };
  action.sa_flags = SA_RESTART | static_cast<int>(SA_RESETHAND);
  for (std::size_t i = 0; i < kSignals.size(); ++i) sigaction(kSignals[i], &action, &before_[i]);
}

Interrupts::~Interrupts() {
  for (std::size_t i = 0; i < kSignals.size(); ++i) sigaction(kSignals[i], &before_[i], nullptr);
}

bool Interrupts::asked() const noexcept { return asked_for_end != 0; }

void Interrupts::wait(int fd, std::chrono::nanoseconds longest) const {
  // Blocked but while waiting, so that none falls between the question and the wait.
  sigset_t blocked;
  sigset_t before;
  sigemptyset(&blocked);
  for (const int signal : kSignals) sigaddset(&blocked, signal);
  pthread_sigmask(SIG_BLOCK, &blocked, &before);
  if (!asked()) {
    const std::int64_t ns = std::max(longest.count(), std::int64_t{0});
    const timespec time{static_cast<time_t>(ns / 1'000'000'000), static_cast<long>(ns % 1'000'000'000)};
    pollfd poll{fd, POLLIN, 0};
    (void)ppoll(&poll, 1, &time, &before);
  }
  pthread_sigmask(SIG_SETMASK, &before, nullptr);
}

}  // namespace stereotrack
