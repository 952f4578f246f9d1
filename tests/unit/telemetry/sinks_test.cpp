#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <string>

#include "drivers/telemetry/file_sink.hpp"
#include "drivers/telemetry/receiver.hpp"
#include "drivers/telemetry/udp_listener.hpp"
#include "drivers/telemetry/udp_sender.hpp"
#include "tests/unit/telemetry/messages.hpp"

namespace stereotrack::telemetry {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

class Folder {
 public:
  Folder() {
    std::string name = (fs::temp_directory_path() / "stereotrack-XXXXXX").string();
    if (mkdtemp(name.data()) == nullptr) throw std::runtime_error("no temporary folder");
    path_ = name;
  }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;
  ~Folder() { fs::remove_all(path_); }
  [[nodiscard]] const fs::path& path() const { return path_; }

 private:
  fs::path path_;
};

/// The next datagram, waiting up to 5 s for it; empty if none comes.
Bytes next(UdpListener& listener) {
  pollfd poll{listener.fd(), POLLIN, 0};
  if (::poll(&poll, 1, 5000) != 1) return {};
  Bytes bytes(2048);
  const std::ptrdiff_t size = listener.receive(bytes);
  bytes.resize(size < 0 ? 0 : static_cast<std::size_t>(size));
  return bytes;
}

std::string message_of(std::string_view text) {
  try {
    (void)parse_endpoint(text);
  } catch (const EndpointError& error) {
    return error.what();
  }
  return "accepted";
}

TEST(Endpoint, AddressesOfBothFamiliesRoundTrip) {
  for (const char* text : {"127.0.0.1:47800", "[::1]:47800", "239.1.2.3:1", "[ff02::1%lo]:65535", "224.0.0.1%lo:9"}) {
    EXPECT_EQ(to_string(parse_endpoint(text)), text);
  }
  EXPECT_FALSE(parse_endpoint("127.0.0.1:1").is_multicast());
  EXPECT_TRUE(parse_endpoint("239.1.2.3:1").is_multicast());
  EXPECT_FALSE(parse_endpoint("[::1]:1").is_multicast());
  EXPECT_TRUE(parse_endpoint("[ff02::1]:1").is_multicast());
}

TEST(Endpoint, AListIsReadInItsOrderAndItsMistakeIsNamed) {
  const std::vector<std::string> good{"127.0.0.1:1", "239.1.2.3%lo:2"};
  const auto endpoints = parse_endpoints(good);
  ASSERT_EQ(endpoints.size(), 2U);
  EXPECT_EQ(to_string(endpoints[0]), good[0]);
  EXPECT_EQ(to_string(endpoints[1]), good[1]);
  EXPECT_TRUE(parse_endpoints({}).empty());
  const std::vector<std::string> bad{"127.0.0.1:1", "rig:2"};
  EXPECT_THROW((void)parse_endpoints(bad), EndpointError);
}

TEST(Endpoint, EachMistakeIsNamed) {
  EXPECT_THAT(message_of("127.0.0.1"), HasSubstr("'127.0.0.1' is not ADDR:PORT: no port"));
  EXPECT_THAT(message_of(""), HasSubstr("no port"));
  EXPECT_THAT(message_of("::1:47800"), HasSubstr("stands in brackets"));
  EXPECT_THAT(message_of("[::1]47800"), HasSubstr("no port after the bracket"));
  EXPECT_THAT(message_of("[::1:47800"), HasSubstr("not closed"));
  EXPECT_THAT(message_of("localhost:47800"), HasSubstr("'localhost' is no numeric IPv4 address"));
  EXPECT_THAT(message_of("[::g]:47800"), HasSubstr("'::g' is no numeric IPv6 address"));
  EXPECT_THAT(message_of("239.1.2.3%nosuch0:1"), HasSubstr("no network interface 'nosuch0'"));
  for (const char* text : {"127.0.0.1:", "127.0.0.1:0", "127.0.0.1:65536", "127.0.0.1:-1", "127.0.0.1:80x"}) {
    EXPECT_THAT(message_of(text), HasSubstr("1 to 65535")) << text;
  }
}

void expect_loopback_accounts_for_losses(const char* local) {
  UdpListener listener(parse_endpoint(local, true));
  const std::array to{listener.local()};
  UdpSender sender(to);
  Encoder encoder(kGoldenConfig);
  Receiver receiver;
  const auto list = tracks(9);
  Message message;
  message.tracks = list;
  std::uint64_t sent = 0;
  for (int i = 1; i <= 30; ++i) {
    message.ordinal = static_cast<std::uint64_t>(i);
    const auto datagrams = encode(encoder, message);
    if (i % 10 == 5) continue;  // lost on the way: 3 of them
    for (const Bytes& bytes : datagrams) {
      sender.send(bytes);
      ++sent;
      const Bytes got = next(listener);
      ASSERT_EQ(got, bytes);
      (void)receiver.accept(got);
    }
  }
  EXPECT_EQ(sender.counters().sent, sent);
  EXPECT_EQ(sender.counters().dropped + sender.counters().failed, 0U);
  EXPECT_EQ(receiver.counters().pairs, 27U);
  EXPECT_EQ(receiver.lost(), 3U);
}

TEST(UdpSender, LoopbackAccountsForLosses) { expect_loopback_accounts_for_losses("127.0.0.1:0"); }

TEST(UdpSender, LoopbackAccountsForLossesOverIpv6) {
  // Read: the size of what lies in /proc is zero, whatever it says.
  std::string address;
  if (!std::getline(std::ifstream("/proc/net/if_inet6"), address)) GTEST_SKIP() << "no IPv6 here";
  expect_loopback_accounts_for_losses("[::1]:0");
}

TEST(UdpSender, MulticastIsHeardOnThisMachine) {
  UdpListener listener(parse_endpoint("239.255.47.80%lo:0", true));
  const std::array to{listener.local()};
  UdpSender sender(to);
  const Bytes bytes(10, std::byte{7});
  sender.send(bytes);
  if (sender.counters().failed > 0) GTEST_SKIP() << "no multicast here: " << std::strerror(sender.last_error());
  EXPECT_EQ(next(listener), bytes);
}

/// The TTL or hop limit with which a datagram came; -1 if none did within 5 s.
int hops_of_next(UdpListener& listener) {
  pollfd poll{listener.fd(), POLLIN, 0};
  if (::poll(&poll, 1, 5000) != 1) return -1;
  std::array<char, 64> data{};
  alignas(cmsghdr) std::array<char, 128> control{};
  iovec part{data.data(), data.size()};
  msghdr message{};
  message.msg_iov = &part;
  message.msg_iovlen = 1;
  message.msg_control = control.data();
  message.msg_controllen = control.size();
  if (::recvmsg(listener.fd(), &message, MSG_DONTWAIT) < 0) return -1;
  for (cmsghdr* c = CMSG_FIRSTHDR(&message); c != nullptr; c = CMSG_NXTHDR(&message, c)) {
    if (c->cmsg_level == IPPROTO_IP && c->cmsg_type == IP_TTL) {
      int ttl = 0;
      std::memcpy(&ttl, CMSG_DATA(c), sizeof ttl);
      return ttl;
    }
  }
  return -1;
}

TEST(UdpSender, MulticastTakesAsManyHopsAsItIsToldOverTheInterfaceItIsTold) {
  UdpListener listener(parse_endpoint("239.255.47.81%lo:0", true));
  const int on = 1;
  ASSERT_EQ(::setsockopt(listener.fd(), IPPROTO_IP, IP_RECVTTL, &on, sizeof on), 0);
  const std::array to{listener.local()};
  for (const int hops : {1, 8, 255}) {
    UdpSender sender(to, {.multicast_hops = hops});
    sender.send(Bytes(10));
    if (sender.counters().failed > 0) GTEST_SKIP() << "no multicast here: " << std::strerror(sender.last_error());
    EXPECT_EQ(hops_of_next(listener), hops);
  }
  UdpSender local(to);
  local.send(Bytes(10));
  EXPECT_EQ(hops_of_next(listener), 1) << "stays in the local network";
}

TEST(UdpSender, HopsThatDoNotExistAreRefusedWithTheDestination) {
  const std::array to{parse_endpoint("239.255.47.81:9")};
  try {
    const UdpSender sender(to, {.multicast_hops = 256});
    FAIL();
  } catch (const std::runtime_error& error) {
    EXPECT_THAT(error.what(), HasSubstr("telemetry to 239.255.47.81:9: cannot set the multicast hops"));
  }
}

TEST(UdpSender, UnicastAndMulticastDestinationsGoTogether) {
  UdpListener unicast(parse_endpoint("127.0.0.1:0", true));
  UdpListener first(parse_endpoint("239.255.47.82%lo:0", true));
  UdpListener second(first.local());
  const std::array to{unicast.local(), first.local()};
  UdpSender sender(to);
  const Bytes bytes(10, std::byte{7});
  sender.send(bytes);
  if (sender.counters().failed > 0) GTEST_SKIP() << "no multicast here: " << std::strerror(sender.last_error());
  EXPECT_EQ(next(unicast), bytes);
  EXPECT_EQ(next(first), bytes);
  EXPECT_EQ(next(second), bytes) << "several listeners of a group on one machine";
  EXPECT_EQ(sender.counters().sent, 2U);
}

TEST(UdpSender, ADestinationThatIsFullDoesNotStarveTheOthers) {
  int full[2];
  int open[2];
  ASSERT_EQ(::socketpair(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0, full), 0);
  ASSERT_EQ(::socketpair(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0, open), 0);
  const Socket never_read(full[1]);
  const Socket reader(open[1]);
  const int least = 1;  // the kernel makes it its own minimum
  ASSERT_EQ(::setsockopt(full[0], SOL_SOCKET, SO_SNDBUF, &least, sizeof least), 0);
  std::vector<Socket> connected;
  connected.emplace_back(full[0]);
  connected.emplace_back(open[0]);
  UdpSender sender(std::move(connected));
  const Bytes bytes(kMaxDatagramBytes, std::byte{1});
  Bytes room(2048);
  for (int i = 0; i < 100; ++i) {
    sender.send(bytes);
    ASSERT_EQ(::recv(reader.fd(), room.data(), room.size(), MSG_DONTWAIT), static_cast<ssize_t>(bytes.size())) << i;
  }
  EXPECT_GT(sender.counters().dropped, 90U) << "a buffer of a few kilobytes";
  EXPECT_EQ(sender.counters().sent + sender.counters().dropped, 200U);
  EXPECT_EQ(sender.counters().failed, 0U);
}

TEST(UdpSender, EveryDestinationGetsEveryDatagram) {
  UdpListener a(parse_endpoint("127.0.0.1:0", true));
  UdpListener b(parse_endpoint("127.0.0.1:0", true));
  const std::array to{a.local(), b.local()};
  UdpSender sender(to);
  const Bytes bytes(10, std::byte{7});
  sender.send(bytes);
  EXPECT_EQ(next(a), bytes);
  EXPECT_EQ(next(b), bytes);
  EXPECT_EQ(sender.counters().sent, 2U);
}

TEST(UdpSender, NobodyListeningIsNoFailure) {
  Endpoint gone;
  {
    const UdpListener listener(parse_endpoint("127.0.0.1:0", true));
    gone = listener.local();
  }
  const std::array to{gone};
  UdpSender sender(to);
  for (int i = 0; i < 5; ++i) sender.send(Bytes(10));
  EXPECT_EQ(sender.counters().sent, 5U);
}

TEST(UdpSender, AFullSocketDropsCountsAndDoesNotBlock) {
  int pair[2];
  ASSERT_EQ(::socketpair(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0, pair), 0);
  const Socket reader(pair[1]);
  std::vector<Socket> connected;
  connected.emplace_back(pair[0]);
  UdpSender sender(std::move(connected));
  const Bytes bytes(kMaxDatagramBytes, std::byte{1});
  constexpr std::uint64_t kMany = 5000;  // 6 MB: beyond every default socket buffer
  for (std::uint64_t i = 0; i < kMany; ++i) sender.send(bytes);
  EXPECT_GT(sender.counters().sent, 0U);
  EXPECT_GT(sender.counters().dropped, 0U);
  EXPECT_EQ(sender.counters().sent + sender.counters().dropped, kMany);
  EXPECT_EQ(sender.counters().failed, 0U);

  Bytes room(2048);
  while (::recv(reader.fd(), room.data(), room.size(), MSG_DONTWAIT) > 0) {
  }
  const std::uint64_t sent = sender.counters().sent;
  sender.send(bytes);
  EXPECT_EQ(sender.counters().sent, sent + 1) << "it goes on when there is room again";
}

TEST(UdpSender, AnotherFailureIsCountedWithItsReason) {
  const std::array to{parse_endpoint("255.255.255.255:9")};  // needs SO_BROADCAST
  UdpSender sender(to);
  sender.send(Bytes(10));
  EXPECT_EQ(sender.counters().failed, 1U);
  EXPECT_NE(sender.last_error(), 0);
}

TEST(UdpListener, APortInUseIsSaid) {
  const UdpListener first(parse_endpoint("127.0.0.1:0", true));
  try {
    const UdpListener second(first.local());
    FAIL() << "two listeners on one port";
  } catch (const std::runtime_error& error) {
    EXPECT_THAT(error.what(), HasSubstr("cannot listen on " + to_string(first.local())));
    EXPECT_THAT(error.what(), HasSubstr("another program has this port"));
  }
}

TEST(UdpListener, AnOversizedDatagramIsSeenAsSuch) {
  UdpListener listener(parse_endpoint("127.0.0.1:0", true));
  const std::array to{listener.local()};
  UdpSender sender(to);
  sender.send(Bytes(3000));
  pollfd poll{listener.fd(), POLLIN, 0};
  ASSERT_EQ(::poll(&poll, 1, 5000), 1);
  Bytes room(100);
  EXPECT_EQ(listener.receive(room), 3000);
  EXPECT_EQ(listener.receive(room), -1);
}

std::string content(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

TEST(FileSink, LengthAndDatagramInTheOrderSent) {
  const Folder folder;
  const fs::path path = folder.path() / "telemetry.bin";
  FileSink sink(path);
  sink.send(Bytes(3, std::byte{'a'}));
  sink.send(Bytes(258, std::byte{'b'}));
  EXPECT_FALSE(fs::exists(path)) << "not whole yet";
  EXPECT_TRUE(sink.commit());
  EXPECT_EQ(content(path), std::string("\3\0\0\0aaa\2\1\0\0", 11) + std::string(258, 'b'));
  EXPECT_FALSE(fs::exists(path.string() + ".part"));
  EXPECT_EQ(sink.counters().sent, 2U);
  EXPECT_EQ(sink.status(), "");
}

TEST(FileSink, WithoutCommitNothingStaysAndAnOlderFileIsKept) {
  const Folder folder;
  const fs::path path = folder.path() / "telemetry.bin";
  std::ofstream(path) << "older";
  {
    FileSink sink(path);
    sink.send(Bytes(3));
  }
  EXPECT_EQ(content(path), "older");
  EXPECT_FALSE(fs::exists(path.string() + ".part"));
}

TEST(FileSink, AFullDiskIsSaidAndLeavesNoFile) {
  if (!fs::exists("/dev/full")) GTEST_SKIP() << "no /dev/full here";
  const Folder folder;
  const fs::path path = folder.path() / "telemetry.bin";
  fs::create_symlink("/dev/full", path.string() + ".part");
  FileSink sink(path);
  for (int i = 0; i < 20; ++i) sink.send(Bytes(1000));
  EXPECT_GT(sink.counters().failed, 0U);
  EXPECT_THAT(sink.status(), HasSubstr(path.string() + ": not written: No space left on device"));
  EXPECT_FALSE(sink.commit());
  EXPECT_FALSE(fs::exists(path));
  EXPECT_FALSE(fs::is_symlink(path.string() + ".part"));
}

TEST(FileSink, AFullDiskThatShowsOnlyAtTheEndIsSaidToo) {
  if (!fs::exists("/dev/full")) GTEST_SKIP() << "no /dev/full here";
  const Folder folder;
  const fs::path path = folder.path() / "telemetry.bin";
  fs::create_symlink("/dev/full", path.string() + ".part");
  FileSink sink(path);
  sink.send(Bytes(10));
  EXPECT_FALSE(sink.commit());
  EXPECT_THAT(sink.status(), HasSubstr("free space"));
}

TEST(FileSink, AFolderThatIsNotThereIsSaidAtOnce) {
  const Folder folder;
  try {
    const FileSink sink(folder.path() / "missing" / "telemetry.bin");
    FAIL();
  } catch (const std::runtime_error& error) {
    EXPECT_THAT(error.what(), HasSubstr("missing/telemetry.bin.part: cannot be written: No such file"));
  }
}

}  // namespace
}  // namespace stereotrack::telemetry
