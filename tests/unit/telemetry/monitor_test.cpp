#include "firmware-app/stereotrack/monitor.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <pthread.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <csignal>
#include <sstream>
#include <thread>

#include "drivers/telemetry/udp_listener.hpp"
#include "drivers/telemetry/udp_sender.hpp"
#include "tests/unit/telemetry/messages.hpp"

namespace stereotrack {
namespace {

using telemetry::Bytes;
using testing::HasSubstr;
using testing::StartsWith;

/// A port that was free a moment ago.
std::string free_port() {
  return to_string(telemetry::UdpListener(telemetry::parse_endpoint("127.0.0.1:0", true)).local());
}

struct Outcome {
  int exit_code = -1;
  std::string out;
  std::string messages;
};

/// Runs the monitor in this thread while another one sends `datagrams`, in a circle, until it ends.
Outcome run_with(MonitorArguments arguments, const std::vector<Bytes>& datagrams, int signal_after_ms = -1) {
  arguments.listen = free_port();
  std::ostringstream out;
  std::ostringstream messages;
  std::atomic<bool> done = false;
  const pthread_t monitor = pthread_self();
  std::thread sender([&] {
    const std::array to{telemetry::parse_endpoint(arguments.listen)};
    telemetry::UdpSender udp(to);
    const auto begin = std::chrono::steady_clock::now();
    bool signalled = false;
    for (std::size_t i = 0; !done; ++i) {
      if (!datagrams.empty()) udp.send(datagrams[i % datagrams.size()]);
      std::this_thread::sleep_for(std::chrono::milliseconds(2));
      const auto passed = std::chrono::steady_clock::now() - begin;
      if (signal_after_ms >= 0 && !signalled && passed > std::chrono::milliseconds(signal_after_ms)) {
        pthread_kill(monitor, SIGINT);
        signalled = true;
      }
    }
  });
  Outcome run;
  run.exit_code = run_monitor(arguments, out, messages);
  done = true;
  sender.join();
  run.out = out.str();
  run.messages = messages.str();
  return run;
}

std::vector<Bytes> long_stream(std::uint32_t targets) {
  telemetry::Encoder encoder(telemetry::kGoldenConfig);
  const auto list = telemetry::tracks(targets);
  std::vector<Bytes> all;
  for (std::uint64_t i = 1; i <= 5000; ++i) {
    telemetry::Message message = telemetry::golden_message(list);
    message.ordinal = i;
    for (Bytes& bytes : telemetry::encode(encoder, message)) all.push_back(std::move(bytes));
  }
  return all;
}

TEST(Monitor, PrintsALineAPairAndEndsAfterCount) {
  const Outcome run = run_with({.count = 3}, long_stream(1));
  EXPECT_EQ(run.exit_code, 0);
  EXPECT_THAT(run.out, HasSubstr("latency 50.0 ms  lost 0  targets 1  flags no-colour,skipped-before  | 1 confirmed"));
  EXPECT_THAT(run.out, HasSubstr("received 3 pairs in 3 datagrams, lost 0, refused 0, duplicates 0"));
  EXPECT_EQ(std::count(run.out.begin(), run.out.end(), '\n'), 4);
  EXPECT_THAT(run.messages, HasSubstr("listening on 127.0.0.1:"));
}

TEST(Monitor, JsonIsOneObjectADatagramAndNothingElse) {
  const auto list = telemetry::golden_tracks();
  telemetry::Encoder encoder(telemetry::kGoldenConfig);
  std::vector<Bytes> pairs;
  pairs.reserve(2000);
  for (int i = 0; i < 2000; ++i) pairs.push_back(telemetry::encode(encoder, telemetry::golden_message(list))[0]);
  const Outcome run = run_with({.json = true, .count = 1}, pairs);
  EXPECT_EQ(run.exit_code, 0);
  EXPECT_EQ(std::count(run.out.begin(), run.out.end(), '\n'), 1);
  EXPECT_THAT(run.out, StartsWith("{\"schema\":1,\"rig\":9,\"session\":81985529216486895,\"sequence\":"));
  EXPECT_THAT(
      run.out,
      HasSubstr(
          "\"capture_time_ns\":1700000000123456789,\"send_time_ns\":1700000000173456789,\"latency_ns\":50000000"));
  EXPECT_THAT(run.out, HasSubstr("{\"id\":7,\"state\":\"confirmed\",\"measured\":true,\"has_depth\":true,\"age_s\":1.5,"
                                 "\"confidence\":0.75,\"box\":[100,50,40,80],\"position\":[3,4,12],"
                                 "\"velocity\":[0.5,-0.25,2],\"distance\":13,\"covariance\":[4,0,3,"));
  EXPECT_THAT(run.out, HasSubstr("{\"id\":300,\"state\":\"coasting\",\"measured\":false,\"has_depth\":false,"
                                 "\"age_s\":1.5,\"confidence\":0.75,\"box\":[100,50,40,80]}]}\n"));
  EXPECT_THAT(run.messages, HasSubstr("received 1 pairs"));
}

TEST(Monitor, LiveTableIsRedrawnInPlace) {
  const Outcome run = run_with({.live = true, .count = 200}, long_stream(2));
  EXPECT_EQ(run.exit_code, 0);
  EXPECT_THAT(run.out, HasSubstr("\x1b[5A\r")) << "title, rig, columns and two targets are written over";
  EXPECT_THAT(run.out, HasSubstr("rig 9  session 81985529216486895  pair "));
  EXPECT_THAT(run.out,
              HasSubstr("     1  confirmed     1.5      1.50      2.00      0.50      2.55      1.04        0.75"));
}

TEST(Monitor, CtrlCEndsWithTheSummaryAndExitCode0) {
  const Outcome run = run_with({}, long_stream(1), 200);
  EXPECT_EQ(run.exit_code, 0);
  EXPECT_THAT(run.out, HasSubstr("received "));
  EXPECT_THAT(run.out, HasSubstr(", refused 0, duplicates 0"));
}

TEST(Monitor, GarbageIsRefusedCountedAndNoSignOfLife) {
  const Outcome run = run_with({.timeout_s = 0.3}, {Bytes(50, std::byte{0xFF}), Bytes(1500)});
  EXPECT_EQ(run.exit_code, 1);
  EXPECT_THAT(run.out, testing::ContainsRegex("refused [0-9]+ \\([0-9]+ oversized, [0-9]+ malformed\\)"));
  EXPECT_THAT(run.messages, HasSubstr("nothing valid received on 127.0.0.1:"));
  EXPECT_THAT(run.messages, HasSubstr("for 0.3 s"));
}

TEST(Monitor, SilenceBeyondTheTimeoutIsExitCode1) {
  const Outcome run = run_with({.timeout_s = 0.2}, {});
  EXPECT_EQ(run.exit_code, 1);
  EXPECT_THAT(run.messages, HasSubstr("is a sender running"));
}

TEST(Monitor, WrongAddressAndTakenPortAreOneLineEach) {
  std::ostringstream out;
  EXPECT_THROW(run_monitor({.listen = "nonsense"}, out, out), telemetry::EndpointError);
  const telemetry::UdpListener other(telemetry::parse_endpoint("127.0.0.1:0", true));
  try {
    run_monitor({.listen = to_string(other.local())}, out, out);
    FAIL();
  } catch (const std::runtime_error& error) {
    EXPECT_THAT(error.what(), HasSubstr("another program has this port"));
    EXPECT_EQ(std::string(error.what()).find('\n'), std::string::npos);
  }
}

}  // namespace
}  // namespace stereotrack
