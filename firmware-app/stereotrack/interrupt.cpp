#include "firmware-app/stereotrack/interrupt.hpp"

#include <csignal>

namespace stereotrack {

namespace {

volatile std::sig_atomic_t asked = 0;

void ask(int signal_number) {
  asked = 1;
  (void)std::signal(signal_number, SIG_DFL);
}

}  // namespace

void catch_interrupts() {
  (void)std::signal(SIGINT, ask);
  (void)std::signal(SIGTERM, ask);
}

bool interrupted() noexcept { return asked != 0; }

}  // namespace stereotrack
