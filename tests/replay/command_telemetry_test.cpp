// Sender and receiver of the telemetry as two programs over loopback.
#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <set>

#include "tests/replay/command_support.hpp"

namespace stereotrack::test {
namespace {

int free_port() {
  const int fd = socket(AF_INET, SOCK_DGRAM, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof address;
  const bool bound = bind(fd, reinterpret_cast<const sockaddr*>(&address), size) == 0 &&
                     getsockname(fd, reinterpret_cast<sockaddr*>(&address), &size) == 0;
  (void)close(fd);
  if (!bound) throw std::runtime_error("no free UDP port on 127.0.0.1");
  return ntohs(address.sin_port);
}

TEST(Telemetry, MonitorReceivesEveryPairOfAReplayInRealTime) {
  constexpr int kPairs = 40;
  const TempDir folder;
  SmallScene::write(folder / "scene", kPairs);
  const std::string address = "127.0.0.1:" + std::to_string(free_port());
  Program monitor(
      command({"monitor", "--listen", address, "--count", std::to_string(kPairs), "--json", "--timeout", "30"}));
  const auto start = std::chrono::steady_clock::now();
  while (monitor.err_so_far().find("listening on " + address) == std::string::npos) {
    ASSERT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(30));
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }

  const auto sending = std::chrono::steady_clock::now();
  const ProgramResult sent =
      stereotrack_command({"replay", (folder / "scene").string(), "--pace", "real", "--out", (folder / "out").string(),
                           "--set", "telemetry.destinations=" + address});
  const std::chrono::duration<double> took = std::chrono::steady_clock::now() - sending;
  const ProgramResult received = monitor.wait();

  ASSERT_EQ(sent.exit_code, 0) << sent.err;
  ASSERT_EQ(received.exit_code, 0) << received.err;
  EXPECT_GE(took.count(), (kPairs - 1) / 30.0) << "faster than real time";
  const nlohmann::ordered_json summary = summary_of(folder / "out");
  EXPECT_EQ(summary["frames"], kPairs);
  EXPECT_EQ(summary["drops"]["telemetry_failed"], 0);
  EXPECT_NE(received.err.find("received " + std::to_string(kPairs) + " pairs in"), std::string::npos) << received.err;
  EXPECT_NE(received.err.find("lost 0, refused 0"), std::string::npos) << received.err;

  std::set<std::uint64_t> ordinals;
  std::size_t datagrams = 0;
  std::size_t confirmed = 0;
  std::istringstream lines(received.out);
  for (std::string line; std::getline(lines, line); ++datagrams) {
    const nlohmann::json datagram = nlohmann::json::parse(line);
    ordinals.insert(datagram["ordinal"].get<std::uint64_t>());
    for (const auto& target : datagram["targets"]) confirmed += target["state"] == "confirmed" ? 1U : 0U;
  }
  EXPECT_EQ(ordinals.size(), std::size_t{kPairs});
  EXPECT_EQ(*ordinals.begin(), 1U);
  EXPECT_EQ(*ordinals.rbegin(), std::uint64_t{kPairs});
  EXPECT_EQ(summary["telemetry_datagrams"], datagrams);
  EXPECT_GT(confirmed, 5U);
}

TEST(Telemetry, MonitorThatHearsNothingFailsAfterItsTimeout) {
  const ProgramResult result =
      stereotrack_command({"monitor", "--listen", "127.0.0.1:" + std::to_string(free_port()), "--timeout", "0.2"});
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_NE(result.err.find("nothing valid received"), std::string::npos) << result.err;
}

TEST(Telemetry, MonitorWithAKeyRefusesAReplayWhichIsNeverSigned) {
  const TempDir folder;
  SmallScene::write(folder / "scene", 3);
  const std::string key = folder.write("telemetry.key", "1 " + std::string(64, 'a') + "\n").string();
  fs::permissions(key, fs::perms::owner_read);
  const std::string address = "127.0.0.1:" + std::to_string(free_port());
  ProgramOptions options;
  options.signal = SIGINT;  // when it is waited for, that is after the replay
  options.signal_after = std::chrono::milliseconds(200);
  Program monitor(command({"monitor", "--listen", address, "--key-file", key, "--state", (folder / "seen").string()}),
                  options);
  const auto start = std::chrono::steady_clock::now();
  while (monitor.err_so_far().find("listening on " + address) == std::string::npos) {
    ASSERT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(30));
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  const ProgramResult sent =
      stereotrack_command({"replay", (folder / "scene").string(), "--pace", "real", "--set",
                           "telemetry.destinations=" + address, "--set", "telemetry.key_file=" + key});
  const ProgramResult received = monitor.wait();
  EXPECT_EQ(sent.exit_code, 0) << sent.err;
  EXPECT_EQ(received.exit_code, 0) << received.err;
  EXPECT_NE(received.out.find("received 0 pairs in 3 datagrams, lost 0, refused 3 (3 unsigned)"), std::string::npos)
      << received.out;
}

TEST(Telemetry, KeyFilesThatCannotBeUsedExitWithTwoAndOneLine) {
  const TempDir folder;
  const std::string key = folder.write("telemetry.key", "1 " + std::string(64, 'a') + "\n").string();
  fs::permissions(key, fs::perms::owner_read | fs::perms::others_read);
  ProgramResult result = stereotrack_command({"monitor", "--listen", "127.0.0.1:0", "--key-file", key});
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_EQ(result.err, "stereotrack: key file " + key + ": others may read or write it; run: chmod 600 " + key + "\n");

  fs::permissions(key, fs::perms::owner_read);
  const std::string state = folder.write("state", "no marks\n").string();
  result = stereotrack_command({"monitor", "--listen", "127.0.0.1:0", "--key-file", key, "--state", state});
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_EQ(std::count(result.err.begin(), result.err.end(), '\n'), 1) << result.err;
  EXPECT_NE(result.err.find(state + ": line 1 is not RIG SESSION MESSAGE STATUS"), std::string::npos) << result.err;

  result = stereotrack_command({"monitor", "--listen", "127.0.0.1:0", "--state", state});
  EXPECT_EQ(result.exit_code, 2) << "marks without keys would be anybody's";
}

TEST(Telemetry, DestinationThatIsNoAddressExitsWithTwo) {
  const TempDir folder;
  SmallScene::write(folder / "scene", 2);
  const ProgramResult result = stereotrack_command(
      {"replay", (folder / "scene").string(), "--pace", "real", "--set", "telemetry.destinations=nowhere"});
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_TRUE(is_one_line(result.err));
  EXPECT_NE(result.err.find("telemetry.destinations"), std::string::npos) << result.err;
}

}  // namespace
}  // namespace stereotrack::test
