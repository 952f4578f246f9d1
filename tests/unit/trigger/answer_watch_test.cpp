#include "drivers/trigger/answer_watch.hpp"

#include <gtest/gtest.h>

#include <random>

namespace stereotrack::trigger {
namespace {

using std::chrono::milliseconds;

constexpr PulseMatcher::Found kAnswer{PulseMatcher::Kind::kAnswer, 1, {}, true};
constexpr PulseMatcher::Found kStray{PulseMatcher::Kind::kStray, 0, milliseconds(7), true};

MonotonicTime at(int frame) { return MonotonicTime(std::chrono::seconds(1) + milliseconds(20) * frame); }

TEST(AnswerWatch, OneThatAnswersHasNothingAgainstIt) {
  AnswerWatch watch;
  watch.begin(at(0));
  for (int i = 1; i <= 100; ++i) watch.frame(kAnswer, at(i));
  EXPECT_FALSE(watch.is_astray());
  EXPECT_FALSE(watch.mostly_strays());
  EXPECT_FALSE(watch.convinces());
  EXPECT_EQ(watch.frames(), 0U);
  EXPECT_EQ(watch.last_answer(), at(100));
}

TEST(AnswerWatch, StraysAreCountedFromWhenAllWasWell) {
  AnswerWatch watch;
  watch.begin(at(0));
  watch.frame(kAnswer, at(1));
  for (int i = 2; i <= 11; ++i) watch.frame(kStray, at(i));
  EXPECT_EQ(watch.frames(), 10U);
  EXPECT_EQ(watch.unanswered(), 10U);
  EXPECT_EQ(watch.unanswered_in_row(), 10U);
  EXPECT_EQ(watch.off(), milliseconds(7));
  EXPECT_EQ(watch.last_answer(), at(1));
  watch.frame(kAnswer, at(12));
  EXPECT_EQ(watch.unanswered_in_row(), 0U);
  EXPECT_EQ(watch.frames(), 11U);  // not made good yet
}

TEST(AnswerWatch, TwentyFourStraysInARowOrEachSecondOfNinetySixAreTooMany) {
  AnswerWatch all;
  int frames = 0;
  for (; !all.mostly_strays(); ++frames) all.frame(kStray, at(frames));
  EXPECT_EQ(frames, 24);
  AnswerWatch half;
  for (frames = 0; !half.mostly_strays(); ++frames) half.frame(frames % 2 == 0 ? kAnswer : kStray, at(frames));
  EXPECT_NEAR(frames, 96, 2);
}

TEST(AnswerWatch, AQuarterOfStraysInAnyOrderIsNotTooMany) {
  std::mt19937 random(3);
  AnswerWatch watch;
  watch.begin(at(0));
  for (int i = 1; i <= 20'000; ++i) {
    watch.frame(random() % 4 != 0 ? kAnswer : kStray, at(i));
    ASSERT_FALSE(watch.mostly_strays()) << i;
  }
}

TEST(AnswerWatch, FramesOfPulsesThatAreForgottenAreNotHeldAgainstIt) {
  AnswerWatch watch;
  for (int i = 1; i <= 100; ++i) watch.frame({PulseMatcher::Kind::kStray, 0, std::chrono::seconds(-9), false}, at(i));
  EXPECT_FALSE(watch.mostly_strays());
  EXPECT_EQ(watch.unanswered_in_row(), 100U);  // but that none answers is seen
}

TEST(AnswerWatch, EightAnswersInARowConvinceAndAreForgottenByOneStray) {
  AnswerWatch watch;
  watch.go_astray();
  for (int i = 1; i <= 7; ++i) watch.frame(kAnswer, at(i));
  EXPECT_FALSE(watch.convinces());
  EXPECT_TRUE(watch.half_convinces());
  watch.frame(kStray, at(8));
  EXPECT_FALSE(watch.half_convinces());
  for (int i = 9; i <= 16; ++i) {
    EXPECT_FALSE(watch.convinces()) << i;
    watch.frame(kAnswer, at(i));
  }
  EXPECT_TRUE(watch.convinces());
  EXPECT_EQ(watch.last_answer(), MonotonicTime());  // of what was not believed
  watch.begin(at(17));
  EXPECT_FALSE(watch.is_astray());
  EXPECT_EQ(watch.last_answer(), at(17));
}

TEST(AnswerWatch, OneThatGoesAstrayAgainAndAgainMustShowMoreUnlessItWasGoodForLong) {
  AnswerWatch watch;
  for (const std::uint32_t want : {8U, 16U, 32U, 64U, 128U, 256U, 512U, 1024U, 1024U}) {
    watch.go_astray();
    watch.go_astray();  // says nothing new
    EXPECT_EQ(watch.convincing(), want);
    watch.begin(at(0));
    for (int i = 0; i < 1023; ++i) watch.frame(kAnswer, at(i));
  }
  watch.frame(kAnswer, at(1023));
  watch.go_astray();
  EXPECT_EQ(watch.convincing(), 8U);
}

}  // namespace
}  // namespace stereotrack::trigger
