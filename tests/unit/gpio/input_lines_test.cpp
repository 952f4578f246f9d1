#include "drivers/gpio/input_lines.hpp"

#include <gtest/gtest.h>
#include <poll.h>
#include <sys/stat.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <string>
#include <thread>
#include <vector>

#include "drivers/gpio/simulated_chip.hpp"
#include "tests/support/temp_dir.hpp"
#include "tests/unit/gpio/support.hpp"

namespace stereotrack::gpio {
namespace {

namespace fs = std::filesystem;

MonotonicTime at(int ms) { return MonotonicTime(std::chrono::milliseconds(ms)); }

InputSpec sim(const std::string& line, Edges edges = Edges::kBoth, bool active_low = false) {
  return {.name = {"sim", line}, .active_low = active_low, .edges = edges};
}

InputLines open(const std::vector<InputSpec>& specs) { return open_inputs(specs, "test"); }

std::string refusal(const std::vector<InputSpec>& specs) {
  return refusal_of([&] { static_cast<void>(open(specs)); });
}

bool is_readable(const InputLines& lines) {
  pollfd waited{lines.descriptor(), POLLIN, 0};
  return poll(&waited, 1, 0) == 1;
}

std::vector<EdgeEvent> all_of(InputLines& lines) {
  std::vector<EdgeEvent> all;
  std::array<EdgeEvent, 3> some;  // fewer than there are: read again and again
  for (std::size_t count = lines.read(some); count > 0; count = lines.read(some)) {
    all.insert(all.end(), some.begin(), some.begin() + static_cast<std::ptrdiff_t>(count));
  }
  return all;
}

void write(const fs::path& fifo, const std::string& text) { std::ofstream(fifo) << text; }

TEST(InputLines, NoneIsGood) {
  InputLines none = open({});
  EXPECT_EQ(none.size(), 0U);
  EXPECT_EQ(none.descriptor(), -1);
  EXPECT_TRUE(all_of(none).empty());
  none.probe();
  EXPECT_EQ(none.gone(), 0U);
  EXPECT_EQ(none.reopen(), 0U);
}

TEST(InputLines, EachEdgeComesOnceWithItsTimeAndNumber) {
  InputLines lines = open({sim("in_a"), sim("in_b")});
  EXPECT_FALSE(is_readable(lines));
  EXPECT_TRUE(simulated_chip::drive("in_b", true, at(7)));
  EXPECT_TRUE(simulated_chip::drive("in_b", true, at(8))) << "no edge";
  EXPECT_TRUE(simulated_chip::drive("in_b", false, at(9)));
  EXPECT_TRUE(is_readable(lines));
  const std::vector<EdgeEvent> events = all_of(lines);
  ASSERT_EQ(events.size(), 2U);
  EXPECT_EQ(events[0].line, 1U);
  EXPECT_EQ(events[0].edge, Edge::kRising);
  EXPECT_EQ(events[0].time, at(7));
  EXPECT_EQ(events[0].sequence, 1U);
  EXPECT_EQ(events[1].edge, Edge::kFalling);
  EXPECT_EQ(events[1].time, at(9));
  EXPECT_EQ(events[1].sequence, 2U);
  EXPECT_FALSE(is_readable(lines));
  EXPECT_EQ(lines.reading(0).events, 0U);
  EXPECT_EQ(lines.reading(1).events, 2U);
  EXPECT_EQ(lines.reading(1).last, at(9));
  EXPECT_EQ(lines.reading(1).lost, 0U);
  EXPECT_EQ(to_string(lines.name(1)), "sim:in_b");
  EXPECT_FALSE(simulated_chip::drive("in_nobody", true, at(1)));
}

TEST(InputLines, OnlyTheEdgesThatWereAskedForAreToldAsLogic) {
  InputLines lines = open({sim("rise", Edges::kRising), sim("fall", Edges::kFalling),
                           sim("low_rise", Edges::kRising, true), sim("low_fall", Edges::kFalling, true)});
  for (const char* line : {"rise", "fall", "low_rise", "low_fall"}) {
    simulated_chip::drive(line, true, at(1));
    simulated_chip::drive(line, false, at(2));
  }
  const std::vector<EdgeEvent> events = all_of(lines);
  ASSERT_EQ(events.size(), 4U);
  EXPECT_EQ(events[0].time, at(1));
  EXPECT_EQ(events[0].edge, Edge::kRising);
  EXPECT_EQ(events[1].time, at(2));
  EXPECT_EQ(events[1].edge, Edge::kFalling);
  EXPECT_EQ(events[2].time, at(2));
  EXPECT_EQ(events[2].edge, Edge::kRising) << "an active_low line rises when its level falls";
  EXPECT_EQ(events[3].time, at(1));
  EXPECT_EQ(events[3].edge, Edge::kFalling);
}

TEST(InputLines, ALineThatNobodyDrivesShowsItsBias) {
  InputSpec up = sim("pulled_up");
  up.bias = Bias::kPullUp;
  InputSpec down = sim("pulled_down");
  down.bias = Bias::kPullDown;
  const InputLines lines = open({up, down, sim("as_is")});
  EXPECT_EQ(simulated_chip::level("pulled_up"), true);
  EXPECT_EQ(simulated_chip::level("pulled_down"), false);
  EXPECT_EQ(simulated_chip::level("as_is"), false);
}

TEST(InputLines, AsManyEdgesAsAreKeptComeAndWhatIsBeyondIsCounted) {
  constexpr int kKept = static_cast<int>(simulated_chip::kKeptEdges);
  InputLines lines = open({sim("burst")});
  for (int i = 1; i <= kKept; ++i) simulated_chip::drive("burst", i % 2 == 1, at(i));
  EXPECT_EQ(all_of(lines).size(), simulated_chip::kKeptEdges);
  EXPECT_EQ(lines.reading(0).lost, 0U);
  for (int i = 1; i <= kKept + 3; ++i) simulated_chip::drive("burst", i % 2 == 1, at(100 + i));
  const std::vector<EdgeEvent> events = all_of(lines);
  ASSERT_EQ(events.size(), simulated_chip::kKeptEdges);
  EXPECT_EQ(events[0].lost, 3U);
  EXPECT_EQ(events[0].time, at(104)) << "the oldest are lost";
  EXPECT_EQ(events[1].lost, 0U);
  EXPECT_EQ(lines.reading(0).lost, 3U);
  EXPECT_EQ(lines.reading(0).events, 2 * simulated_chip::kKeptEdges);
}

TEST(InputLines, AChipThatWentIsToldAndComesBack) {
  InputLines lines = open({sim("cable"), sim("cable_too")});
  simulated_chip::drive("cable", true, at(1));
  EXPECT_EQ(all_of(lines).size(), 1U);
  simulated_chip::set_gone("cable_too", true);
  EXPECT_TRUE(is_readable(lines)) << "it wakes who waits";
  EXPECT_TRUE(all_of(lines).empty());
  EXPECT_FALSE(is_readable(lines));
  EXPECT_EQ(lines.gone(), 0b11U);
  EXPECT_EQ(lines.outages(), 1U);
  EXPECT_EQ(lines.why(), "No such device");
  lines.probe();
  EXPECT_EQ(lines.outages(), 1U);
  EXPECT_EQ(lines.reopen(), 0U);
  EXPECT_EQ(lines.why(), "GPIO line sim:cable_too: no such chip: the simulated one is gone");

  simulated_chip::drive("cable", false, at(2));  // nobody is told
  simulated_chip::set_gone("cable_too", false);
  EXPECT_EQ(lines.reopen(), 0b11U);
  EXPECT_EQ(lines.gone(), 0U);
  simulated_chip::drive("cable", true, at(3));
  const std::vector<EdgeEvent> events = all_of(lines);
  ASSERT_EQ(events.size(), 1U);
  EXPECT_EQ(events[0].sequence, 1U);
  EXPECT_EQ(events[0].lost, 0U) << "sequences begin anew";
  EXPECT_EQ(lines.reading(0).events, 2U) << "counts go on";
}

TEST(InputLines, ProbeFindsAChipThatWokeNobody) {
  InputLines lines = open({sim("silent")});
  simulated_chip::set_refusing("silent", EIO);
  EXPECT_FALSE(is_readable(lines));
  lines.probe();
  EXPECT_EQ(lines.gone(), 1U);
  simulated_chip::set_refusing("silent", 0);
  EXPECT_EQ(lines.reopen(), 1U);
}

TEST(InputLines, AFifoIsDrivenFromOutside) {
  const test::TempDir folder;
  const fs::path fifo = folder / "door";
  InputLines lines = open({sim(fifo.string())});
  ASSERT_TRUE(fs::is_fifo(fifo));
  EXPECT_FALSE(is_readable(lines));
  timespec before{};
  ASSERT_EQ(clock_gettime(CLOCK_MONOTONIC, &before), 0);
  write(fifo, "1\n");
  EXPECT_TRUE(is_readable(lines));
  std::vector<EdgeEvent> events = all_of(lines);
  ASSERT_EQ(events.size(), 1U);
  EXPECT_EQ(events[0].edge, Edge::kRising);
  EXPECT_GE(events[0].time,
            MonotonicTime(std::chrono::seconds(before.tv_sec) + std::chrono::nanoseconds(before.tv_nsec)));
  write(fifo, "what is 1 is 1\n0\n");
  events = all_of(lines);
  ASSERT_EQ(events.size(), 1U);
  EXPECT_EQ(events[0].edge, Edge::kFalling);
  EXPECT_FALSE(is_readable(lines));
  write(fifo, "10101");
  EXPECT_EQ(all_of(lines).size(), 5U);
  lines = InputLines();
  EXPECT_FALSE(fs::exists(fifo)) << "let go";
}

TEST(InputLines, AFifoThatIsMovedAwayIsAChipThatWent) {
  const test::TempDir folder;
  fs::create_directory(folder / "usb");
  const fs::path fifo = folder / "usb" / "door";
  InputLines lines = open({sim(fifo.string())});
  lines.probe();
  EXPECT_EQ(lines.gone(), 0U);
  fs::rename(folder / "usb", folder / "away");
  lines.probe();
  EXPECT_EQ(lines.gone(), 1U);
  EXPECT_EQ(lines.reopen(), 0U);
  EXPECT_EQ(lines.why(), "GPIO line sim:" + fifo.string() +
                             ": no FIFO can be made there: No such file or directory: give the path of a file in a "
                             "folder that can be written to");
  fs::rename(folder / "away", folder / "usb");
  EXPECT_EQ(lines.reopen(), 1U);
  write(fifo, "1");
  EXPECT_EQ(all_of(lines).size(), 1U);
}

TEST(InputLines, AFifoIsNeverMadeOfAFile) {
  const test::TempDir folder;
  const fs::path file = folder.write("file", "precious");
  EXPECT_EQ(refusal({sim(file.string())}),
            "GPIO line sim:" + file.string() + ": it is no FIFO: delete it, or give another path");
  EXPECT_EQ(fs::file_size(file), 8U);
}

TEST(InputLines, TheyMove) {
  InputLines lines;
  lines = open({sim("in_moved")});
  InputLines there = std::move(lines);
  simulated_chip::drive("in_moved", true, at(1));
  EXPECT_EQ(all_of(there).size(), 1U);
  there = InputLines();
  EXPECT_EQ(open({sim("in_moved")}).size(), 1U) << "let go";
}

TEST(OpenInputs, ALineInUseOrNamedTwiceIsRefused) {
  const InputLines held = open({sim("in_held")});
  EXPECT_EQ(refusal({sim("in_free"), sim("in_held")}), "GPIO line sim:in_held: busy: held by \"test\"");
  EXPECT_EQ(refusal({sim("in_free"), sim("in_free")}), "GPIO line sim:in_free: named twice");
  EXPECT_EQ(open({sim("in_free")}).size(), 1U) << "all or none";
  const OutputLines output = open_lines(std::vector<LineSpec>{{{"sim", "out_held"}}}, "rules");
  EXPECT_EQ(refusal({sim("out_held")}), "GPIO line sim:out_held: busy: held by \"rules\"");
}

TEST(OpenInputs, AsManyAsThereAreBitsAndNoMore) {
  std::vector<InputSpec> specs;
  for (std::size_t i = 0; i < kMaxLines; ++i) specs.push_back(sim(numbered("in_many", i)));
  {
    InputLines lines = open(specs);
    for (std::size_t i = 0; i < kMaxLines; ++i) simulated_chip::drive(numbered("in_many", i), true, at(1));
    EXPECT_EQ(all_of(lines).size(), kMaxLines);
    EXPECT_EQ(lines.reading(kMaxLines - 1).events, 1U);
  }
  specs.push_back(sim("in_one_more"));
  EXPECT_EQ(refusal(specs), "GPIO line sim:in_one_more: one too many: a program reads 16 lines");
}

TEST(StampsAreMonotonic, FromKernel5_7On) {
  for (const char* release : {"5.7.0", "5.10.0-28-armmp", "6.1.0-18-arm64", "6.18.44", "10.0"}) {
    EXPECT_TRUE(stamps_are_monotonic(release)) << release;
  }
  for (const char* release : {"5.6.19", "4.19.0-26-amd64", "5.4.83-v7l+", "", "5", "5.", "five.ten"}) {
    EXPECT_FALSE(stamps_are_monotonic(release)) << release;
  }
}

}  // namespace
}  // namespace stereotrack::gpio
