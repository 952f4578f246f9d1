#include "firmware-app/runtime/real_time.hpp"

#include <gtest/gtest.h>
#include <sched.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <csignal>
#include <fstream>
#include <functional>
#include <string>
#include <thread>

namespace stereotrack::runtime {
namespace {

// What a child without any right says, as the program's users have none.
template <class Body>
std::string as_nobody(Body body) {
  std::array<int, 2> ends{};
  if (pipe(ends.data()) != 0) return "no pipe";
  const pid_t child = fork();
  if (child == 0) {
    const rlimit none{0, 0};
    const bool dropped = setrlimit(RLIMIT_MEMLOCK, &none) == 0 && setrlimit(RLIMIT_RTPRIO, &none) == 0 &&
                         (geteuid() != 0 || (setgid(65534) == 0 && setuid(65534) == 0));
    const std::string said = dropped ? body() : "rights could not be dropped";
    (void)!write(ends[1], said.data(), said.size());
    _exit(0);
  }
  (void)close(ends[1]);
  std::string said;
  std::array<char, 512> part{};
  for (ssize_t n = 0; (n = read(ends[0], part.data(), part.size())) > 0;) said.append(part.data(), n);
  (void)close(ends[0]);
  (void)waitpid(child, nullptr, 0);
  return said;
}

std::string words(const std::vector<Missing>& missing) {
  std::string all;
  for (const Missing& one : missing) all += one.what + " -> " + one.grant + "\n";
  return all;
}

bool may_be_real_time() {
  const Thread thread({.name = "probe", .priority = 1}, RealTimeMode::kTry, [] {});
  return thread.missing().empty();
}

TEST(Thread, RunsItsBodyOnce) {
  std::atomic<int> runs = 0;
  {
    Thread thread({.name = "once"}, RealTimeMode::kOff, [&] { ++runs; });
    thread.begin();
    thread.join();
    EXPECT_EQ(runs, 1);
  }
  EXPECT_EQ(runs, 1);
}

TEST(Thread, WaitsUntilItIsToldToBegin) {
  std::atomic<bool> ran = false;
  {
    const Thread thread({.name = "waiting"}, RealTimeMode::kOff, [&] { ran = true; });
  }
  Thread ended({.name = "waiting"}, RealTimeMode::kOff, [&] { ran = true; });
  EXPECT_TRUE(ended.join_for(std::chrono::milliseconds(0)));
  ended.begin();
  EXPECT_FALSE(ran);
}

TEST(Thread, HasItsNameItsStackAndItsTimerSlack) {
  std::string name;
  std::size_t stack = 0;
  int slack = 0;
  Thread thread({.name = "a name that is too long"}, RealTimeMode::kTry, [&] {
    std::array<char, 16> text{};
    (void)pthread_getname_np(pthread_self(), text.data(), text.size());
    name = text.data();
    pthread_attr_t attributes;
    (void)pthread_getattr_np(pthread_self(), &attributes);
    (void)pthread_attr_getstacksize(&attributes, &stack);
    (void)pthread_attr_destroy(&attributes);
    slack = prctl(PR_GET_TIMERSLACK, 0UL, 0UL, 0UL, 0UL);
  });
  thread.begin();
  thread.join();
  EXPECT_EQ(name, "a name that is ");
  EXPECT_EQ(stack, Thread::kStackBytes);
  EXPECT_EQ(slack, 1);
}

TEST(Thread, OffLeavesTheSystemsTimerSlack) {
  const int usual = prctl(PR_GET_TIMERSLACK, 0UL, 0UL, 0UL, 0UL);
  int slack = 0;
  Thread thread({.name = "off", .priority = 50, .core = 0}, RealTimeMode::kOff,
                [&] { slack = prctl(PR_GET_TIMERSLACK, 0UL, 0UL, 0UL, 0UL); });
  thread.begin();
  thread.join();
  EXPECT_EQ(slack, usual);
  EXPECT_TRUE(thread.missing().empty());
}

TEST(Thread, HasPolicyPriorityAndCoreOfItsPlan) {
  if (!may_be_real_time()) GTEST_SKIP() << "no right to real-time priorities: ulimit -r";
  std::atomic<bool> looked = false;
  int policy = -1;
  int priority = 0;
  int core = -1;
  Thread thread({.name = "planned", .priority = 42, .core = 0}, RealTimeMode::kEnforce, [&] {
    sched_param parameters{};
    (void)pthread_getschedparam(pthread_self(), &policy, &parameters);
    priority = parameters.sched_priority;
    core = sched_getcpu();
    looked = true;
  });
  thread.begin();
  thread.join();
  EXPECT_TRUE(looked);
  EXPECT_EQ(words(thread.missing()), "");
  EXPECT_EQ(policy, SCHED_FIFO);
  EXPECT_EQ(priority, 42);
  EXPECT_EQ(core, 0);
}

TEST(Thread, CoreThatIsNotThereIsNamed) {
  const Thread thread({.name = "frames", .core = 1000}, RealTimeMode::kTry, [] {});
  EXPECT_EQ(words(thread.missing()),
            "thread frames: core 1000: Invalid argument -> a core that this machine has and the unit's CPUAffinity= "
            "allows, or -1 for any\n");
}

TEST(Thread, TheCallersOwnIsSetUpLikewise) {
  std::thread([] {
    EXPECT_EQ(words(set_up_this_thread({.name = "service", .core = 0}, RealTimeMode::kTry)), "");
    cpu_set_t cores;
    ASSERT_EQ(pthread_getaffinity_np(pthread_self(), sizeof cores, &cores), 0);
    EXPECT_EQ(CPU_COUNT(&cores), 1);
    EXPECT_TRUE(CPU_ISSET(0, &cores));
    EXPECT_EQ(words(set_up_this_thread({.name = "service", .core = 1000}, RealTimeMode::kOff)), "");
    EXPECT_NE(words(set_up_this_thread({.name = "service", .core = 1000}, RealTimeMode::kTry)), "");
  }).join();
}

TEST(Thread, PriorityThatIsNotGrantedIsNamedAndTheBodyRuns) {
  const std::string said = as_nobody([] {
    bool ran = false;
    Thread thread({.name = "frames", .priority = 60}, RealTimeMode::kTry, [&] { ran = true; });
    thread.begin();
    thread.join();
    return words(thread.missing()) + (ran ? "ran" : "did not run");
  });
  EXPECT_EQ(said,
            "thread frames: real-time priority 60: Operation not permitted -> LimitRTPRIO=60 in the unit, or `ulimit "
            "-r`, or CAP_SYS_NICE\nran");
}

#if defined(__SANITIZE_THREAD__) || defined(__SANITIZE_ADDRESS__)
constexpr bool kMemoryCanBeLocked = false;
#else
constexpr bool kMemoryCanBeLocked = true;
#endif

TEST(RealTimeProcess, WhatIsNotGrantedIsNamedWithTheWayOut) {
  if (!kMemoryCanBeLocked) GTEST_SKIP() << "a sanitizer's mlockall does nothing and says so to nobody";
  const std::string said = as_nobody([] {
    const RealTimeProcess process({});
    return words(process.missing());
  });
  EXPECT_NE(said.find("memory cannot be locked"), std::string::npos) << said;
  EXPECT_NE(said.find("LimitMEMLOCK=infinity"), std::string::npos) << said;
  EXPECT_NE(said.find("/dev/cpu_dma_latency"), std::string::npos) << said;
}

TEST(RealTimeProcess, DeepSleepAsksNothingOfTheCores) {
  const std::string said = as_nobody([] {
    const RealTimeProcess process({.deep_sleep = true});
    return words(process.missing());
  });
  EXPECT_EQ(said.find("cpu_dma_latency"), std::string::npos) << said;
}

// In a child, so that the other tests' memory stays as it is.
TEST(RealTimeProcess, LocksAllMemoryWhereItMay) {
  if (!kMemoryCanBeLocked) GTEST_SKIP() << "a sanitizer's mlockall does nothing and says so to nobody";
  const auto locked_kb = [] {
    std::ifstream status("/proc/self/status");
    for (std::string line; std::getline(status, line);) {
      if (line.rfind("VmLck:", 0) == 0) return std::stol(line.substr(6));
    }
    return -1L;
  };
  const pid_t child = fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    const rlimit all{RLIM_INFINITY, RLIM_INFINITY};
    (void)setrlimit(RLIMIT_MEMLOCK, &all);
    const long before = locked_kb();
    {
      const RealTimeProcess process({});
      if (words(process.missing()).find("memory") != std::string::npos) _exit(geteuid() == 0 ? 1 : 77);
      if (before != 0 || locked_kb() < 1000) _exit(2);
    }
    if (locked_kb() != 0) _exit(3);
    { const RealTimeProcess process({.until_exit = true}); }
    _exit(locked_kb() >= 1000 ? 0 : 4);
  }
  int status = 0;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  ASSERT_TRUE(WIFEXITED(status));
  if (WEXITSTATUS(status) == 77) GTEST_SKIP() << "no right to lock memory: ulimit -l";
  EXPECT_EQ(WEXITSTATUS(status), 0);
}

// As the daemon's handler of faults does: without the second stack the kernel could not call it at all.
TEST(Thread, AHandlerOfFaultsRunsAlsoWhenItsStackHasOverflowed) {
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  EXPECT_EXIT(
      {
        struct sigaction action {};
        action.sa_handler = [](int) { _exit(7); };
        action.sa_flags = SA_ONSTACK;
        (void)sigaction(SIGSEGV, &action, nullptr);
        Thread thread({.name = "deep"}, RealTimeMode::kOff, [] {
          std::function<int(int)> deeper = [&deeper](int n) {
            volatile char page[4096];
            page[0] = static_cast<char>(n);
            return deeper(n + 1) + page[0];
          };
          _exit(deeper(0) & 1);
        });
        thread.begin();
        thread.join();
      },
      testing::ExitedWithCode(7), "");
}

}  // namespace
}  // namespace stereotrack::runtime
