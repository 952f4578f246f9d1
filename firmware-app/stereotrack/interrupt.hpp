#pragma once

#include <array>
#include <chrono>
#include <csignal>

namespace stereotrack {

/// While it lives, ctrl-C and SIGTERM ask for an end instead of ending the program: loops look at asked() and leave in
/// order. A second one ends at once, as usual. The handlers of before come back at the end. One at a time.
class Interrupts {
 public:
  Interrupts();
  Interrupts(const Interrupts&) = delete;
  Interrupts& operator=(const Interrupts&) = delete;
  ~Interrupts();

  [[nodiscard]] bool asked() const noexcept;

  /// Until `fd` can be read, asked() turns true or the time is over. Not if asked() is true already.
  void wait(int fd, std::chrono::nanoseconds longest) const;

 private:
  static constexpr std::array<int, 2> kSignals{SIGINT, SIGTERM};
  std::array<struct sigaction, 2> before_{};
};

}  // namespace stereotrack
