#include <gtest/gtest.h>

#include <array>
#include <span>

#include "drivers/telemetry/authentication.hpp"
#include "drivers/telemetry/encoder.hpp"
#include "drivers/telemetry/receiver.hpp"
#include "drivers/telemetry/udp_listener.hpp"
#include "drivers/telemetry/udp_sender.hpp"
#include "tests/rt/heap_watch.hpp"
#include "tests/unit/telemetry/messages.hpp"

namespace stereotrack::telemetry {
namespace {

TEST(TelemetryRealTime, EncodingSigningSendingAndReceivingMakeNoHeapCall) {
  ASSERT_TRUE(allocations_are_counted()) << "not to be built with a sanitizer";
  UdpListener listener(parse_endpoint("127.0.0.1:0", true));
  const std::array to{listener.local(), listener.local()};
  UdpSender sender(to);
  const Signer signer(kGoldenKey);
  Encoder encoder({.rig = 1, .session = 1, .signer = &signer});
  Receiver receiver({kGoldenKey});
  const auto list = tracks(20);
  Message message = golden_live_message(list);
  const Status status = golden_status();
  std::array<std::byte, kMaxMessageBytes> room{};
  std::array<std::byte, kMaxDatagramBytes> status_room{};

  const test::HeapWatch watch;
  for (int i = 0; i < 1000; ++i) {
    for (const auto part : encoder.encode(message, room)) {
      sender.send(part);
      (void)receiver.accept(part);
      (void)receiver.accept(part);  // a replay
    }
    const auto datagram = encoder.encode_status(status, message.live, message.send_time, status_room);
    sender.send(datagram);
    (void)receiver.accept(datagram);
  }
  EXPECT_EQ(watch.calls(), 0U);
  EXPECT_EQ(receiver.counters().pairs, 1000U);
  EXPECT_EQ(receiver.counters().statuses, 1000U);
  EXPECT_EQ(receiver.counters().refused_total(), 3000U);
}

}  // namespace
}  // namespace stereotrack::telemetry
