#include "drivers/telemetry/encoder.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <new>
#include <random>

#include "drivers/telemetry/covariance_code.hpp"
#include "drivers/telemetry/receiver.hpp"
#include "stereotrack.pb.h"
#include "tests/unit/telemetry/messages.hpp"

namespace {
thread_local std::size_t allocations = 0;
}
// Not inlined: the compiler would see malloc and free where it expects a matching pair of its own.
[[gnu::noinline]] void* operator new(std::size_t size, const std::nothrow_t&) noexcept {
  ++allocations;
  return std::malloc(size);
}
[[gnu::noinline]] void* operator new(std::size_t size) {
  if (void* memory = operator new(size, std::nothrow)) return memory;
  throw std::bad_alloc();
}
[[gnu::noinline]] void operator delete(void* memory) noexcept { std::free(memory); }
[[gnu::noinline]] void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }
[[gnu::noinline]] void operator delete(void* memory, const std::nothrow_t&) noexcept { std::free(memory); }

namespace stereotrack::telemetry {
namespace {

using testing::ElementsAre;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

Message message_of(const std::vector<TrackReport>& list) {
  Message message;
  message.tracks = list;
  return message;
}

std::vector<std::uint32_t> ids(const std::vector<Bytes>& datagrams) {
  std::vector<std::uint32_t> all;
  for (const Bytes& bytes : datagrams) {
    const auto datagram = decode(bytes);
    EXPECT_TRUE(datagram.has_value());
    if (!datagram) continue;
    for (const Target& target : datagram->targets) all.push_back(target.id);
  }
  return all;
}

TEST(Encoder, EveryFieldComesBack) {
  Encoder encoder(kGoldenConfig);
  const auto list = golden_tracks();
  const auto datagrams = encode(encoder, golden_message(list));
  ASSERT_EQ(datagrams.size(), 1U);
  const auto datagram = decode(datagrams[0]);
  ASSERT_TRUE(datagram.has_value()) << to_string(datagram.error());
  const Header& h = datagram->header;
  EXPECT_EQ(h.rig, 9U);
  EXPECT_EQ(h.session, 0x0123456789ABCDEFU);
  EXPECT_EQ(h.sequence, 1U);
  EXPECT_EQ(h.part, 1U);
  EXPECT_EQ(h.parts, 1U);
  EXPECT_EQ(h.ordinal, 42U);
  EXPECT_EQ(h.capture_time_ns, 1'700'000'000'123'456'789);
  EXPECT_EQ(h.send_time_ns, 1'700'000'000'173'456'789);
  EXPECT_EQ(h.latency_ns, 50'000'000U);
  EXPECT_EQ(h.flags, kNoColour | kFramesSkippedBefore);
  EXPECT_EQ(h.frames_skipped, 3U);
  EXPECT_EQ(h.tracks_dropped, 2U);
  EXPECT_EQ(h.targets_dropped, 0U);
  EXPECT_EQ(h.targets_refused, 0U);
  EXPECT_EQ(h.unit_m, 0.5F);
  ASSERT_EQ(datagram->targets.size(), 2U);

  const Target& t = datagram->targets[0];
  EXPECT_EQ(t.id, 7U);
  EXPECT_EQ(t.state, TargetState::kConfirmed);
  EXPECT_TRUE(t.measured);
  EXPECT_TRUE(t.has_depth);
  EXPECT_EQ(t.age_s, 1.5F);
  EXPECT_EQ(t.position, Eigen::Vector3f(3, 4, 12));
  EXPECT_EQ(t.velocity, Eigen::Vector3f(0.5F, -0.25F, 2));
  EXPECT_EQ(t.distance, 13.0F);  // 3, 4, 12, 13 is a Pythagorean quadruple
  EXPECT_EQ(t.box, (Rect{100, 50, 40, 80}));
  EXPECT_FLOAT_EQ(t.width, 1.2F);   // 40 px * 12 / 400 px
  EXPECT_FLOAT_EQ(t.height, 2.0F);  // 80 px * 12 / 480 px
  EXPECT_EQ(t.confidence, 0.75F);
  EXPECT_LE((t.covariance.cast<double>() - list[0].covariance).cwiseAbs().maxCoeff(), 9.0 / 128);

  const Target& flat = datagram->targets[1];
  EXPECT_EQ(flat.id, 300U);
  EXPECT_EQ(flat.state, TargetState::kCoasting);
  EXPECT_FALSE(flat.measured);
  EXPECT_FALSE(flat.has_depth);
  EXPECT_FALSE(flat.has_extent);
  EXPECT_EQ(flat.position, Eigen::Vector3f(0, 0, 0));
  EXPECT_EQ(flat.box, (Rect{100, 50, 40, 80}));
}

TEST(Encoder, StoredDatagramIsReproducedByteForByte) {
  const auto stored = read_hex(STEREOTRACK_SOURCE_DIR "/tests/unit/telemetry/datagrams_v1.hex");
  Encoder encoder(kGoldenConfig);
  const auto list = golden_tracks();
  EXPECT_EQ(encode(encoder, golden_message(list)), stored);
}

TEST(Encoder, StoredDatagramsOfALiveRigAreReproducedByteForByte) {
  const auto stored = read_hex(STEREOTRACK_SOURCE_DIR "/tests/unit/telemetry/datagrams_live_v1.hex");
  ASSERT_EQ(stored.size(), 3U);
  const auto list = golden_tracks();
  const Message message = golden_live_message(list);
  Encoder encoder(kGoldenConfig);
  EXPECT_EQ(encode(encoder, message)[0], stored[0]);
  Encoder status_encoder(kGoldenConfig);
  EXPECT_EQ(encode_status(status_encoder, golden_status(), golden_live_without_pair(), message.send_time), stored[1]);
  const Signer signer(kGoldenKey);
  Encoder signing({.rig = kGoldenConfig.rig, .session = kGoldenConfig.session, .signer = &signer});
  EXPECT_EQ(encode(signing, message)[0], stored[2]);
}

TEST(Encoder, WhatALiveRigAddsStandsInEveryPartAndComesBack) {
  Encoder encoder(kGoldenConfig);
  const auto list = tracks(20);
  Message message = golden_message(list);
  message.live = golden_live();
  const auto datagrams = encode(encoder, message);
  ASSERT_EQ(datagrams.size(), 3U);
  for (const Bytes& bytes : datagrams) {
    const auto datagram = decode(bytes);
    ASSERT_TRUE(datagram.has_value());
    ASSERT_TRUE(datagram->live.has_value());
    EXPECT_FALSE(datagram->status.has_value());
    EXPECT_TRUE(*datagram->live == golden_live());
  }
}

TEST(Encoder, WhatALiveRigDoesNotKnowIsAbsentAndZeroIsAValue) {
  Encoder encoder(kGoldenConfig);
  Message message;
  message.live.emplace();
  auto datagram = decode(encode(encoder, message)[0]);
  ASSERT_TRUE(datagram && datagram->live);
  EXPECT_TRUE(*datagram->live == Live{});
  message.live->tai_error = message.live->pair_skew = message.live->send_error = std::chrono::nanoseconds(0);
  datagram = decode(encode(encoder, message)[0]);
  ASSERT_TRUE(datagram && datagram->live);
  EXPECT_EQ(datagram->live->pair_skew, std::chrono::nanoseconds(0));
  EXPECT_EQ(datagram->live->send_error, std::chrono::nanoseconds(0));
  EXPECT_EQ(datagram->live->tai_error, std::chrono::nanoseconds(1)) << "0 would read as not synchronised";
}

TEST(Encoder, LiveValuesAreHeldAtTheLargestThatFit) {
  using std::chrono::nanoseconds;
  Encoder encoder(kGoldenConfig);
  Message message;
  for (const int sign : {1, -1}) {
    message.live.emplace();
    message.live->pair_skew = message.live->send_error = message.live->tai_error = sign * std::chrono::hours(1);
    const auto datagram = decode(encode(encoder, message)[0]);
    ASSERT_TRUE(datagram && datagram->live);
    EXPECT_EQ(datagram->live->pair_skew, sign * nanoseconds(2'147'483'647));
    EXPECT_EQ(datagram->live->send_error, sign * nanoseconds(2'147'483'647));
    EXPECT_EQ(datagram->live->tai_error, sign > 0 ? nanoseconds(4'294'967'295) : nanoseconds(1));
  }
}

TEST(Encoder, EveryFieldOfAStatusComesBack) {
  Encoder encoder(kGoldenConfig);
  const CaptureTime now{std::chrono::nanoseconds{123'456'789}};
  const auto datagram = decode(encode_status(encoder, golden_status(), golden_live(), now));
  ASSERT_TRUE(datagram.has_value()) << to_string(datagram.error());
  const Header& h = datagram->header;
  EXPECT_EQ(h.rig, kGoldenConfig.rig);
  EXPECT_EQ(h.session, kGoldenConfig.session);
  EXPECT_EQ(h.sequence, 0U);
  EXPECT_EQ(h.part, 1U);
  EXPECT_EQ(h.parts, 1U);
  EXPECT_EQ(h.ordinal, 0U);
  EXPECT_EQ(h.capture_time_ns, 0);
  EXPECT_EQ(h.send_time_ns, 123'456'789);
  EXPECT_TRUE(datagram->targets.empty());
  ASSERT_TRUE(datagram->live.has_value());
  EXPECT_TRUE(*datagram->live == golden_live());
  EXPECT_EQ(datagram->status_sequence, 1U);
  ASSERT_TRUE(datagram->status.has_value());
  EXPECT_TRUE(*datagram->status == golden_status());
}

TEST(Encoder, StatusesAndMessagesCountApart) {
  Encoder encoder(kGoldenConfig);
  for (std::uint64_t i = 1; i <= 3; ++i) {
    const auto status = decode(encode_status(encoder, {}));
    ASSERT_TRUE(status.has_value());
    EXPECT_EQ(status->status_sequence, i);
    EXPECT_FALSE(status->live.has_value());
    const auto message = decode(encode(encoder, {})[0]);
    ASSERT_TRUE(message.has_value());
    EXPECT_EQ(message->header.sequence, i);
    EXPECT_EQ(encoder.sequence(), i);
    EXPECT_EQ(encoder.status_sequence(), i);
  }
}

TEST(Encoder, FullestDatagramFitsIn1200Bytes) {
  // Every variable length at its largest: what the schema's computed bound is made of.
  auto list = tracks(32);
  for (TrackReport& track : list) {
    track.id = 0xFFFF'FFFF - track.id;
    track.box = {65535, 65535, 65535, 65535};
  }
  Message message = golden_message(list);
  message.ordinal = std::numeric_limits<std::uint64_t>::max();
  message.flags = message.frames_skipped = message.tracks_dropped = 0xFFFF'FFFF;
  message.live = golden_live();
  message.live->exposure_left_us = message.live->exposure_right_us = message.live->health = 0xFFFF'FFFF;
  message.live->efforts_shed = 0xFF;
  const Signer signer(kGoldenKey);
  Encoder encoder({.rig = 9, .session = 1, .signer = &signer});
  const auto datagrams = encode(encoder, message);
  ASSERT_EQ(datagrams.size(), 4U);
  for (const Bytes& bytes : datagrams) {
    EXPECT_GT(bytes.size(), 1140U);
    EXPECT_LE(bytes.size(), kMaxDatagramBytes);
    EXPECT_TRUE(decode(bytes).has_value());
  }
}

TEST(Encoder, FullestStatusFitsIn1200Bytes) {
  Status status;
  std::memset(static_cast<void*>(&status), 0xFF, sizeof status);  // numbers only: each at its largest
  const Signer signer(kGoldenKey);
  Encoder encoder({.rig = 9, .session = 1, .signer = &signer});
  const Bytes bytes = encode_status(encoder, status, golden_live());
  EXPECT_GT(bytes.size(), 300U);
  EXPECT_LE(bytes.size(), kMaxDatagramBytes);
  const auto datagram = decode(bytes);
  ASSERT_TRUE(datagram && datagram->status);
  EXPECT_EQ(datagram->status->skew_max_us, 0xFFFF'FFFFU);
  EXPECT_EQ(datagram->status->exposures_stray_right, std::numeric_limits<std::uint64_t>::max());
  EXPECT_EQ(datagram->status->clock_steps, std::numeric_limits<std::uint64_t>::max());
}

TEST(Encoder, WhatTheTriggerGaveAndTheCamerasAnsweredComesBackAsItWent) {
  Status status = golden_status();
  status.trigger_pulses = 200;
  status.trigger_skipped = 201;
  status.trigger_failed = 202;
  status.exposures_missed_left = 203;
  status.exposures_missed_right = 204;
  status.exposures_doubled_left = 205;
  status.exposures_doubled_right = 206;
  status.exposures_stray_left = 207;
  status.exposures_stray_right = 208;
  Encoder encoder(kGoldenConfig);
  const auto datagram = decode(encode_status(encoder, status));
  ASSERT_TRUE(datagram && datagram->status);
  EXPECT_EQ(*datagram->status, status);
}

TEST(Encoder, NoTargetIsOnePartWithoutTargets) {
  Encoder encoder(kGoldenConfig);
  const auto datagrams = encode(encoder, {});
  ASSERT_EQ(datagrams.size(), 1U);
  const auto datagram = decode(datagrams[0]);
  ASSERT_TRUE(datagram.has_value());
  EXPECT_TRUE(datagram->targets.empty());
  EXPECT_EQ(datagram->header.parts, 1U);
}

TEST(Encoder, EightTargetsAreOnePartAndNineAreTwo) {
  Encoder encoder(kGoldenConfig);
  const auto eight = tracks(8);
  EXPECT_EQ(encode(encoder, message_of(eight)).size(), 1U);
  const auto nine = tracks(9);
  const auto datagrams = encode(encoder, message_of(nine));
  ASSERT_EQ(datagrams.size(), 2U);
  const auto first = decode(datagrams[0]);
  const auto second = decode(datagrams[1]);
  ASSERT_TRUE(first && second);
  EXPECT_EQ(first->targets.size(), 8U);
  EXPECT_EQ(second->targets.size(), 1U);
  EXPECT_EQ(second->targets[0].id, 9U);
  EXPECT_EQ(first->header.part, 1U);
  EXPECT_EQ(second->header.part, 2U);
  EXPECT_EQ(second->header.parts, 2U);
  EXPECT_EQ(first->header.sequence, second->header.sequence);
}

TEST(Encoder, OfThirtyThreeTheFarthestIsDroppedAndCounted) {
  auto list = tracks(33);
  std::mt19937 random(1);
  std::shuffle(list.begin(), list.end(), random);
  Encoder encoder(kGoldenConfig);
  const auto datagrams = encode(encoder, message_of(list));
  ASSERT_EQ(datagrams.size(), 4U);
  std::vector<std::uint32_t> nearest_first(32);
  for (std::uint32_t i = 0; i < 32; ++i) nearest_first[i] = i + 1;
  EXPECT_EQ(ids(datagrams), nearest_first);
  for (const Bytes& bytes : datagrams) {
    const auto datagram = decode(bytes);
    ASSERT_TRUE(datagram.has_value());
    EXPECT_EQ(datagram->header.targets_dropped, 1U);
  }
}

TEST(Encoder, TargetsWithoutDepthComeLastAndEqualOnesById) {
  std::vector<TrackReport> list{track_at(5, 2), track_at(4, 1), track_at(3, 2), track_at(2, 1), track_at(1, 9)};
  list[1].has_depth = list[3].has_depth = false;
  Encoder encoder(kGoldenConfig);
  EXPECT_THAT(ids(encode(encoder, message_of(list))), ElementsAre(3, 5, 1, 2, 4));
}

TEST(Encoder, TargetWithAnyNonFiniteValueIsRefusedAndCounted) {
  const std::vector<void (*)(TrackReport&)> spoils{
      [](TrackReport& t) { t.position.x() = kNan; },     [](TrackReport& t) { t.position.z() = kInfinity; },
      [](TrackReport& t) { t.position.y() = 1e200; },    [](TrackReport& t) { t.velocity.y() = -kInfinity; },
      [](TrackReport& t) { t.covariance(3, 1) = kNan; }, [](TrackReport& t) { t.covariance(5, 5) = kInfinity; },
      [](TrackReport& t) { t.covariance(2, 2) = -1; },   [](TrackReport& t) { t.covariance(0, 0) = 1e300; },
      [](TrackReport& t) { t.confidence = kNan; },       [](TrackReport& t) { t.age_s = kInfinity; },
  };
  Encoder encoder(kGoldenConfig);
  for (std::size_t i = 0; i < spoils.size(); ++i) {
    auto list = tracks(3);
    spoils[i](list[1]);
    const auto datagrams = encode(encoder, message_of(list));
    ASSERT_EQ(datagrams.size(), 1U);
    const auto datagram = decode(datagrams[0]);
    ASSERT_TRUE(datagram.has_value()) << "value " << i;
    EXPECT_EQ(datagram->header.targets_refused, 1U) << "value " << i;
    EXPECT_EQ(datagram->targets.size(), 2U) << "value " << i;
  }
}

TEST(Encoder, ValuesOfATargetWithoutDepthAreNotLookedAt) {
  auto list = tracks(1);
  list[0].has_depth = false;
  list[0].position.x() = kNan;
  Encoder encoder(kGoldenConfig);
  EXPECT_THAT(ids(encode(encoder, message_of(list))), ElementsAre(1));
}

TEST(Encoder, FrameValuesAreClampedToWhatTheSchemaAllows) {
  auto list = tracks(1);
  list[0].box = {-5, 70000, 10, 10};
  list[0].confidence = 1.5;
  Message message = message_of(list);
  message.unit_m = kNan;
  message.latency = std::chrono::seconds(10);
  Encoder encoder(kGoldenConfig);
  auto datagram = decode(encode(encoder, message)[0]);
  ASSERT_TRUE(datagram.has_value());
  EXPECT_EQ(datagram->targets[0].box, (Rect{0, 65535, 10, 10}));
  EXPECT_EQ(datagram->targets[0].confidence, 1.0F);
  EXPECT_FALSE(datagram->targets[0].has_extent);
  EXPECT_EQ(datagram->header.unit_m, 0.0F);
  EXPECT_EQ(datagram->header.latency_ns, 0xFFFF'FFFFU);
  message.latency = std::chrono::seconds(-1);
  datagram = decode(encode(encoder, message)[0]);
  ASSERT_TRUE(datagram.has_value());
  EXPECT_EQ(datagram->header.latency_ns, 0U);
}

TEST(Encoder, SameMessagesGiveTheSameBytesAndTheSequenceRises) {
  Encoder a(kGoldenConfig);
  Encoder b(kGoldenConfig);
  const auto list = tracks(20);
  for (std::uint64_t i = 1; i <= 5; ++i) {
    EXPECT_EQ(encode(a, message_of(list)), encode(b, message_of(list)));
    EXPECT_EQ(a.sequence(), i);
  }
}

TEST(Encoder, EncodingAndReceivingTakeNoMemory) {
  const auto list = tracks(40);
  std::array<std::byte, kMaxMessageBytes> room{};
  Encoder encoder(kGoldenConfig);
  Receiver receiver;
  const std::size_t before = allocations;
  for (int i = 0; i < 1000; ++i) {
    for (const auto part : encoder.encode(message_of(list), room)) (void)receiver.accept(part);
  }
  const std::size_t after = allocations;
  EXPECT_EQ(after, before);
  EXPECT_EQ(receiver.counters().pairs, 1000U);
  const std::size_t idle = allocations;
  ::operator delete(::operator new(1));
  EXPECT_EQ(allocations, idle + 1) << "the counter counts";
}

TEST(CovarianceCode, FactorWorkedByHandComesBackExactly) {
  // P = L L^T with L00 = 2, L20 = 1.5, L22 = 2.5, others 1 on the diagonal: all exact in 8 bits.
  Eigen::Matrix<double, 6, 6> P = Eigen::Matrix<double, 6, 6>::Identity();
  P(0, 0) = 4;
  P(2, 0) = P(0, 2) = 3;
  P(2, 2) = 8.5;
  const auto bytes = pack_covariance(P);
  ASSERT_TRUE(bytes.has_value());
  EXPECT_EQ((*bytes)[0], 0x00);  // 2.0 = 0x40000000
  EXPECT_EQ((*bytes)[1], 0x40);
  EXPECT_EQ((*bytes)[6], 0xC0);  // 1.5 = 0x3FC00000
  EXPECT_EQ((*bytes)[7], 0x3F);
  const auto back = unpack_covariance(*bytes);
  ASSERT_TRUE(back.has_value());
  EXPECT_EQ(back->cast<double>(), P);
}

TEST(CovarianceCode, ErrorStaysUnderItsBoundAndTheResultIsACovariance) {
  // Long along a ray and thin across it, as stereo measures: the correlations come near 1.
  std::mt19937 random(7);
  std::normal_distribution<double> normal;
  double worst = 0;
  for (int n = 0; n < 1000; ++n) {
    Eigen::Matrix<double, 6, 6> A;
    for (int i = 0; i < 36; ++i) A(i / 6, i % 6) = normal(random);
    A.col(0) *= 1000;
    const Eigen::Matrix<double, 6, 6> P = A * A.transpose();
    const auto bytes = pack_covariance(P);
    ASSERT_TRUE(bytes.has_value());
    const auto back = unpack_covariance(*bytes);
    ASSERT_TRUE(back.has_value());
    for (int i = 0; i < 6; ++i) {
      for (int j = 0; j < 6; ++j) {
        worst = std::max(worst, std::abs(static_cast<double>((*back)(i, j)) - P(i, j)) / std::sqrt(P(i, i) * P(j, j)));
      }
    }
  }
  EXPECT_LT(worst, 1.0 / 128);
  EXPECT_GT(worst, 1.0 / 1024) << "that would be more than 8 bits: is the test still testing?";
}

TEST(CovarianceCode, SingularOneStaysOne) {
  Eigen::Matrix<double, 6, 6> P = Eigen::Matrix<double, 6, 6>::Constant(4.0);
  const auto bytes = pack_covariance(P);
  ASSERT_TRUE(bytes.has_value());
  const auto back = unpack_covariance(*bytes);
  ASSERT_TRUE(back.has_value());
  EXPECT_EQ(back->cast<double>(), P);
  P.setZero();
  EXPECT_TRUE(pack_covariance(P).has_value());
}

}  // namespace
}  // namespace stereotrack::telemetry
