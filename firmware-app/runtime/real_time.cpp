#include "firmware-app/runtime/real_time.hpp"

#include <fcntl.h>
#include <malloc.h>
#include <sched.h>
#include <signal.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <unistd.h>

#include <cerrno>
#include <cstdint>
#include <cstring>
#include <ctime>
#include <stdexcept>
#include <utility>

namespace stereotrack::runtime {

namespace {

constexpr std::size_t kFaultStackBytes = 32 * 1024;

std::string reason(int error) { return std::strerror(error); }

// Writes to each page of the stack below the caller, so that none faults later. Locked memory would be present anyhow;
// without the right to lock it this is what can be done.
[[gnu::noinline]] void touch_stack() noexcept {
  constexpr std::size_t kLeft = 64 * 1024;  // for what is on the stack already, and the guard page
  volatile char stack[Thread::kUsableStackBytes - kLeft];
  for (std::size_t i = 0; i < sizeof stack; i += 4096) stack[i] = 0;
}

// Priority and core.
std::vector<Missing> set_up(pthread_t thread, const ThreadPlan& plan, RealTimeMode mode) {
  std::vector<Missing> missing;
  if (mode == RealTimeMode::kOff) return missing;
  if (plan.core >= 0) {
    cpu_set_t cores;
    CPU_ZERO(&cores);
    const bool known = plan.core < CPU_SETSIZE;
    if (known) CPU_SET(static_cast<unsigned>(plan.core), &cores);
    const int set = known ? pthread_setaffinity_np(thread, sizeof cores, &cores) : EINVAL;
    if (set != 0) {
      missing.push_back({"thread " + plan.name + ": core " + std::to_string(plan.core) + ": " + reason(set),
                         "a core that this machine has and the unit's CPUAffinity= allows, or -1 for any"});
    }
  }
  if (plan.priority > 0) {
    sched_param parameters{};
    parameters.sched_priority = plan.priority;
    const int set = pthread_setschedparam(thread, SCHED_FIFO, &parameters);
    if (set != 0) {
      missing.push_back(
          {"thread " + plan.name + ": real-time priority " + std::to_string(plan.priority) + ": " + reason(set),
           "LimitRTPRIO=" + std::to_string(plan.priority) + " in the unit, or `ulimit -r`, or CAP_SYS_NICE"});
    }
  }
  return missing;
}

}  // namespace

std::vector<Missing> set_up_this_thread(const ThreadPlan& plan, RealTimeMode mode) {
  return set_up(pthread_self(), plan, mode);
}

RealTimeProcess::RealTimeProcess(const Config& config) : until_exit_(config.until_exit) {
  (void)mallopt(M_TRIM_THRESHOLD, -1);
  (void)mallopt(M_MMAP_MAX, 0);
  if (mlockall(MCL_CURRENT | MCL_FUTURE) != 0) {
    missing_.push_back({"memory cannot be locked: " + reason(errno),
                        "LimitMEMLOCK=infinity in the unit, or `ulimit -l unlimited`, or CAP_IPC_LOCK"});
  }
  if (config.deep_sleep) return;
  latency_fd_ = open("/dev/cpu_dma_latency", O_WRONLY | O_CLOEXEC);
  const std::int32_t most_us = 0;
  if (latency_fd_ < 0 || write(latency_fd_, &most_us, sizeof most_us) != sizeof most_us) {
    missing_.push_back(
        {"/dev/cpu_dma_latency: " + reason(errno) + ": cores may sleep deeply and wake late",
         "be in the group stereotrack, to which the package's udev rule gives it, or realtime.deep_sleep = true"});
  }
}

RealTimeProcess::~RealTimeProcess() {
  if (latency_fd_ >= 0) (void)close(latency_fd_);
  if (!until_exit_) (void)munlockall();
}

Thread::Thread(const ThreadPlan& plan, RealTimeMode mode, std::function<void()> body)
    : plan_(plan), mode_(mode), body_(std::move(body)) {
  fault_stack_ = std::make_unique<char[]>(kFaultStackBytes);
  plan_.name.resize(std::min<std::size_t>(plan_.name.size(), 15));
  pthread_attr_t attributes;
  if (pthread_attr_init(&attributes) != 0) throw std::runtime_error("thread " + plan.name + ": out of memory");
  (void)pthread_attr_setstacksize(&attributes, kStackBytes);
  const int made = pthread_create(&thread_, &attributes, &Thread::run, this);
  (void)pthread_attr_destroy(&attributes);
  if (made != 0) throw std::runtime_error("thread " + plan.name + ": " + reason(made));
  // From outside, while the thread waits: who starts it must know what is missing before it goes on.
  (void)pthread_setname_np(thread_, plan_.name.c_str());
  missing_ = set_up(thread_, plan_, mode_);
}

void Thread::begin() noexcept {
  if (begun_ || joined_) return;
  begun_ = true;
  decided_.release();
}

void Thread::join() noexcept {
  if (joined_) return;
  joined_ = true;
  if (!begun_) decided_.release();
  (void)pthread_join(thread_, nullptr);
}

bool Thread::join_for(std::chrono::milliseconds limit) noexcept {
  if (joined_) return true;
  if (!begun_) {
    join();
    return true;
  }
  timespec until{};
  (void)clock_gettime(CLOCK_REALTIME, &until);  // the clock that pthread_timedjoin_np knows
  until.tv_sec += static_cast<time_t>(limit.count() / 1000);
  until.tv_nsec += static_cast<long>(limit.count() % 1000 * 1'000'000);
  if (until.tv_nsec >= 1'000'000'000) {
    ++until.tv_sec;
    until.tv_nsec -= 1'000'000'000;
  }
  joined_ = pthread_timedjoin_np(thread_, nullptr, &until) == 0;
  return joined_;
}

void* Thread::run(void* self) noexcept {
  Thread& thread = *static_cast<Thread*>(self);
  if (thread.mode_ != RealTimeMode::kOff) {
    touch_stack();
    (void)prctl(PR_SET_TIMERSLACK, 1UL, 0UL, 0UL, 0UL);
  }
  stack_t faults{};
  stack_t before{};
  faults.ss_sp = thread.fault_stack_.get();
  faults.ss_size = kFaultStackBytes;
  (void)sigaltstack(&faults, &before);
  thread.decided_.acquire();
  if (thread.begun_) thread.body_();
  (void)sigaltstack(&before, nullptr);  // a sanitizer unmaps the one that it finds when a thread ends
  return nullptr;
}

}  // namespace stereotrack::runtime
