#include "drivers/trigger/edges.hpp"

#include <gtest/gtest.h>
#include <poll.h>

#include <atomic>
#include <chrono>
#include <cstdint>
#include <string>
#include <thread>
#include <vector>

#include "drivers/gpio/simulated_chip.hpp"

namespace stereotrack::trigger {
namespace {

using std::chrono::milliseconds;
namespace sim = gpio::simulated_chip;

constexpr MonotonicTime kBegin(std::chrono::seconds(100));

gpio::InputSpec spec(const std::string& name) { return {.name = {"sim", name}, .edges = gpio::Edges::kRising}; }

bool is_readable(const EdgeTrigger& trigger) {
  pollfd wanted{trigger.descriptor(), POLLIN, 0};
  return poll(&wanted, 1, 0) == 1;
}

void pulse_at(const std::string& line, MonotonicTime time) {
  EXPECT_TRUE(sim::drive(line, true, time));
  EXPECT_TRUE(sim::drive(line, false, time + milliseconds(1)));
}

std::vector<std::string> said(EdgeTrigger& trigger, MonotonicTime now) {
  std::vector<Trigger::Note> notes;
  trigger.tend(now, notes);
  std::vector<std::string> lines;
  for (const Trigger::Note& note : notes) lines.push_back((note.good ? "good: " : "bad: ") + note.text);
  return lines;
}

TEST(EdgeTrigger, TellsEachEdgeWithItsKernelTimeAndNumber) {
  EdgeTrigger trigger(spec("edges-tell"), "test");
  Trigger::Pulse pulse;
  EXPECT_FALSE(is_readable(trigger));
  EXPECT_FALSE(trigger.take(pulse));
  for (int k = 1; k <= 5; ++k) pulse_at("edges-tell", kBegin + k * milliseconds(40));
  EXPECT_TRUE(is_readable(trigger));
  for (std::uint64_t k = 1; k <= 5; ++k) {
    ASSERT_TRUE(trigger.take(pulse));
    EXPECT_EQ(pulse.number, k);
    EXPECT_EQ(pulse.time, kBegin + static_cast<int>(k) * milliseconds(40));
  }
  EXPECT_FALSE(trigger.take(pulse));
  EXPECT_FALSE(is_readable(trigger));
  EXPECT_EQ(trigger.lost(), 0U);
}

TEST(EdgeTrigger, EdgesThatWereDroppedBeforeTheyWereReadAreAGap) {
  EdgeTrigger trigger(spec("edges-gap"), "test");
  Trigger::Pulse pulse;
  pulse_at("edges-gap", kBegin);
  ASSERT_TRUE(trigger.take(pulse));
  const int many = static_cast<int>(sim::kKeptEdges) + 4;
  for (int k = 1; k <= many; ++k) pulse_at("edges-gap", kBegin + k * milliseconds(40));
  ASSERT_TRUE(trigger.take(pulse));
  EXPECT_EQ(pulse.number, 1U + 4U + 1U);
  EXPECT_EQ(pulse.time, kBegin + 5 * milliseconds(40));
  EXPECT_EQ(trigger.lost(), 4U);
  int more = 0;
  while (trigger.take(pulse)) ++more;
  EXPECT_EQ(more, static_cast<int>(sim::kKeptEdges) - 1);
  EXPECT_EQ(pulse.number, static_cast<std::uint64_t>(many) + 1);
}

TEST(EdgeTrigger, AChipThatGoesIsToldAndAskedForAnewAndNumbersGoOn) {
  EdgeTrigger trigger(spec("edges-gone"), "test");
  Trigger::Pulse pulse;
  pulse_at("edges-gone", kBegin);
  ASSERT_TRUE(trigger.take(pulse));
  sim::set_gone("edges-gone", true);
  EXPECT_FALSE(trigger.take(pulse));
  EXPECT_FALSE(is_readable(trigger)) << "what is gone wakes the capture thread for ever";
  MonotonicTime now = kBegin;
  std::vector<std::string> lines = said(trigger, now);
  ASSERT_EQ(lines.size(), 1U);
  EXPECT_NE(lines[0].find("bad: trigger: GPIO line sim:edges-gone: No such device"), std::string::npos) << lines[0];
  // Asked for again and again, which is no news.
  std::size_t count = 0;
  for (int i = 0; i < 100; ++i) count += said(trigger, now += milliseconds(100)).size();
  EXPECT_EQ(count, 1U);
  sim::set_gone("edges-gone", false);
  lines.clear();
  for (int i = 0; i < 50 && lines.empty(); ++i) lines = said(trigger, now += milliseconds(100));
  ASSERT_EQ(lines.size(), 1U);
  EXPECT_EQ(lines[0].find("good: trigger: GPIO line sim:edges-gone: works again after "), 0U) << lines[0];
  EXPECT_FALSE(trigger.take(pulse));
  pulse_at("edges-gone", kBegin + milliseconds(80));
  EXPECT_TRUE(is_readable(trigger));
  ASSERT_TRUE(trigger.take(pulse));
  EXPECT_EQ(pulse.number, 2U);
  EXPECT_EQ(trigger.lost(), 0U);
}

// The capture thread takes while the service thread looks after a chip that comes and goes.
TEST(EdgeTrigger, IsHandedToAndFroBetweenTwoThreads) {
  EdgeTrigger trigger(spec("edges-threads"), "test");
  std::atomic<bool> stop{false};
  std::uint64_t taken = 0;
  std::uint64_t last = 0;
  std::thread capture([&] {
    Trigger::Pulse pulse;
    while (!stop.load()) {
      while (trigger.take(pulse)) {
        EXPECT_GT(pulse.number, last);
        last = pulse.number;
        ++taken;
      }
    }
  });
  MonotonicTime now = kBegin;
  std::vector<Trigger::Note> notes;
  for (int round = 0; round < 50; ++round) {
    // In the service thread's own time: a try each half second at first.
    for (std::size_t before = notes.size(); notes.size() == before;) {
      if (notes.size() % 2 == 0) pulse_at("edges-threads", now);
      sim::set_gone("edges-threads", notes.size() % 2 == 0);
      trigger.tend(now += milliseconds(100), notes);
      std::this_thread::yield();
    }
  }
  sim::set_gone("edges-threads", false);
  stop.store(true);
  capture.join();
  ASSERT_EQ(notes.size(), 50U);
  for (std::size_t i = 0; i < notes.size(); ++i) EXPECT_EQ(notes[i].good, i % 2 == 1) << i << notes[i].text;
  EXPECT_EQ(last, taken + trigger.lost());
}

TEST(EdgeTrigger, ALineThatCannotBeHadIsOneLine) {
  const EdgeTrigger first(spec("edges-busy"), "somebody");
  try {
    const EdgeTrigger second(spec("edges-busy"), "test");
    ADD_FAILURE() << "two had one line";
  } catch (const std::runtime_error& error) {
    EXPECT_STREQ(error.what(), "GPIO line sim:edges-busy: busy: held by \"somebody\"");
  }
}

}  // namespace
}  // namespace stereotrack::trigger
