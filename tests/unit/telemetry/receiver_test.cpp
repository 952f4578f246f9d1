#include "drivers/telemetry/receiver.hpp"

#include <gtest/gtest.h>
#include <pb_encode.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <random>

#include "stereotrack.pb.h"
#include "tests/unit/telemetry/messages.hpp"

namespace stereotrack::telemetry {
namespace {

/// Datagrams of `pairs` messages with `targets` targets each, [pair][part].
std::vector<std::vector<Bytes>> stream(std::size_t pairs, std::uint32_t targets,
                                       const Encoder::Config& config = kGoldenConfig) {
  Encoder encoder(config);
  const auto list = tracks(targets);
  std::vector<std::vector<Bytes>> all;
  for (std::size_t i = 0; i < pairs; ++i) {
    Message message;
    message.tracks = list;
    message.ordinal = i + 1;
    all.push_back(encode(encoder, message));
  }
  return all;
}

Refusal refusal_of(const Bytes& bytes) {
  const auto datagram = decode(bytes);
  EXPECT_FALSE(datagram.has_value());
  return datagram ? Refusal::kEmpty : datagram.error();
}

Bytes wire(stereotrack_Datagram datagram) {
  datagram.size = 1;
  std::size_t size = 0;
  EXPECT_TRUE(pb_get_encoded_size(&size, stereotrack_Datagram_fields, &datagram));
  datagram.size = static_cast<std::uint32_t>(size);
  Bytes bytes(size);
  pb_ostream_t out = pb_ostream_from_buffer(reinterpret_cast<pb_byte_t*>(bytes.data()), bytes.size());
  EXPECT_TRUE(pb_encode(&out, stereotrack_Datagram_fields, &datagram));
  return bytes;
}

stereotrack_Datagram valid() {
  stereotrack_Datagram datagram = stereotrack_Datagram_init_zero;
  datagram.schema = kSchemaVersion;
  datagram.sequence = 1;
  datagram.part = datagram.parts = 1;
  datagram.targets_count = 1;
  datagram.targets[0].box_count = 4;
  return datagram;
}

TEST(Decode, StoredDatagramOfEverySchemaIsStillUnderstood) {
  const auto stored = read_hex(STEREOTRACK_SOURCE_DIR "/tests/unit/telemetry/datagrams_v1.hex");
  ASSERT_EQ(stored.size(), 1U);
  const auto datagram = decode(stored[0]);
  ASSERT_TRUE(datagram.has_value()) << to_string(datagram.error());
  EXPECT_EQ(datagram->header.session, 0x0123456789ABCDEFU);
  EXPECT_EQ(datagram->header.capture_time_ns, 1'700'000'000'123'456'789);
  ASSERT_EQ(datagram->targets.size(), 2U);
  EXPECT_EQ(datagram->targets[0].position, Eigen::Vector3f(3, 4, 12));
  EXPECT_EQ(datagram->targets[0].covariance(0, 2), 3.0F);
  EXPECT_EQ(datagram->targets[1].id, 300U);
}

TEST(Decode, StoredDatagramsOfALiveRigAreStillUnderstood) {
  const auto stored = read_hex(STEREOTRACK_SOURCE_DIR "/tests/unit/telemetry/datagrams_live_v1.hex");
  ASSERT_EQ(stored.size(), 3U);
  for (const std::size_t i : {0U, 2U}) {
    const auto message = decode(stored[i]);
    ASSERT_TRUE(message.has_value()) << to_string(message.error());
    EXPECT_EQ(message->header.flags,
              kNoColour | kFramesSkippedBefore | kPairMissing | kPredicted | kEffortShed | kClockStepped);
    EXPECT_EQ(message->targets.size(), 2U);
    ASSERT_TRUE(message->live.has_value());
    EXPECT_TRUE(*message->live == golden_live());
  }
  const auto status = decode(stored[1]);
  ASSERT_TRUE(status && status->status && status->live);
  EXPECT_TRUE(*status->status == golden_status());
  EXPECT_TRUE(*status->live == golden_live_without_pair());

  Receiver receiver({kGoldenKey});
  EXPECT_EQ(receiver.accept(stored[0]), Outcome::kRefused);
  EXPECT_EQ(receiver.refusal(), Refusal::kUnsigned);
  EXPECT_EQ(receiver.accept(stored[2]), Outcome::kPair);
  EXPECT_TRUE(receiver.pair().live == golden_live());
}

TEST(Decode, UnknownFieldsOfANewerSenderAreSkipped) {
  const Bytes known = stream(1, 2)[0][0];
  Bytes newer = known;
  // Field 21, varint 5; field 2045, 4 bytes: numbers that are reserved today.
  for (const int byte : {0xA8, 0x01, 0x05, 0xEA, 0x7F, 0x04, 1, 2, 3, 4}) newer.push_back(static_cast<std::byte>(byte));
  const auto datagram = decode(newer);
  ASSERT_TRUE(datagram.has_value()) << to_string(datagram.error());
  EXPECT_EQ(datagram->targets.size(), 2U);
}

TEST(Decode, StateOfANewerSenderReadsAsUnknown) {
  stereotrack_Datagram datagram = valid();
  datagram.targets[0].state = stereotrack_State_STATE_COASTING;
  Bytes bytes = wire(datagram);
  const std::array field_2_is_3{std::byte{0x10}, std::byte{3}};
  const auto at = std::search(bytes.begin(), bytes.end(), field_2_is_3.begin(), field_2_is_3.end());
  ASSERT_NE(at, bytes.end());
  at[1] = std::byte{9};
  const auto back = decode(bytes);
  ASSERT_TRUE(back.has_value());
  EXPECT_EQ(back->targets[0].state, TargetState::kUnknown);
}

TEST(Decode, EveryTruncationIsRefused) {
  const Bytes whole = stream(1, 8)[0][0];
  ASSERT_TRUE(decode(whole).has_value());
  for (std::size_t size = 0; size < whole.size(); ++size) {
    EXPECT_FALSE(decode(Bytes(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(size))).has_value()) << size;
  }
  EXPECT_EQ(refusal_of(Bytes(whole.begin(), whole.end() - 1)), Refusal::kTruncated);
  EXPECT_EQ(refusal_of({}), Refusal::kEmpty);
}

TEST(Decode, EachDefectHasItsReason) {
  EXPECT_EQ(refusal_of(Bytes(kMaxDatagramBytes + 1)), Refusal::kOversized);
  EXPECT_EQ(refusal_of(Bytes(100, std::byte{0xFF})), Refusal::kMalformed);
  const auto refused = [](auto spoil) {
    stereotrack_Datagram datagram = valid();
    EXPECT_TRUE(decode(wire(datagram)).has_value());
    spoil(datagram);
    return refusal_of(wire(datagram));
  };
  EXPECT_EQ(refused([](auto& d) { d.schema = 2; }), Refusal::kUnknownSchema);
  EXPECT_EQ(refused([](auto& d) { d.schema = 0; }), Refusal::kUnknownSchema);
  EXPECT_EQ(refused([](auto& d) { d.part = 2; }), Refusal::kInconsistent);
  EXPECT_EQ(refused([](auto& d) { d.part = 0; }), Refusal::kInconsistent);
  EXPECT_EQ(refused([](auto& d) { d.part = d.parts = 5; }), Refusal::kInconsistent);
  EXPECT_EQ(refused([](auto& d) { d.sequence = 0; }), Refusal::kInconsistent);
  EXPECT_EQ(refused([](auto& d) { d.targets[0].box_count = 3; }), Refusal::kInconsistent);
  const auto status_refused = [](auto spoil) {
    stereotrack_Datagram datagram = valid();
    datagram.sequence = 0;
    datagram.targets_count = 0;
    datagram.has_status = true;
    datagram.status.sequence = 1;
    EXPECT_TRUE(decode(wire(datagram)).has_value());
    spoil(datagram);
    return refusal_of(wire(datagram));
  };
  EXPECT_EQ(status_refused([](auto& d) { d.sequence = 1; }), Refusal::kInconsistent);
  EXPECT_EQ(status_refused([](auto& d) { d.status.sequence = 0; }), Refusal::kInconsistent);
  EXPECT_EQ(status_refused([](auto& d) { d.parts = 2; }), Refusal::kInconsistent);
  EXPECT_EQ(status_refused([](auto& d) { d.targets_count = 1; }), Refusal::kInconsistent);
  EXPECT_EQ(refused([](auto& d) { d.targets[0].position_count = 2; }), Refusal::kInconsistent);
  EXPECT_EQ(refused([](auto& d) { d.targets[0].velocity_count = 3; }), Refusal::kInconsistent);
  EXPECT_EQ(refused([](auto& d) { d.targets[0].extent_count = 2; }), Refusal::kInconsistent);
  EXPECT_EQ(refused([](auto& d) { d.targets[0].age_s = std::numeric_limits<float>::quiet_NaN(); }),
            Refusal::kNotFinite);
  EXPECT_EQ(refused([](auto& d) { d.unit_m = std::numeric_limits<float>::infinity(); }), Refusal::kNotFinite);
}

TEST(Decode, MutatedDatagramsNeverCrashAndNeverGiveANonFiniteNumber) {
  auto seeds = stream(1, 32)[0];
  for (Bytes& bytes : read_hex(STEREOTRACK_SOURCE_DIR "/tests/unit/telemetry/datagrams_live_v1.hex")) {
    seeds.push_back(std::move(bytes));
  }
  std::mt19937 random(99);
  std::size_t taken = 0;
  std::size_t refused = 0;
  Receiver receiver;
  for (int n = 0; n < 200'000; ++n) {
    Bytes bytes = seeds[random() % seeds.size()];
    const unsigned changes = 1 + random() % 8;
    for (unsigned c = 0; c < changes; ++c) {
      switch (random() % 4) {
        case 0: bytes[random() % bytes.size()] ^= static_cast<std::byte>(1U << (random() % 8)); break;
        case 1: bytes[random() % bytes.size()] = static_cast<std::byte>(random()); break;
        case 2: bytes.insert(bytes.begin() + random() % bytes.size(), static_cast<std::byte>(random())); break;
        default: bytes.erase(bytes.begin() + random() % bytes.size()); break;
      }
    }
    if (receiver.accept(bytes) == Outcome::kRefused) {
      ++refused;
      continue;
    }
    ++taken;
    const Datagram& datagram = receiver.datagram();
    ASSERT_LE(datagram.targets.size(), kTargetsPerPart);
    ASSERT_TRUE(std::isfinite(datagram.header.unit_m));
    for (const Target& t : datagram.targets) {
      ASSERT_TRUE(t.position.allFinite() && t.velocity.allFinite() && t.covariance.allFinite());
      ASSERT_TRUE(std::isfinite(t.distance) && std::isfinite(t.width) && std::isfinite(t.confidence));
    }
  }
  EXPECT_GT(taken, 1000U);
  EXPECT_GT(refused, 1000U);
  EXPECT_EQ(receiver.counters().refused_total(), refused);
  EXPECT_EQ(receiver.counters().datagrams, 200'000U);
}

TEST(Receiver, AllPartsMakeAPairWithItsTargetsInOrder) {
  Receiver receiver;
  const auto parts = stream(1, 20)[0];
  ASSERT_EQ(parts.size(), 3U);
  EXPECT_EQ(receiver.accept(parts[0]), Outcome::kPart);
  EXPECT_EQ(receiver.accept(parts[1]), Outcome::kPart);
  EXPECT_EQ(receiver.accept(parts[2]), Outcome::kPair);
  ASSERT_EQ(receiver.pair().targets.size(), 20U);
  for (std::uint32_t i = 0; i < 20; ++i) EXPECT_EQ(receiver.pair().targets[i].id, i + 1);
  EXPECT_EQ(receiver.lost(), 0U);
}

TEST(Receiver, PartsInAnyOrderMakeTheSamePair) {
  Receiver receiver;
  const auto parts = stream(1, 20)[0];
  EXPECT_EQ(receiver.accept(parts[2]), Outcome::kPart);
  EXPECT_EQ(receiver.accept(parts[0]), Outcome::kPart);
  EXPECT_EQ(receiver.accept(parts[1]), Outcome::kPair);
  for (std::uint32_t i = 0; i < 20; ++i) EXPECT_EQ(receiver.pair().targets[i].id, i + 1);
  EXPECT_EQ(receiver.counters().reordered, 2U);
}

TEST(Receiver, AGapIsALoss) {
  Receiver receiver;
  const auto pairs = stream(10, 1);
  for (const std::size_t i : {0U, 1U, 4U, 5U, 9U}) EXPECT_EQ(receiver.accept(pairs[i][0]), Outcome::kPair);
  EXPECT_EQ(receiver.lost(), 5U);
  EXPECT_EQ(receiver.lost(kGoldenConfig.rig, kGoldenConfig.session), 5U);
  EXPECT_EQ(receiver.lost(kGoldenConfig.rig, 1), 0U);
}

TEST(Receiver, AMissingPartLosesThePairOnceTheNextOneBegins) {
  Receiver receiver;
  const auto pairs = stream(2, 9);
  EXPECT_EQ(receiver.accept(pairs[0][0]), Outcome::kPart);
  EXPECT_EQ(receiver.lost(), 0U);
  EXPECT_EQ(receiver.accept(pairs[1][0]), Outcome::kPart);
  EXPECT_EQ(receiver.lost(), 1U);
  EXPECT_EQ(receiver.accept(pairs[1][1]), Outcome::kPair);
  EXPECT_EQ(receiver.lost(), 1U);
  EXPECT_EQ(receiver.counters().pairs, 1U);
}

TEST(Receiver, AReorderedPairTakesItsLossBack) {
  Receiver receiver;
  const auto pairs = stream(4, 1);
  for (const std::size_t i : {0U, 2U, 3U}) (void)receiver.accept(pairs[i][0]);
  EXPECT_EQ(receiver.lost(), 1U);
  EXPECT_EQ(receiver.accept(pairs[1][0]), Outcome::kPair);
  EXPECT_EQ(receiver.lost(), 0U);
  EXPECT_EQ(receiver.counters().reordered, 1U);
}

TEST(Receiver, WhatComesTwiceIsADuplicate) {
  Receiver receiver;
  const auto pairs = stream(3, 9);
  for (const auto& pair : pairs) {
    for (const Bytes& bytes : pair) (void)receiver.accept(bytes);
  }
  EXPECT_EQ(receiver.accept(pairs[2][1]), Outcome::kDuplicate);
  EXPECT_EQ(receiver.accept(pairs[0][0]), Outcome::kDuplicate);
  EXPECT_EQ(receiver.counters().duplicates, 2U);
  EXPECT_EQ(receiver.counters().pairs, 3U);
  EXPECT_EQ(receiver.lost(), 0U);
}

TEST(Receiver, WhatComesOverAWindowLateIsStaleAndStaysLost) {
  Receiver receiver;
  const auto pairs = stream(2 + Receiver::kWindow, 1);
  (void)receiver.accept(pairs[0][0]);
  for (std::size_t i = 2; i < pairs.size(); ++i) (void)receiver.accept(pairs[i][0]);
  EXPECT_EQ(receiver.accept(pairs[1][0]), Outcome::kStale);
  EXPECT_EQ(receiver.counters().stale, 1U);
  EXPECT_EQ(receiver.lost(), 1U);
}

TEST(Receiver, RigsAndSessionsHaveTheirOwnBooks) {
  Receiver receiver;
  const auto a = stream(5, 1, {.rig = 1, .session = 1});
  const auto b = stream(5, 1, {.rig = 2, .session = 1});
  const auto c = stream(5, 1, {.rig = 1, .session = 2});
  for (std::size_t i = 0; i < 5; ++i) {
    EXPECT_EQ(receiver.accept(a[i][0]), Outcome::kPair);
    if (i != 2) {
      EXPECT_EQ(receiver.accept(b[i][0]), Outcome::kPair);
    }
    EXPECT_EQ(receiver.accept(c[i][0]), Outcome::kPair);
  }
  EXPECT_EQ(receiver.lost(1, 1), 0U);
  EXPECT_EQ(receiver.lost(2, 1), 1U);
  EXPECT_EQ(receiver.lost(1, 2), 0U);
  EXPECT_EQ(receiver.counters().duplicates, 0U);
}

TEST(Receiver, LossesOfAStreamThatGaveWayStayCounted) {
  Receiver receiver;
  const auto old = stream(3, 1, {.rig = 1, .session = 1});
  (void)receiver.accept(old[0][0]);
  (void)receiver.accept(old[2][0]);
  for (std::uint32_t rig = 2; rig <= 1 + Receiver::kStreams; ++rig) {
    (void)receiver.accept(stream(1, 1, {.rig = rig, .session = 1})[0][0]);
  }
  EXPECT_EQ(receiver.lost(1, 1), 0U) << "no longer followed";
  EXPECT_EQ(receiver.lost(), 1U);
}

TEST(Receiver, ASenderThatBeginsAgainUnderTheSameSessionIsARestart) {
  Receiver receiver;
  const auto pairs = stream(20, 1);
  for (int run = 0; run < 2; ++run) {
    for (const auto& pair : pairs) EXPECT_EQ(receiver.accept(pair[0]), Outcome::kPair);
  }
  EXPECT_EQ(receiver.counters().restarts, 1U);
  EXPECT_EQ(receiver.counters().pairs, 40U);
  EXPECT_EQ(receiver.lost(), 0U);
}

TEST(Receiver, StatusesBetweenPairsLoseNothing) {
  Receiver receiver;
  Encoder encoder(kGoldenConfig);
  for (int i = 0; i < 5; ++i) {
    EXPECT_EQ(receiver.accept(encode(encoder, {})[0]), Outcome::kPair);
    EXPECT_EQ(receiver.accept(encode_status(encoder, golden_status())), Outcome::kStatus);
    EXPECT_EQ(receiver.datagram().status_sequence, static_cast<std::uint64_t>(i + 1));
  }
  EXPECT_EQ(receiver.lost(), 0U);
  EXPECT_EQ(receiver.counters().pairs, 5U);
  EXPECT_EQ(receiver.counters().statuses, 5U);
}

TEST(Receiver, PartsThatDisagreeOnTheirNumberAreRefused) {
  Receiver receiver;
  (void)receiver.accept(stream(1, 20)[0][0]);
  EXPECT_EQ(receiver.accept(stream(1, 9)[0][1]), Outcome::kRefused);
  EXPECT_EQ(receiver.refusal(), Refusal::kInconsistent);
}

}  // namespace
}  // namespace stereotrack::telemetry
