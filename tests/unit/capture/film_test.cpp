#include "drivers/capture/film/film.hpp"

#include <gtest/gtest.h>

#include <array>
#include <chrono>
#include <stdexcept>
#include <vector>

namespace stereotrack::capture {
namespace {

using std::chrono::milliseconds;
using std::chrono::nanoseconds;

constexpr int kWidth = 8;
constexpr int kHeight = 4;

/// Pairs of one grey level each; level 0: cannot be read.
class Levels final : public FrameSource {
 public:
  explicit Levels(std::vector<std::uint8_t> levels, milliseconds period = milliseconds(20))
      : levels_(std::move(levels)) {
    info_.name = "levels";
    info_.width = kWidth;
    info_.height = kHeight;
    info_.period = period;
  }
  [[nodiscard]] const SourceInfo& info() const noexcept override { return info_; }
  [[nodiscard]] Next next(FramePair& out) noexcept override {
    if (done_ == levels_.size()) return Next::kEnd;
    pixels_.fill(levels_[done_]);
    out = {};
    out.ordinal = ++done_;
    out.capture_time = CaptureTime(info_.period * static_cast<std::int64_t>(done_));
    out.left = out.right = {pixels_.data(), kWidth, kHeight, 16, PixelFormat::kGrey8};
    return levels_[done_ - 1] == 0 ? Next::kSkipped : Next::kPair;
  }
  [[nodiscard]] const std::string& skip_reason() const noexcept override { return info_.name; }
  void skip_to(std::uint64_t) noexcept override {}

 private:
  SourceInfo info_;
  std::vector<std::uint8_t> levels_;
  std::size_t done_ = 0;
  std::array<std::uint8_t, 16 * kHeight> pixels_{};
};

struct Seen {
  std::uint64_t ordinal;
  std::uint8_t level;
  CaptureTime time;
};

/// What comes out of the pool while the film is played for so many pairs, its end included.
struct Show {
  std::vector<Seen> seen;
  LiveSource::Step last = LiveSource::Step::kGoing;
  bool disturbed = false;  ///< this machine was kept from running, so that pairs may have been passed over
};
Show play(Film& film, std::size_t pairs) {
  FramePool pool(4);
  PairOutlet::Notices notices;
  Doorbell bell;
  PairOutlet outlet(pool, notices, bell);
  Show show;
  auto due = std::chrono::steady_clock::now();
  while (show.seen.size() < pairs && show.last == LiveSource::Step::kGoing) {
    show.last = film.step(outlet, MonotonicTime::max());
    show.disturbed = show.disturbed || std::chrono::steady_clock::now() - due > 2 * film.info().period;
    due += film.info().period;
    if (const PairLease lease = pool.take_oldest()) {
      show.seen.push_back({lease->ordinal, lease->left.row(kHeight - 1)[kWidth - 1], lease->capture_time});
      PairNotice notice;
      EXPECT_TRUE(notices.pop(notice));
      EXPECT_EQ(notice.ordinal, lease->ordinal);
      EXPECT_EQ(notice.capture_time, lease->capture_time);
      EXPECT_EQ(lease->right.row(0)[0], show.seen.back().level);
    }
  }
  return show;
}

/// The same of a new film, until nothing has disturbed it.
Show play_undisturbed(const std::vector<std::uint8_t>& levels, Film::Repeat repeat, std::size_t pairs) {
  for (int i = 0; i < 100; ++i) {
    Levels source(levels);
    Film film(source, {.repeat = repeat});
    Show show = play(film, pairs);
    if (!show.disturbed) return show;
  }
  ADD_FAILURE() << "this machine never ran for as long as the film";
  return {};
}

std::vector<int> levels_of(const Show& show) {
  std::vector<int> levels;
  for (const Seen& seen : show.seen) levels.push_back(seen.level);
  return levels;
}

TEST(Film, OncePlaysEachPairAndEnds) {
  const Show show = play_undisturbed({1, 2, 3}, Film::Repeat::kOnce, 10);
  EXPECT_EQ(levels_of(show), (std::vector<int>{1, 2, 3}));
  EXPECT_EQ(show.last, LiveSource::Step::kEnded);
}

TEST(Film, BounceGoesBackWithoutShowingAnEndTwice) {
  const Show show = play_undisturbed({1, 2, 3}, Film::Repeat::kBounce, 8);
  EXPECT_EQ(levels_of(show), (std::vector<int>{1, 2, 3, 2, 1, 2, 3, 2}));
}

TEST(Film, LoopBeginsAnew) {
  const Show show = play_undisturbed({1, 2, 3}, Film::Repeat::kLoop, 7);
  EXPECT_EQ(levels_of(show), (std::vector<int>{1, 2, 3, 1, 2, 3, 1}));
}

TEST(Film, OnePairAloneIsShownForEver) {
  const Show show = play_undisturbed({9}, Film::Repeat::kBounce, 3);
  EXPECT_EQ(levels_of(show), (std::vector<int>{9, 9, 9}));
}

TEST(Film, OrdinalsAndTimesRiseByThePeriodWhicheverWayItIsPlayed) {
  Levels source({1, 2, 3}, milliseconds(2));
  Film film(source, {.repeat = Film::Repeat::kBounce});
  const Show show = play(film, 9);
  for (std::size_t i = 1; i < show.seen.size(); ++i) {
    // Whole periods apart: a pair is passed over, never shown late.
    const std::uint64_t steps = show.seen[i].ordinal - show.seen[i - 1].ordinal;
    EXPECT_GE(steps, 1U);
    EXPECT_EQ(show.seen[i].time - show.seen[i - 1].time, milliseconds(2) * static_cast<std::int64_t>(steps));
  }
}

TEST(Film, WhatCouldNotBeReadLeavesAGap) {
  const Show show = play_undisturbed({1, 0, 3}, Film::Repeat::kOnce, 10);
  ASSERT_EQ(levels_of(show), (std::vector<int>{1, 3}));
  EXPECT_EQ(show.seen[1].ordinal, 3U);
  EXPECT_EQ(show.seen[1].time - show.seen[0].time, milliseconds(40));
}

TEST(Film, StepReturnsAtItsDeadlineWhenNoPairIsDue) {
  Levels source({1, 2}, milliseconds(60'000));
  Film film(source, {.repeat = Film::Repeat::kLoop});
  FramePool pool(2);
  PairOutlet::Notices notices;
  Doorbell bell;
  PairOutlet outlet(pool, notices, bell);
  EXPECT_EQ(film.step(outlet, MonotonicTime::max()), LiveSource::Step::kGoing);
  // A minute away; a moment that is over does not wait at all.
  EXPECT_EQ(film.step(outlet, MonotonicTime()), LiveSource::Step::kGoing);
  EXPECT_EQ(pool.counters().captured, 1U);
}

TEST(Film, TooLargeForItsMemoryIsRefusedWithTheKeyToRaise) {
  Levels source({1, 2, 3});
  EXPECT_EQ((Film(source, {.most_bytes = 6 * kWidth * kHeight}).bytes()), 6U * kWidth * kHeight);
  Levels again({1, 2, 3});
  try {
    const Film film(again, {.most_bytes = 6 * kWidth * kHeight - 1});
    FAIL() << "it was taken";
  } catch (const std::runtime_error& error) {
    EXPECT_NE(std::string(error.what()).find("source.memory_mb"), std::string::npos) << error.what();
    EXPECT_NE(std::string(error.what()).find("levels: "), std::string::npos) << error.what();
  }
}

TEST(Film, WithoutAnyPairIsRefused) {
  Levels source({0, 0});
  EXPECT_THROW((Film(source, {})), std::runtime_error);
}

}  // namespace
}  // namespace stereotrack::capture
