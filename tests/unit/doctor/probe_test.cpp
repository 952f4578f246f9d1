#include "firmware-app/stereotrack/doctor/probe.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "drivers/gpio/line.hpp"
#include "firmware-app/stereotrack/doctor/tree.hpp"
#include "tests/unit/doctor/board_tree.hpp"

namespace stereotrack::doctor {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

TEST(ProbeKernel, ReadsWhatABoardSays) {
  const BoardTree board;
  const KernelFacts facts = probe_kernel(board.root());
  EXPECT_EQ(facts.board, "Raspberry Pi 5 Model B Rev 1.0");
  EXPECT_EQ(facts.release, "6.12.20-v8-rt");
  EXPECT_EQ(facts.architecture, "aarch64");
  EXPECT_EQ(facts.preemption, Preemption::kRealTime);
  EXPECT_EQ(facts.rt_runtime_us, 950000);
}

TEST(ProbeKernel, PreemptionIsReadFromWhatEachKernelTells) {
  struct Case {
    const char* version;
    const char* boot;
    const char* choice;
    Preemption is;
  };
  for (const Case& c : {
           Case{"#1 SMP PREEMPT_RT Debian 6.12", "", "", Preemption::kRealTime},
           {"#1 SMP PREEMPT RT 5.4", "", "", Preemption::kRealTime},
           {"#1 SMP PREEMPT 6.6.51", "", "", Preemption::kFull},
           {"#1 SMP Debian 6.1.140-1", "", "", Preemption::kVoluntary},
           {"#1 SMP PREEMPT_DYNAMIC", "quiet", "", Preemption::kUnknown},
           {"#1 SMP PREEMPT_DYNAMIC", "quiet preempt=full", "", Preemption::kFull},
           {"#1 SMP PREEMPT_DYNAMIC", "preempt=none", "", Preemption::kNone},
           {"#1 SMP PREEMPT_DYNAMIC", "", "none voluntary (full)", Preemption::kFull},
           {"#1 SMP PREEMPT_DYNAMIC", "preempt=full", "none (voluntary) full", Preemption::kVoluntary},
           {"#1 SMP PREEMPT_DYNAMIC", "", "(none) voluntary full", Preemption::kNone},
       }) {
    const BoardTree board;
    board.write("proc/sys/kernel/version", c.version);
    board.write("sys/kernel/realtime", "0");
    board.write("proc/cmdline", c.boot);
    board.write("sys/kernel/debug/sched/preempt", c.choice);
    EXPECT_EQ(probe_kernel(board.root()).preemption, c.is) << c.version << ' ' << c.boot << ' ' << c.choice;
  }
}

TEST(ProbeCpu, ReadsWhatABoardSays) {
  const BoardTree board;
  const CpuFacts facts = probe_cpu(board.root());
  EXPECT_EQ(facts.cores, 4);
  EXPECT_THAT(facts.governors, ElementsAre("ondemand"));
  EXPECT_EQ(facts.max_mhz, 2400);
  EXPECT_EQ(facts.isolated, "2-3");
  EXPECT_EQ(facts.sleep_states, 1);
  EXPECT_NEAR(facts.hottest_c.value_or(0), 51.3, 1e-9);
  EXPECT_EQ(facts.throttled, false);
}

TEST(ProbeCpu, TwoClustersAreOneListOfGovernorsAndTheHottestZoneCounts) {
  const BoardTree board;
  board.write("sys/devices/system/cpu/online", "0,2-3,5\n");
  board.write("sys/devices/system/cpu/cpufreq/policy4/scaling_governor", "performance\n");
  board.write("sys/devices/system/cpu/cpufreq/policy4/cpuinfo_max_freq", "1800000\n");
  board.write("sys/class/thermal/thermal_zone1/temp", "84000\n");
  board.write("sys/devices/platform/soc/soc:firmware/get_throttled", "50000\n");  // hexadecimal
  const CpuFacts facts = probe_cpu(board.root());
  EXPECT_EQ(facts.cores, 4);
  EXPECT_THAT(facts.governors, ElementsAre("ondemand", "performance"));
  EXPECT_EQ(facts.max_mhz, 2400);
  EXPECT_NEAR(facts.hottest_c.value_or(0), 84.0, 1e-9);
  EXPECT_EQ(facts.throttled, true);
}

TEST(ProbeMemory, ReadsWhatABoardSays) {
  const BoardTree board;
  const MemoryFacts facts = probe_memory(board.root());
  EXPECT_EQ(facts.total_mb, 4050);
  EXPECT_EQ(facts.available_mb, 3439);
  EXPECT_EQ(facts.swap_mb, 511);
  EXPECT_EQ(facts.cma_mb, 64);
  EXPECT_THAT(facts.dma_heaps, ElementsAre("system", "linux,cma", "vidbuf_cached"));
}

TEST(ProbeLimits, ReadsThemAndUnlimitedIsNoNumber) {
  const BoardTree board;
  EXPECT_EQ(probe_limits(board.root()).locked_kb, 8192);
  EXPECT_EQ(probe_limits(board.root()).priority, 95);
  board.write("proc/self/limits", "Max locked memory         unlimited            unlimited            bytes\n");
  EXPECT_EQ(probe_limits(board.root()).locked_kb, std::nullopt);
  EXPECT_EQ(probe_limits(board.root()).priority, 0);
}

TEST(ProbeClocks, ReadsTheSourceAndTheCardsThatHaveOne) {
  const BoardTree board;
  const ClockFacts facts = probe_clocks(board.root());
  EXPECT_EQ(facts.source, "arch_sys_counter");
  EXPECT_THAT(facts.available, ElementsAre("arch_sys_counter"));
  EXPECT_THAT(facts.ptp, ElementsAre("/dev/ptp0"));
}

TEST(Probes, AnEmptyTreeTellsNothing) {
  const test::TempDir empty;
  EXPECT_EQ(probe_kernel(empty.path()).preemption, Preemption::kUnknown);
  EXPECT_EQ(probe_kernel(empty.path()).board, "");
  EXPECT_EQ(probe_cpu(empty.path()).cores, 0);
  EXPECT_THAT(probe_cpu(empty.path()).governors, IsEmpty());
  EXPECT_EQ(probe_cpu(empty.path()).hottest_c, std::nullopt);
  EXPECT_EQ(probe_memory(empty.path()).total_mb, 0);
  EXPECT_THAT(probe_memory(empty.path()).dma_heaps, IsEmpty());
  EXPECT_EQ(probe_clocks(empty.path()).source, "");
}

// The machine that runs this has a kernel, cores and memory, whatever else.
TEST(Probes, ThisMachineIsTold) {
  EXPECT_NE(probe_kernel("/").release, "");
  EXPECT_GE(probe_cpu("/").cores, 1);
  EXPECT_GT(probe_memory("/").total_mb, 0);
  EXPECT_NE(probe_limits("/").user, "");
}

TEST(AskRights, NothingIsAskedWhereItIsOff) {
  config::Configuration configuration;
  configuration.realtime.mode = config::RealTimeMode::kOff;
  configuration.realtime.publisher.core = 1023;
  EXPECT_THAT(ask_rights(configuration), IsEmpty());
}

TEST(AskRights, WhatNoMachineGrantsIsNamedByItsThread) {
  config::Configuration configuration;
  configuration.realtime.frames.core = 1023;
  configuration.realtime.trigger.core = 1022;
  const auto told = [&](const char* what) {
    const std::vector<runtime::Missing> missing = ask_rights(configuration);
    return std::any_of(missing.begin(), missing.end(),
                       [&](const runtime::Missing& one) { return one.what.find(what) != std::string::npos; });
  };
  EXPECT_TRUE(told("thread st-frames: core 1023"));
  EXPECT_FALSE(told("thread st-trigger"));
  configuration.source.name = "cameras";
  configuration.trigger.mode = config::TriggerMode::kGpio;
  configuration.trigger.line = "sim:doctor_trigger";
  EXPECT_TRUE(told("thread st-trigger: core 1022"));
}

TEST(ProbeLines, LinesAreLookedUpAndNotRequested) {
  config::Configuration configuration;
  configuration.signals.resize(2);
  configuration.signals[0].name = "near";
  configuration.signals[0].line = "sim:doctor_near";
  configuration.signals[1].name = "gate";
  configuration.signals[1].line = "gpiochip77:3";
  configuration.inputs.resize(1);
  configuration.inputs[0].name = "door";
  configuration.inputs[0].line = "nonsense";
  const std::vector<LineFound> lines = probe_lines(configuration);
  ASSERT_EQ(lines.size(), 3U);
  EXPECT_EQ(lines[0].problem, "");
  EXPECT_THAT(lines[1].problem, HasSubstr("gpiochip77:3"));
  EXPECT_EQ(lines[1].key, "signal gate");
  EXPECT_THAT(lines[2].problem, HasSubstr("CHIP:LINE"));
  EXPECT_FALSE(lines[2].output);
  // Still free for whoever wants it.
  EXPECT_EQ(gpio::open_lines(std::vector{gpio::LineSpec{{"sim", "doctor_near"}, false, false}}, "test").size(), 1U);
}

TEST(Tree, NumbersAreThoseThatALineBeginsWith) {
  const test::TempDir folder;
  (void)folder.write("n", " 42 kB\n");
  (void)folder.write("word", "many\n");
  EXPECT_EQ(number_of(folder / "n"), 42);
  EXPECT_EQ(number_of(folder / "word"), std::nullopt);
  EXPECT_EQ(number_of(folder / "absent"), std::nullopt);
  EXPECT_EQ(text_of(folder.path()), "");
  EXPECT_EQ(number_in("a: 1\nab: 2\n", "ab:"), 2);
}

}  // namespace
}  // namespace stereotrack::doctor
