#include "drivers/telemetry/replay_guard.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <random>
#include <set>
#include <string>

#include "tests/support/temp_dir.hpp"

namespace stereotrack::telemetry {
namespace {

using testing::HasSubstr;
using Verdict = ReplayGuard::Verdict;

Datagram message(std::uint64_t sequence, std::uint32_t part = 1, std::uint64_t session = 1, std::uint32_t rig = 1) {
  Datagram datagram;
  datagram.header.rig = rig;
  datagram.header.session = session;
  datagram.header.sequence = sequence;
  datagram.header.part = part;
  return datagram;
}

Datagram status(std::uint64_t sequence, std::uint64_t session = 1) {
  Datagram datagram = message(0, 1, session);
  datagram.status.emplace();
  datagram.status_sequence = sequence;
  return datagram;
}

TEST(ReplayGuard, SixteenMessagesOfFourPartsAreTheWindow) {
  ReplayGuard guard;
  EXPECT_EQ(guard.admit(message(100, 4)), Verdict::kFresh);
  EXPECT_EQ(guard.admit(message(85, 1)), Verdict::kFresh) << "63 numbers below";
  EXPECT_EQ(guard.admit(message(84, 4)), Verdict::kReplayed) << "64 numbers below: cannot be told";
  EXPECT_EQ(guard.admit(message(85, 1)), Verdict::kReplayed);
  EXPECT_EQ(guard.admit(message(100, 4)), Verdict::kReplayed);
  EXPECT_EQ(guard.admit(message(101, 1)), Verdict::kFresh);
  EXPECT_EQ(guard.admit(message(85, 1)), Verdict::kReplayed) << "left the window";
}

TEST(ReplayGuard, AnyOrderAgainstASetOfAllThatWasThere) {
  std::mt19937_64 random(5);
  ReplayGuard guard;
  std::set<std::uint64_t> seen;
  std::uint64_t highest = 0;
  int fresh = 0;
  for (int n = 0; n < 100'000; ++n) {
    const std::uint64_t number = 400 + static_cast<std::uint64_t>(n) / 2 + random() % 150;
    const bool expected = number > highest || (highest - number < ReplayGuard::kWindow && !seen.contains(number));
    if (expected) seen.insert(number);
    highest = std::max(highest, number);
    const auto part = static_cast<std::uint32_t>(number % 4 + 1);
    ASSERT_EQ(guard.admit(message(number / 4, part)) == Verdict::kFresh, expected) << number;
    fresh += expected ? 1 : 0;
  }
  EXPECT_GT(fresh, 10'000);
}

TEST(ReplayGuard, StatusesHaveAWindowOfTheirOwn) {
  ReplayGuard guard;
  EXPECT_EQ(guard.admit(message(1000)), Verdict::kFresh);
  EXPECT_EQ(guard.admit(status(1)), Verdict::kFresh);
  EXPECT_EQ(guard.admit(status(3)), Verdict::kFresh);
  EXPECT_EQ(guard.admit(status(2)), Verdict::kFresh);
  EXPECT_EQ(guard.admit(status(2)), Verdict::kReplayed);
  EXPECT_EQ(guard.admit(message(1001)), Verdict::kFresh);
}

TEST(ReplayGuard, AHigherSessionBeginsAnewAndALowerOneIsRefused) {
  ReplayGuard guard;
  EXPECT_EQ(guard.admit(message(1000, 1, 5)), Verdict::kFresh);
  EXPECT_EQ(guard.admit(status(1000, 5)), Verdict::kFresh);
  EXPECT_EQ(guard.admit(message(1, 1, 6)), Verdict::kFresh);
  EXPECT_EQ(guard.admit(status(1, 6)), Verdict::kFresh);
  EXPECT_EQ(guard.admit(message(1001, 1, 5)), Verdict::kOldSession);
  EXPECT_EQ(guard.admit(message(1, 1, 6)), Verdict::kReplayed);
}

TEST(ReplayGuard, NumbersAtTheEndOfTheirRangeAreHarmless) {
  constexpr std::uint64_t kMost = std::numeric_limits<std::uint64_t>::max();
  ReplayGuard guard;
  EXPECT_EQ(guard.admit(message(kMost / 4, 4, kMost)), Verdict::kFresh);
  EXPECT_EQ(guard.admit(message(kMost / 4, 4, kMost)), Verdict::kReplayed);
  EXPECT_EQ(guard.admit(message(kMost, 1, kMost)), Verdict::kFresh) << "wraps to one below";
  EXPECT_EQ(guard.admit(status(kMost, kMost)), Verdict::kFresh);
  EXPECT_EQ(guard.admit(status(1, kMost)), Verdict::kReplayed);
}

TEST(ReplayGuard, OneRigTooManyIsNotTakenAndTheOthersGoOn) {
  ReplayGuard guard;
  for (std::uint32_t rig = 0; rig < ReplayGuard::kRigs; ++rig) {
    EXPECT_EQ(guard.admit(message(1, 1, 1, rig)), Verdict::kFresh);
  }
  EXPECT_EQ(guard.admit(message(1, 1, 1, 999)), Verdict::kTooManyRigs);
  EXPECT_EQ(guard.admit(message(2, 1, 1, 0)), Verdict::kFresh);
  EXPECT_EQ(guard.marks().size(), ReplayGuard::kRigs);
}

TEST(ReplayGuard, NothingUpToRestoredMarksIsFresh) {
  ReplayGuard guard;
  guard.restore(std::vector<Mark>{{.rig = 1, .session = 4, .message = 4 * 10 + 1, .status = 3}});
  EXPECT_EQ(guard.admit(message(10, 1, 4)), Verdict::kReplayed) << "was not seen, but cannot be told";
  EXPECT_EQ(guard.admit(message(10, 2, 4)), Verdict::kReplayed);
  EXPECT_EQ(guard.admit(message(10, 3, 4)), Verdict::kFresh);
  EXPECT_EQ(guard.admit(status(3, 4)), Verdict::kReplayed);
  EXPECT_EQ(guard.admit(status(4, 4)), Verdict::kFresh);
  EXPECT_EQ(guard.admit(message(99, 1, 3)), Verdict::kOldSession);
}

TEST(Marks, ComeBackFromTheirFile) {
  const test::TempDir folder;
  const std::vector<Mark> marks{{.rig = 4294967295, .session = 18446744073709551615U, .message = 7, .status = 0},
                                {.rig = 0, .session = 1, .message = 0, .status = 9}};
  EXPECT_TRUE(load_marks(folder / "marks").empty()) << "no file yet";
  save_marks(folder / "marks", marks);
  EXPECT_EQ(load_marks(folder / "marks"), marks);
  save_marks(folder / "marks", {});
  EXPECT_TRUE(load_marks(folder / "marks").empty());
  EXPECT_FALSE(std::filesystem::exists(folder / "marks.new"));
}

TEST(Marks, AFileThatIsNotOneIsRefusedWithItsLine) {
  const test::TempDir folder;
  for (const char* bad : {"1 2 3 4\nhello\n", "1 2 3 4\n1 2 3\n", "1 2 3 4\n1 2 3 4 5\n", "1 2 3 4\n1 2 3 -4\n",
                          "1 2 3 4\n4294967296 2 3 4\n", "1 2 3 4\n1  2 3 4\n", "1 2 3 4\n\n"}) {
    const auto file = folder.write("marks", bad);
    try {
      (void)load_marks(file);
      FAIL() << bad;
    } catch (const MarksFileError& error) {
      EXPECT_THAT(error.what(), HasSubstr(file.string() + ": line 2 is not RIG SESSION MESSAGE STATUS")) << bad;
    }
  }
  EXPECT_THROW((void)load_marks(folder.path()), MarksFileError);
  EXPECT_THROW(save_marks(folder / "missing" / "marks", {}), MarksFileError);
}

}  // namespace
}  // namespace stereotrack::telemetry
