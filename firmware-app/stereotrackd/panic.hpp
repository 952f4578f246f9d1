#pragma once

#include <string>

#include "firmware-app/stereotrackd/daemon.hpp"

namespace stereotrack::daemon {

/// While it lives, a fault of the program (SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT, which std::terminate ends in)
/// first drives all lines to their safe states, then writes the last outputs to stderr and to `path`, and only then
/// ends the process as it would have. A handler may do little: it calls ioctl(2) through the lines and write(2), and
/// takes no memory. `path` is written on a fault alone. SIGKILL and a dead kernel are the business of ExecStopPost and
/// of pulls on the lines. One instance at a time, of the main thread.
class Panic {
 public:
  /// Throws std::runtime_error where the file cannot be made.
  Panic(Daemon& daemon, const std::string& path);
  Panic(const Panic&) = delete;
  Panic& operator=(const Panic&) = delete;
  ~Panic();

 private:
  std::string path_;
};

}  // namespace stereotrack::daemon
