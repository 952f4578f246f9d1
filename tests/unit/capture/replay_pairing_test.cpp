#include "drivers/capture/replay/pairing.hpp"
#include "tests/unit/capture/replay_support.hpp"

namespace stereotrack::capture {
namespace {

using std::chrono::nanoseconds;
using testing::ElementsAre;
using testing::HasSubstr;

View timed(const std::vector<std::int64_t>& times, const std::string& prefix) {
  View view;
  for (const std::int64_t time : times) {
    view.push_back({prefix + std::to_string(time), nanoseconds(time), std::nullopt});
  }
  return view;
}

View numbered(const std::vector<std::uint64_t>& numbers, const std::string& prefix) {
  View view;
  for (const std::uint64_t number : numbers) view.push_back({prefix + std::to_string(number), std::nullopt, number});
  return view;
}

/// "L1-R1" a pair, "L1-" a left file without partner.
std::vector<std::string> text(const Pairing& pairing) {
  std::vector<std::string> list;
  for (const PairEntry& entry : pairing.entries) list.push_back(entry.left.string() + "-" + entry.right.string());
  return list;
}

std::vector<std::int64_t> times(const Pairing& pairing) {
  std::vector<std::int64_t> list;
  for (const PairEntry& entry : pairing.entries) list.push_back(entry.time.time_since_epoch().count());
  return list;
}

TEST(PairByTime, NearestWithinHalfAPeriodAndSkewIsKept) {
  const Pairing pairing = pair_views(timed({1000, 2000, 3000}, "L"), timed({1040, 1990, 3500}, "R"), 30);
  EXPECT_EQ(pairing.by, PairedBy::kTime);
  EXPECT_EQ(pairing.period, nanoseconds(1000));
  EXPECT_THAT(text(pairing), ElementsAre("L1000-R1040", "L2000-R1990", "L3000-R3500"));
  EXPECT_THAT(times(pairing), ElementsAre(1000, 2000, 3000)) << "the left picture's time";
  EXPECT_EQ(pairing.entries[0].skew, nanoseconds(40));
  EXPECT_EQ(pairing.entries[1].skew, nanoseconds(-10));
}

TEST(PairByTime, WithoutPartnerThereIsNoSkew) {
  const Pairing pairing = pair_views(timed({1000, 2000}, "L"), timed({1001}, "R"), 30);
  EXPECT_EQ(pairing.entries[0].skew, nanoseconds(1));
  EXPECT_EQ(pairing.entries[1].skew, std::nullopt);
  EXPECT_EQ(single_view(timed({1000, 2000}, "L"), 30).entries[0].skew, std::nullopt);
}

TEST(PairByTime, OverHalfAPeriodIsNoPair) {
  const Pairing pairing = pair_views(timed({1000, 2000, 3000}, "L"), timed({1000, 2000, 3501}, "R"), 30);
  EXPECT_THAT(text(pairing), ElementsAre("L1000-R1000", "L2000-R2000", "L3000-", "-R3501"));
  EXPECT_THAT(pairing.entries[2].fault, HasSubstr("L3000: no right picture within half a period of 1 us"));
  EXPECT_THAT(pairing.entries[3].fault, HasSubstr("R3501: no left picture"));
}

TEST(PairByTime, MissingFileDoesNotShiftTheRest) {
  const Pairing pairing = pair_views(timed({1000, 2000, 3000, 4000}, "L"), timed({1001, 3001, 4001}, "R"), 30);
  EXPECT_THAT(text(pairing), ElementsAre("L1000-R1001", "L2000-", "L3000-R3001", "L4000-R4001"));
}

TEST(PairByTime, OneRightFileServesOneLeftFileTheClosest) {
  const Pairing pairing = pair_views(timed({1000, 2000, 2900, 3100, 4000}, "L"), timed({1000, 3080, 4000}, "R"), 30);
  EXPECT_THAT(text(pairing), ElementsAre("L1000-R1000", "L2000-", "L2900-", "L3100-R3080", "L4000-R4000"));
}

TEST(PairByTime, MedianPeriodIgnoresAGap) {
  EXPECT_EQ(pair_views(timed({0, 10, 20, 500, 510}, "L"), timed({0}, "R"), 30).period, nanoseconds(10));
}

TEST(PairByTime, NoCommonTimeIsAnError) {
  EXPECT_THAT(
      [] {
        (void)pair_views(timed({1000, 2000}, "d/L"), timed({90000, 91000}, "R"), 30);
      },
      testing::ThrowsMessage<std::runtime_error>(HasSubstr("no time stamp lies within half a period")));
}

TEST(PairByTime, StrayFileIsNamedAndTheRestStaysPairedByTime) {
  View left = timed({1000, 2000, 3000}, "L");
  left.insert(left.begin(), {"cover.png", std::nullopt, std::nullopt});
  const Pairing pairing = pair_views(left, timed({1000, 2000, 3000}, "R"), 30);
  EXPECT_THAT(text(pairing), ElementsAre("L1000-R1000", "L2000-R2000", "L3000-R3000", "cover.png-"));
  EXPECT_THAT(pairing.entries[3].fault, HasSubstr("cover.png: no time stamp in the name"));
}

TEST(PairByTime, SecondPictureOfATimeIsNoPair) {
  const Pairing pairing = pair_views(timed({1000, 1000, 2000}, "L"), timed({1000, 1000, 2000}, "R"), 30);
  ASSERT_EQ(pairing.entries.size(), 3U);
  EXPECT_EQ(pairing.entries[0].fault, "");
  EXPECT_THAT(pairing.entries[1].fault, HasSubstr("has the time or number of the picture before it"));
  EXPECT_EQ(pairing.entries[2].fault, "");
}

TEST(PairByNumber, NumbersNotOrderDecide) {
  const Pairing pairing = pair_views(numbered({10, 2, 3}, "L"), numbered({2, 3, 10}, "R"), 10);
  EXPECT_EQ(pairing.by, PairedBy::kNumber);
  EXPECT_THAT(text(pairing), ElementsAre("L2-R2", "L3-R3", "L10-R10"));
}

TEST(PairByNumber, GapsAreElapsedPeriods) {
  const Pairing pairing = pair_views(numbered({7, 8, 11}, "L"), numbered({7, 8, 11}, "R"), 10);
  EXPECT_THAT(times(pairing), ElementsAre(0, 100'000'000, 400'000'000));
  EXPECT_EQ(pairing.period, nanoseconds(100'000'000));
  EXPECT_EQ(pairing.entries[0].skew, std::nullopt);
}

TEST(PairByNumber, FileWithoutPartnerKeepsItsOrdinal) {
  const Pairing pairing = pair_views(numbered({1, 2, 4}, "L"), numbered({1, 3, 4}, "R"), 10);
  EXPECT_THAT(text(pairing), ElementsAre("L1-R1", "L2-", "-R3", "L4-R4"));
  EXPECT_THAT(pairing.entries[1].fault, HasSubstr("L2: no right picture of number 2"));
}

TEST(PairByNumber, SecondFileOfANumberIsNoPair) {
  const Pairing pairing = pair_views(numbered({1, 1, 2}, "L"), numbered({1, 2}, "R"), 10);
  EXPECT_THAT(text(pairing), ElementsAre("L1-R1", "L1-", "L2-R2"));
}

TEST(PairByNumber, DatesAreNotFrameCounts) {
  const std::vector<std::uint64_t> dates{20200401123000123, 20200401123000156, 20200501123000189};
  EXPECT_THAT(times(pair_views(numbered(dates, "L"), numbered(dates, "R"), 10)),
              ElementsAre(0, 100'000'000, 200'000'000));
}

TEST(PairByOrder, ServesWhereNoNumberIsCommon) {
  const Pairing pairing = pair_views(numbered({1, 2, 3}, "L"), numbered({101, 102}, "R"), 10);
  EXPECT_EQ(pairing.by, PairedBy::kOrder);
  EXPECT_THAT(text(pairing), ElementsAre("L1-R101", "L2-R102", "L3-"));
  EXPECT_THAT(times(pairing), ElementsAre(0, 100'000'000, 200'000'000));
}

TEST(PairByOrder, ServesWhereNamesHoldNoNumber) {
  const View left{{"a", {}, {}}, {"b", {}, {}}};
  const Pairing pairing = pair_views(left, {{"x", {}, {}}, {"y", {}, {}}}, 10);
  EXPECT_EQ(pairing.by, PairedBy::kOrder);
  EXPECT_THAT(text(pairing), ElementsAre("a-x", "b-y"));
}

TEST(SingleView, HasNoPartnersAndNoFaults) {
  const Pairing pairing = single_view(numbered({470, 471, 473}, "in"), 10);
  EXPECT_THAT(text(pairing), ElementsAre("in470-", "in471-", "in473-"));
  EXPECT_THAT(times(pairing), ElementsAre(0, 100'000'000, 300'000'000));
  for (const PairEntry& entry : pairing.entries) EXPECT_EQ(entry.fault, "");
}

TEST(AtRate, RoundsToTheNanosecondWithoutDrift) {
  EXPECT_EQ(at_rate(0, 30), nanoseconds(0));
  EXPECT_EQ(at_rate(1, 30), nanoseconds(33'333'333));
  EXPECT_EQ(at_rate(2, 30), nanoseconds(66'666'667));
  EXPECT_EQ(at_rate(3'000'000, 30), nanoseconds(100'000'000'000'000));
}

}  // namespace
}  // namespace stereotrack::capture
