#include "firmware-app/stereotrack/monitor.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <pthread.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <csignal>
#include <filesystem>
#include <span>
#include <sstream>
#include <thread>

#include "drivers/telemetry/authentication.hpp"
#include "drivers/telemetry/replay_guard.hpp"
#include "drivers/telemetry/udp_listener.hpp"
#include "drivers/telemetry/udp_sender.hpp"
#include "tests/support/temp_dir.hpp"
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

/// `count` messages of a live rig and a status after each, signed.
std::vector<Bytes> live_stream(int count, std::uint64_t session = 7, telemetry::Key key = telemetry::kGoldenKey) {
  const telemetry::Signer signer(key);
  telemetry::Encoder encoder({.rig = 9, .session = session, .signer = &signer});
  const auto list = telemetry::tracks(1);
  std::vector<Bytes> all;
  all.reserve(2 * static_cast<std::size_t>(count));
  for (int i = 0; i < count; ++i) {
    all.push_back(telemetry::encode(encoder, telemetry::golden_live_message(list))[0]);
    all.push_back(telemetry::encode_status(encoder, telemetry::golden_status(), telemetry::golden_live_without_pair()));
  }
  return all;
}

TEST(Monitor, WhatALiveRigAddsIsShown) {
  const Outcome run = run_with({.count = 3}, live_stream(2000));
  EXPECT_EQ(run.exit_code, 0);
  EXPECT_THAT(
      run.out,
      HasSubstr("flags no-colour,skipped-before,pair-missing,predicted,effort-shed,clock-stepped  skew -12.0 us  "
                "exposures 8.0 8.1 ms  send error +35.0 us  TAI +-1.5 us  shed corners,dense_map  "
                "health skew,effort-shed  | 1 confirmed"));
  EXPECT_THAT(run.out, HasSubstr("up 1d 00:00:00  pairs captured 2592000 evicted 11 skipped 12 starved 13  "
                                 "outputs on time 5000000000 predicted 16 missing 17 overslept 18  "
                                 "health deadlines-missed,not-real-time  compute 9.0 11.0 19.0 ms  "
                                 "send error 6 30 120 us (p50 p99 max)  allocations 21  buffers free at least 5 of 8  "
                                 "shed level_set  dropped telemetry 47 recording 25 lines 26\n"));
  EXPECT_THAT(run.out, testing::ContainsRegex("received 3 pairs and [23] statuses in [56] datagrams, lost 0"));
  EXPECT_THAT(run.messages, HasSubstr("signed with key 3, which is not checked: give --key-file\n"));
}

TEST(Monitor, AFlagWithoutANameIsShownAsANumber) {
  telemetry::Encoder encoder(telemetry::kGoldenConfig);
  telemetry::Message message;
  message.flags = telemetry::kStateAtOutput | 0x80000U;
  std::vector<Bytes> all;
  all.reserve(2000);
  for (int i = 0; i < 2000; ++i) all.push_back(telemetry::encode(encoder, message)[0]);
  EXPECT_THAT(run_with({.count = 1}, all).out, HasSubstr("flags state-at-output,0x80000\n"));
}

TEST(Monitor, JsonOfALiveRigHasTheNamesOfTheSchema) {
  const Outcome run = run_with({.json = true, .count = 3}, live_stream(2000));
  EXPECT_EQ(run.exit_code, 0);
  EXPECT_THAT(run.out, HasSubstr(",\"flags\":978,"));
  EXPECT_THAT(run.out,
              HasSubstr(",\"unit_m\":0.5,\"live\":{\"tai_offset_ns\":1700000037000000001,\"tai_error_ns\":1500,"
                        "\"pair_skew_ns\":-12000,\"exposure_left_us\":8000,\"exposure_right_us\":8100,"
                        "\"send_error_ns\":35000,\"efforts_shed\":10,\"health\":136},\"targets\":["));
  EXPECT_THAT(run.out,
              HasSubstr("{\"schema\":1,\"rig\":9,\"session\":7,\"send_time_ns\":0,"
                        "\"live\":{\"tai_offset_ns\":1700000037000000001,\"tai_error_ns\":1500,"
                        "\"send_error_ns\":35000,\"efforts_shed\":10,\"health\":136},\"status\":{\"sequence\":"));
  EXPECT_THAT(run.out, HasSubstr(",\"uptime_ms\":86400000,\"health\":2112,\"efforts_shed\":1,\"latency_us\":50000,"));
  EXPECT_THAT(run.out, HasSubstr(",\"send_error_max_us\":120,\"skew_max_us\":40,\"trigger_pulses\":0,"));
}

TEST(Monitor, LiveTableShowsHealthAndStatus) {
  const Outcome run = run_with({.live = true, .count = 100}, live_stream(2000));
  EXPECT_EQ(run.exit_code, 0);
  EXPECT_THAT(run.out, HasSubstr("  skew -12.0 us  exposures 8.0 8.1 ms  send error +35.0 us"));
  EXPECT_THAT(run.out, HasSubstr("  up 1d 00:00:00  pairs captured 2592000"));
  EXPECT_EQ(run.out.find("not checked"), std::string::npos);
}

TEST(Monitor, StatusesAloneAreASignOfLifeAndNoPairs) {
  std::vector<Bytes> statuses;
  const auto all = live_stream(2000);
  statuses.reserve(all.size() / 2);
  for (std::size_t i = 1; i < all.size(); i += 2) statuses.push_back(all[i]);
  const Outcome run = run_with({.count = 1, .timeout_s = 0.15}, statuses, 500);
  EXPECT_EQ(run.exit_code, 0) << "ended by the signal, not by the time-out";
  EXPECT_THAT(run.out, HasSubstr("received 0 pairs and "));
}

class KeyedMonitor : public testing::Test {
 protected:
  static std::string write_key(const test::TempDir& folder, const char* name, const telemetry::Key& key) {
    const auto file = folder.write(
        name, std::to_string(key.id) + ' ' + telemetry::to_hex(std::as_bytes(std::span(key.secret))) + '\n');
    std::filesystem::permissions(file, std::filesystem::perms::owner_read);
    return file.string();
  }
  test::TempDir folder_;
  std::string key_file_ = write_key(folder_, "key", telemetry::kGoldenKey);
};

TEST_F(KeyedMonitor, EachForgedAlteredCutOrReplayedDatagramIsRefusedAndCountedByItsCause) {
  const auto good = live_stream(3);
  Bytes altered = live_stream(4)[6];
  altered[30] ^= std::byte{1};
  Bytes cut = live_stream(4)[6];
  cut.resize(cut.size() - 10);
  const Bytes other_key = live_stream(1, 7, {.id = 4, .secret = telemetry::kGoldenKey.secret})[0];
  const Bytes forged = live_stream(4, 7, {.id = 3, .secret = {}})[6];
  telemetry::Encoder plain({.rig = 9, .session = 8});
  const Bytes without = telemetry::encode(plain, {})[0];
  const Bytes old = live_stream(1, 6)[0];
  std::vector<Bytes> all = good;
  all.insert(all.end(), {altered, cut, other_key, forged, without, old});
  // Whichever of them comes first: session 7 has been there.
  const std::string state = (folder_ / "state").string();
  telemetry::save_marks(state, std::vector<telemetry::Mark>{{.rig = 9, .session = 7}});
  const Outcome run = run_with({.timeout_s = 0.4, .key_file = key_file_, .state = state}, all);
  EXPECT_EQ(run.exit_code, 1) << "refused ones are no sign of life";
  EXPECT_THAT(run.out, HasSubstr("received 3 pairs and 3 statuses in "));
  EXPECT_THAT(run.out,
              testing::ContainsRegex("refused [0-9]+ \\([0-9]+ truncated, [0-9]+ unsigned, [0-9]+ unknown key, "
                                     "[0-9]+ forged, [0-9]+ replayed, [0-9]+ old session\\)"));
  EXPECT_EQ(run.messages.find("not checked"), std::string::npos);
}

TEST_F(KeyedMonitor, RefusalsAreShownWhereNothingElseIs) {
  const auto unsigned_ones = long_stream(1);
  const Outcome table = run_with({.live = true, .timeout_s = 0.3, .key_file = key_file_}, unsigned_ones);
  EXPECT_THAT(table.out, testing::ContainsRegex("ctrl-C ends  refused [0-9]+ \\([0-9]+ unsigned\\)"));
  EXPECT_THAT(table.out, HasSubstr("nothing received yet"));
  EXPECT_THAT(table.messages,
              testing::ContainsRegex("nothing valid received on .* for 0.3 s, refused [0-9]+ "
                                     "\\([0-9]+ unsigned\\): does the sender sign with a key of .*key"));
}

TEST_F(KeyedMonitor, JsonSaysWhichKeyWasVerified) {
  const Outcome run = run_with({.json = true, .count = 1, .key_file = key_file_}, live_stream(2000));
  EXPECT_EQ(run.exit_code, 0);
  EXPECT_THAT(run.out, HasSubstr("\"session\":7,\"key_id\":3,"));
}

TEST_F(KeyedMonitor, WithAStateFileWhatWasSeenIsRefusedAfterARestart) {
  const std::string state = (folder_ / "state").string();
  const auto stream = live_stream(3);
  const MonitorArguments arguments{.count = 3, .key_file = key_file_, .state = state};
  EXPECT_EQ(run_with(arguments, stream).exit_code, 0);
  EXPECT_EQ(telemetry::load_marks(state).at(0).session, 7U);

  MonitorArguments again = arguments;
  again.timeout_s = 0.3;
  const Outcome replayed = run_with(again, stream);
  EXPECT_EQ(replayed.exit_code, 1);
  EXPECT_THAT(replayed.out, HasSubstr("received 0 pairs"));
  EXPECT_EQ(run_with(again, live_stream(100, 6)).exit_code, 1) << "an older session";
  EXPECT_EQ(run_with(again, live_stream(100, 8)).exit_code, 0);
  EXPECT_EQ(telemetry::load_marks(state).at(0).session, 8U);
}

TEST_F(KeyedMonitor, FilesThatCannotBeUsedAreSaidBeforeListening) {
  std::ostringstream out;
  EXPECT_THROW(run_monitor({.listen = "127.0.0.1:0", .key_file = (folder_ / "none").string()}, out, out),
               telemetry::KeyFileError);
  EXPECT_THROW(
      run_monitor({.listen = "127.0.0.1:0", .key_file = key_file_, .state = (folder_ / "none" / "state").string()}, out,
                  out),
      telemetry::MarksFileError);
  const auto bad = folder_.write("bad", "no marks\n");
  EXPECT_THROW(run_monitor({.listen = "127.0.0.1:0", .key_file = key_file_, .state = bad.string()}, out, out),
               telemetry::MarksFileError);
  EXPECT_EQ(out.str(), "");
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
