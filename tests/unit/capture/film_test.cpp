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
};
Show play(Film& film, std::size_t pairs) {
  FramePool pool(4);
  PairOutlet::Notices notices;
  Doorbell bell;
  PairOutlet outlet(pool, notices, bell);
  Show show;
  while (show.seen.size() < pairs && show.last == LiveSource::Step::kGoing) {
    show.last = film.step(outlet, MonotonicTime::max());
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

/// Each by its ordinal: where this machine was kept from running, pairs are passed over.
void expect_levels(const Show& show, const std::vector<int>& cycle) {
  ASSERT_FALSE(show.seen.empty());
  for (const Seen& seen : show.seen) {
    EXPECT_EQ(seen.level, cycle[(seen.ordinal - 1) % cycle.size()]) << seen.ordinal;
  }
}

TEST(Film, OncePlaysEachPairAndEnds) {
  Levels source({1, 2, 3});
  Film film(source, {.repeat = Film::Repeat::kOnce});
  const Show show = play(film, 10);
  expect_levels(show, {1, 2, 3});
  EXPECT_LE(show.seen.back().ordinal, 3U);
  EXPECT_EQ(show.last, LiveSource::Step::kEnded);
}

TEST(Film, BounceGoesBackWithoutShowingAnEndTwice) {
  Levels source({1, 2, 3});
  Film film(source, {.repeat = Film::Repeat::kBounce});
  expect_levels(play(film, 8), {1, 2, 3, 2});
}

TEST(Film, LoopBeginsAnew) {
  Levels source({1, 2, 3});
  Film film(source, {.repeat = Film::Repeat::kLoop});
  expect_levels(play(film, 7), {1, 2, 3});
}

TEST(Film, OnePairAloneIsShownForEver) {
  Levels source({9});
  Film film(source, {.repeat = Film::Repeat::kBounce});
  expect_levels(play(film, 3), {9});
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
  Levels source({1, 0, 3});
  Film film(source, {.repeat = Film::Repeat::kLoop});
  const Show show = play(film, 6);
  expect_levels(show, {1, 0, 3});
  for (const Seen& seen : show.seen) {
    EXPECT_NE(seen.ordinal % 3, 2U);
    EXPECT_EQ(seen.time - show.seen[0].time,
              milliseconds(20) * static_cast<std::int64_t>(seen.ordinal - show.seen[0].ordinal));
  }
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
