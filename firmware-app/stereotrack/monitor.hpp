#pragma once

#include <cstdint>
#include <iosfwd>
#include <string>

namespace stereotrack {

/// `stereotrack monitor [--listen ADDR:PORT] [--json] [--count N] [--timeout SECONDS] [--key-file FILE [--state FILE]]`
struct MonitorArguments {
  std::string listen = "127.0.0.1:47800";  ///< IPv6 in brackets; a multicast address is joined
  bool json = false;                       ///< one JSON object a datagram and line
  bool live = false;                       ///< a table redrawn in place: for a terminal; else a line a pair
  std::uint64_t count = 0;                 ///< end after so many complete pairs; 0 = do not
  double timeout_s = 0;                    ///< fail if nothing valid comes for so long; 0 = wait for ever
  std::string key_file{};                  ///< only what is signed with one of its keys is taken; empty: all is
  std::string state{};                     ///< keeps what was seen, to refuse it after a restart too; empty: no
};

/// Shows the telemetry that arrives until ctrl-C (SIGINT, SIGTERM), `count` or `timeout_s`. Then one
/// summary line (received, lost, refused with their causes, duplicates) on `out`, with json on `messages`.
/// A status is a sign of life, but no pair to count. `state` is written every 5 s and at the end: after a crash at
/// most 5 s of what was seen could be replayed. Answers the exit code: 0; 1 after a time-out, or if `state` could
/// not be written at the end, said in one line on `messages`. Throws telemetry::EndpointError if `listen` is not
/// ADDR:PORT, KeyFileError, MarksFileError (bad usage), std::runtime_error if it cannot be listened on (port in use).
int run_monitor(const MonitorArguments& arguments, std::ostream& out, std::ostream& messages);

}  // namespace stereotrack
