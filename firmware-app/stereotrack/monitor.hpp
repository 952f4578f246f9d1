#pragma once

#include <cstdint>
#include <iosfwd>
#include <string>

namespace stereotrack {

/// `stereotrack monitor [--listen ADDR:PORT] [--json] [--count N] [--timeout SECONDS]`
struct MonitorArguments {
  std::string listen = "127.0.0.1:47800";  ///< IPv6 in brackets; a multicast address is joined
  bool json = false;                       ///< one JSON object a datagram and line
  bool live = false;                       ///< a table redrawn in place: for a terminal; else a line a pair
  std::uint64_t count = 0;                 ///< end after so many complete pairs; 0 = do not
  double timeout_s = 0;                    ///< fail if nothing valid comes for so long; 0 = wait for ever
};

/// Shows the telemetry that arrives until ctrl-C (SIGINT, SIGTERM), `count` or `timeout_s`. Then one
/// summary line (received, lost, refused, duplicates) on `out`, with json on `messages`. Answers the exit
/// code: 0; 1 after a time-out, said in one line on `messages`. Throws telemetry::EndpointError if `listen`
/// is not ADDR:PORT (bad usage), std::runtime_error if it cannot be listened on (port in use).
int run_monitor(const MonitorArguments& arguments, std::ostream& out, std::ostream& messages);

}  // namespace stereotrack
