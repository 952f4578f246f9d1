#include "drivers/telemetry/authentication.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <fstream>
#include <string>

#include "drivers/telemetry/receiver.hpp"
#include "tests/support/temp_dir.hpp"
#include "tests/unit/telemetry/messages.hpp"

namespace stereotrack::telemetry {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

constexpr const char* kHex = "000102030405060708090a0b0c0d0e0f101112131415161718191a1b1c1d1e1f";

/// What load_key_file says to a file with this content and mode.
std::string refusal_of(const std::string& content, mode_t mode = 0600) {
  const test::TempDir folder;
  const fs::path file = folder.write("telemetry.key", content);
  EXPECT_EQ(::chmod(file.c_str(), mode), 0);
  try {
    (void)load_key_file(file);
  } catch (const KeyFileError& error) {
    EXPECT_THAT(error.what(), HasSubstr("key file " + file.string() + ": "));
    EXPECT_EQ(std::string(error.what()).find('\n'), std::string::npos);
    return error.what();
  }
  return "taken";
}

TEST(KeyFile, KeysComeInTheOrderOfTheirLines) {
  const test::TempDir folder;
  const fs::path file = folder.write(
      "telemetry.key", "# new one\n4294967295 " + std::string(kHex) + "\r\n\n  0\t" + std::string(64, 'F') + "  ");
  ASSERT_EQ(::chmod(file.c_str(), 0600), 0);
  const auto keys = load_key_file(file);
  ASSERT_EQ(keys.size(), 2U);
  EXPECT_EQ(keys[0].id, 4294967295U);
  for (std::size_t i = 0; i < kKeyBytes; ++i) EXPECT_EQ(keys[0].secret[i], i);
  EXPECT_EQ(keys[1].id, 0U);
  EXPECT_EQ(keys[1].secret[31], 0xFF);
}

TEST(KeyFile, WhatIsNoKeyIsRefusedWithItsLineAndWithoutTheSecret) {
  const std::string good = "1 " + std::string(kHex);
  EXPECT_EQ(refusal_of(good), "taken");
  const std::string short_one = refusal_of("1 " + std::string(kHex).substr(2));
  EXPECT_THAT(short_one, HasSubstr("line 1: write ID HEX: a number and 64 hexadecimal digits"));
  EXPECT_THAT(short_one, testing::Not(HasSubstr("0a0b0c")));
  EXPECT_THAT(refusal_of("\n1 " + std::string(kHex) + "00"), HasSubstr("line 2: write ID HEX"));
  EXPECT_THAT(refusal_of("1 g" + std::string(kHex).substr(1)), HasSubstr("line 1: write ID HEX"));
  EXPECT_THAT(refusal_of(std::string(kHex)), HasSubstr("line 1: write ID HEX"));
  EXPECT_THAT(refusal_of("-1 " + std::string(kHex)), HasSubstr("line 1: write ID HEX"));
  EXPECT_THAT(refusal_of("4294967296 " + std::string(kHex)), HasSubstr("line 1: write ID HEX"));
  EXPECT_THAT(refusal_of(good + " 2"), HasSubstr("line 1: write ID HEX"));
  EXPECT_THAT(refusal_of(good + "\n" + good), HasSubstr("line 2: key id 1 stands there twice"));
  EXPECT_THAT(refusal_of(""), HasSubstr("holds no key"));
  EXPECT_THAT(refusal_of("# later\n"), HasSubstr("holds no key"));
  EXPECT_THAT(refusal_of(std::string(20'000, '#')), HasSubstr("is it the right file?"));
  std::string nine;
  for (int id = 0; id < 9; ++id) nine += std::to_string(id) + ' ' + kHex + '\n';
  EXPECT_THAT(refusal_of(nine), HasSubstr("line 9: more than 8 keys"));
  EXPECT_EQ(refusal_of(nine.substr(0, nine.size() - 67)), "taken");
}

TEST(KeyFile, AFileThatOthersMayReadOrWriteIsRefused) {
  const std::string good = "1 " + std::string(kHex);
  EXPECT_EQ(refusal_of(good, 0400), "taken");
  for (const mode_t mode : {0640, 0604, 0620, 0602, 0610, 0644, 0666}) {
    EXPECT_THAT(refusal_of(good, mode), HasSubstr("run: chmod 600 ")) << std::oct << mode;
  }
}

TEST(KeyFile, AFileOfAnotherUserIsRefusedAndOneOfRootsIsTaken) {
  if (::geteuid() != 0) GTEST_SKIP() << "only root can give a file away";
  const test::TempDir folder;
  const fs::path file = folder.write("telemetry.key", "1 " + std::string(kHex));
  ASSERT_EQ(::chmod(file.c_str(), 0600), 0);
  EXPECT_EQ(load_key_file(file).size(), 1U);
  ASSERT_EQ(::chown(file.c_str(), 12345, -1), 0);
  try {
    (void)load_key_file(file);
    FAIL();
  } catch (const KeyFileError& error) {
    EXPECT_THAT(error.what(), HasSubstr("belongs to another user"));
  }
}

TEST(KeyFile, WhatIsNotAFileIsRefusedAtOnce) {
  const test::TempDir folder;
  try {
    (void)load_key_file(folder / "none");
    FAIL();
  } catch (const KeyFileError& error) {
    EXPECT_THAT(error.what(), HasSubstr("none: cannot be read: No such file"));
    EXPECT_THAT(error.what(), HasSubstr("openssl rand -hex 32"));
  }
  EXPECT_THROW((void)load_key_file(folder.path()), KeyFileError);
  ASSERT_EQ(::mkfifo((folder / "pipe").c_str(), 0600), 0);
  EXPECT_THROW((void)load_key_file(folder / "pipe"), KeyFileError) << "and does not wait for a writer";
}

TEST(Signer, TrailerIsThatOfAnIndependentBlake2b) {
  // python3 -c 'import hashlib; d = b"abc" + bytes.fromhex("f57f78563412");
  //   print(hashlib.blake2b(d, key=bytes(range(32)), digest_size=16).hexdigest())'
  const Signer signer({.id = 0x12345678, .secret = kGoldenKey.secret});
  std::array<std::byte, 64> buffer{std::byte{'a'}, std::byte{'b'}, std::byte{'c'}};
  ASSERT_EQ(signer.sign(buffer, 3), 3 + kTrailerBytes);
  EXPECT_EQ(to_hex(std::span(buffer).first(3 + kTrailerBytes)),
            "616263f57f78563412fa7f10"
            "8edb18ffcd902a229a4866bdbcecccf1");
}

TEST(Signer, WithoutRoomForTheTrailerNothingIsToBeSent) {
  const Signer signer(kGoldenKey);
  std::array<std::byte, 10 + kTrailerBytes> buffer{};
  EXPECT_EQ(signer.sign(buffer, 10), buffer.size());
  EXPECT_EQ(signer.sign(buffer, 11), 0U);
  EXPECT_EQ(signer.sign(buffer, buffer.size()), 0U);
  EXPECT_EQ(signer.sign(buffer, buffer.size() + 1), 0U);
}

TEST(Signer, TrailerChangesNothingInThePayload) {
  const auto list = golden_tracks();
  Encoder plain(kGoldenConfig);
  const Signer signer(kGoldenKey);
  Encoder signing({.rig = kGoldenConfig.rig, .session = kGoldenConfig.session, .signer = &signer});
  const auto without = encode(plain, golden_message(list));
  const auto with = encode(signing, golden_message(list));
  ASSERT_EQ(with.size(), 1U);
  const auto payload = payload_of(with[0]);
  EXPECT_EQ(Bytes(payload.begin(), payload.end()), without[0]);
  EXPECT_EQ(payload_of(without[0]).size(), without[0].size());
  EXPECT_EQ(key_id_of(with[0]), kGoldenKey.id);
  EXPECT_EQ(key_id_of(without[0]), std::nullopt);
  EXPECT_EQ(key_id_of({}), std::nullopt);
}

/// Datagrams of one rig, signed.
class SignedStream {
 public:
  explicit SignedStream(std::uint64_t session, std::uint32_t rig = 1, Key key = kGoldenKey)
      : signer_(key), encoder_({.rig = rig, .session = session, .signer = &signer_}) {}
  std::vector<Bytes> message(std::uint32_t targets = 1) {
    const auto list = tracks(targets);
    Message message;
    message.tracks = list;
    return encode(encoder_, message);
  }
  Bytes status() { return encode_status(encoder_, golden_status()); }

 private:
  Signer signer_;
  Encoder encoder_;
};

/// The reason, or "taken".
std::string verdict(Receiver& receiver, const Bytes& bytes) {
  return receiver.accept(bytes) == Outcome::kRefused ? to_string(receiver.refusal()) : "taken";
}

TEST(Authentication, WhatIsSignedWithOneOfTheKeysIsTaken) {
  const Key other{.id = 9, .secret = {1, 2, 3}};
  Receiver receiver({kGoldenKey, other});
  EXPECT_EQ(verdict(receiver, SignedStream(1).message()[0]), "taken");
  EXPECT_EQ(verdict(receiver, SignedStream(1, 2, other).message()[0]), "taken");
  EXPECT_EQ(verdict(receiver, SignedStream(1, 3, {.id = 10, .secret = other.secret}).message()[0]), "unknown key");
  EXPECT_EQ(verdict(receiver, SignedStream(1, 3, {.id = 9, .secret = kGoldenKey.secret}).message()[0]), "forged");
  EXPECT_EQ(receiver.counters().refused_total(), 2U);
  EXPECT_EQ(receiver.counters().pairs, 2U);
}

TEST(Authentication, WithoutKeysSignedDatagramsAreTakenToo) {
  Receiver receiver;
  SignedStream stream(1);
  EXPECT_EQ(receiver.accept(stream.message()[0]), Outcome::kPair);
  EXPECT_EQ(receiver.accept(stream.status()), Outcome::kStatus);
}

TEST(Authentication, WhatIsNotSignedIsRefused) {
  Receiver receiver({kGoldenKey});
  Encoder encoder(kGoldenConfig);
  EXPECT_EQ(verdict(receiver, encode(encoder, {})[0]), "unsigned");
  EXPECT_EQ(verdict(receiver, encode_status(encoder, golden_status())), "unsigned");
  EXPECT_EQ(verdict(receiver, Bytes(50, std::byte{0xFF})), "malformed");
  EXPECT_EQ(verdict(receiver, {}), "empty");
  EXPECT_EQ(verdict(receiver, Bytes(kMaxDatagramBytes + 1)), "oversized");
}

TEST(Authentication, EveryBitThatIsAlteredIsNoticed) {
  const Bytes whole = SignedStream(1).message(2)[0];
  Receiver receiver({kGoldenKey});
  const std::size_t trailer = whole.size() - kTrailerBytes;
  for (std::size_t i = 0; i < 8 * whole.size(); ++i) {
    Bytes altered = whole;
    altered[i / 8] ^= static_cast<std::byte>(1U << (i % 8));
    const std::string reason = verdict(receiver, altered);
    ASSERT_NE(reason, "taken") << "bit " << i;
    const std::size_t at = i / 8;
    if (at < trailer || at >= trailer + kTrailerBytes - kHashBytes) {
      EXPECT_EQ(reason, "forged") << at;
    } else if (at >= trailer + 2 && at < trailer + 6) {
      EXPECT_EQ(reason, "unknown key") << at;
    }
  }
  EXPECT_EQ(verdict(receiver, whole), "taken") << "what was refused left no trace";
}

TEST(Authentication, EveryTruncationIsRefusedAndCalledOne) {
  const Bytes whole = SignedStream(1).message(2)[0];
  Receiver receiver({kGoldenKey});
  Receiver without_keys;
  for (std::size_t size = 1; size < whole.size(); ++size) {
    const Bytes cut(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(size));
    const std::string reason = verdict(receiver, cut);
    ASSERT_NE(reason, "taken") << size;
    // Of the first bytes nobody can say what they were. Without all of the trailer it is one that was not signed.
    if (size == whole.size() - kTrailerBytes) {
      EXPECT_EQ(reason, "unsigned");
    } else if (size >= 7) {
      EXPECT_EQ(reason, "truncated") << size;
      EXPECT_EQ(verdict(without_keys, cut), "truncated") << size;
    }
  }
}

TEST(Authentication, BytesAppendedAreNoticed) {
  Receiver receiver({kGoldenKey});
  Bytes longer = SignedStream(1).message()[0];
  // Field 21, varint 5: any reader would skip it.
  for (const int byte : {0xA8, 0x01, 0x05}) longer.push_back(static_cast<std::byte>(byte));
  EXPECT_EQ(verdict(receiver, longer), "forged");
}

TEST(Authentication, ARepetitionIsRefused) {
  Receiver receiver({kGoldenKey});
  SignedStream stream(1);
  std::vector<Bytes> all;
  for (int i = 0; i < 40; ++i) {
    for (Bytes& part : stream.message(9)) all.push_back(std::move(part));
    all.push_back(stream.status());
  }
  for (const Bytes& bytes : all) ASSERT_EQ(verdict(receiver, bytes), "taken");
  for (const Bytes& bytes : all) ASSERT_EQ(verdict(receiver, bytes), "replayed");
  EXPECT_EQ(receiver.counters().pairs, 40U);
  EXPECT_EQ(receiver.counters().statuses, 40U);
  EXPECT_EQ(receiver.counters().refused[static_cast<std::size_t>(Refusal::kReplayed)], all.size());
  EXPECT_EQ(receiver.counters().duplicates + receiver.counters().restarts, 0U);
  EXPECT_EQ(receiver.lost(), 0U);
}

TEST(Authentication, WhatComesInAnotherOrderWithinTheWindowIsTaken) {
  Receiver receiver({kGoldenKey});
  SignedStream stream(1);
  std::vector<std::vector<Bytes>> messages;
  messages.reserve(6);
  for (int i = 0; i < 6; ++i) messages.push_back(stream.message(9));
  for (const int i : {0, 5, 2, 4, 1, 3}) {
    for (const int part : {1, 0}) EXPECT_EQ(verdict(receiver, messages[i][part]), "taken") << i;
  }
  EXPECT_EQ(receiver.counters().pairs, 6U);
  EXPECT_EQ(receiver.lost(), 0U);
}

TEST(Authentication, AnOlderSessionIsRefusedAndAnotherRigsDoesNotCount) {
  Receiver receiver({kGoldenKey});
  SignedStream old(7);
  SignedStream newer(8);
  SignedStream other(3, 2);
  EXPECT_EQ(verdict(receiver, old.message()[0]), "taken");
  EXPECT_EQ(verdict(receiver, newer.message()[0]), "taken");
  EXPECT_EQ(verdict(receiver, old.message()[0]), "old session");
  EXPECT_EQ(verdict(receiver, old.status()), "old session");
  EXPECT_EQ(verdict(receiver, other.message()[0]), "taken");
  EXPECT_EQ(verdict(receiver, newer.message()[0]), "taken");
}

TEST(Authentication, ReplaysAcrossMoreStreamsThanAreFollowedAreRefusedStill) {
  Receiver receiver({kGoldenKey});
  std::vector<Bytes> first;
  first.reserve(ReplayGuard::kRigs);
  for (std::uint32_t rig = 0; rig < ReplayGuard::kRigs; ++rig) {
    first.push_back(SignedStream(1, rig).message()[0]);
    ASSERT_EQ(verdict(receiver, first.back()), "taken") << rig;
  }
  EXPECT_EQ(verdict(receiver, SignedStream(1, 1000).message()[0]), "too many rigs");
  for (const Bytes& bytes : first) EXPECT_EQ(verdict(receiver, bytes), "replayed");
}

TEST(Authentication, ALaterReceiverWithTheMarksRefusesWhatWasThere) {
  SignedStream stream(5);
  const auto before = stream.message(9);
  const Bytes status = stream.status();
  Receiver first({kGoldenKey});
  for (const Bytes& part : before) EXPECT_EQ(verdict(first, part), "taken");
  EXPECT_EQ(verdict(first, status), "taken");

  const test::TempDir folder;
  save_marks(folder / "marks", first.marks());
  Receiver second({kGoldenKey});
  second.restore(load_marks(folder / "marks"));
  for (const Bytes& part : before) EXPECT_EQ(verdict(second, part), "replayed");
  EXPECT_EQ(verdict(second, status), "replayed");
  EXPECT_EQ(verdict(second, SignedStream(4).message()[0]), "old session");
  EXPECT_EQ(verdict(second, stream.message()[0]), "taken");
  EXPECT_EQ(verdict(second, stream.status()), "taken");
}

}  // namespace
}  // namespace stereotrack::telemetry
