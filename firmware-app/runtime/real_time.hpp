#pragma once

#include <pthread.h>

#include <chrono>
#include <functional>
#include <memory>
#include <semaphore>
#include <string>
#include <vector>

namespace stereotrack::runtime {

/// What to do where the system does not grant what real time needs.
enum class RealTimeMode : unsigned char {
  kEnforce,  ///< refuse to start
  kTry,      ///< go on and say what is missing
  kOff,      ///< ask for nothing: a PC that replays
};

/// A right that was asked for and not granted: one line that says what, and one that says how to grant it.
struct Missing {
  std::string what;
  std::string grant;
};

/// How one thread runs. The name is what top and the journal show, at most 15 characters.
struct ThreadPlan {
  std::string name;
  int priority = 0;  ///< 1..99: SCHED_FIFO; 0: the ordinary scheduler
  int core = -1;     ///< pinned to it; -1: any
};

/// What holds for the whole process while this lives. Made once, by the main thread, before others begin:
/// * mlockall, all pages present and to come: a page fault in the frame loop may wait for a disk;
/// * malloc keeps what it has and takes no mappings of its own: giving memory back and taking it again is a system call
///   and page faults, in whichever thread happens to do it;
/// * /dev/cpu_dma_latency at 0, held open: a core that sleeps deeply needs up to milliseconds to wake up. Costs power,
///   which is why `deep_sleep` can leave it.
/// Not for RealTimeMode::kOff. What was not granted is in missing().
class RealTimeProcess {
 public:
  struct Config {
    bool deep_sleep = false;  ///< cores may sleep as deeply as the governor likes
    bool until_exit = false;  ///< the process ends with it: memory stays locked, since to unlock it page by page and
                              ///< then to free it takes twice as long
  };

  explicit RealTimeProcess(const Config& config);
  RealTimeProcess(const RealTimeProcess&) = delete;
  RealTimeProcess& operator=(const RealTimeProcess&) = delete;
  ~RealTimeProcess();

  [[nodiscard]] const std::vector<Missing>& missing() const noexcept { return missing_; }

 private:
  std::vector<Missing> missing_;
  int latency_fd_ = -1;
  bool until_exit_ = false;
};

/// Gives the calling thread the priority and core of its plan; its name stays. What was not granted. Threads that it
/// starts from then on inherit both.
[[nodiscard]] std::vector<Missing> set_up_this_thread(const ThreadPlan& plan, RealTimeMode mode);

/// A thread with policy, priority and core from its plan, a stack of known size that is present from the start, and a
/// timer slack of 1 ns (the ordinary scheduler's timers may otherwise come 50 us late so that several wake together).
/// Handlers with SA_ONSTACK have a stack of their own.
/// All that is set when the constructor returns, and the thread waits: its owner can look at missing() of all its
/// threads before any of them begins. Making one never fails for want of a right: begin() lets it run without it.
class Thread {
 public:
  /// Locked and prefaulted: a gigabyte of default stacks is not.
  static constexpr std::size_t kUsableStackBytes = 512 * 1024;
#if defined(__SANITIZE_THREAD__) || defined(__SANITIZE_ADDRESS__)
  static constexpr std::size_t kStackBytes =
      kUsableStackBytes + 4 * 1024 * 1024;  ///< sanitizers keep theirs there, too
#else
  static constexpr std::size_t kStackBytes = kUsableStackBytes;
#endif

  /// Throws std::runtime_error where the system has no thread to give.
  Thread(const ThreadPlan& plan, RealTimeMode mode, std::function<void()> body);
  Thread(const Thread&) = delete;
  Thread& operator=(const Thread&) = delete;
  ~Thread() { join(); }

  /// The body runs. Once.
  void begin() noexcept;

  /// Waits for the body's end; one that was not begun never runs.
  void join() noexcept;
  /// The same for so long at most. False: it still runs; join() waits for it yet.
  [[nodiscard]] bool join_for(std::chrono::milliseconds limit) noexcept;

  [[nodiscard]] const std::vector<Missing>& missing() const noexcept { return missing_; }

 private:
  static void* run(void* self) noexcept;

  ThreadPlan plan_;
  RealTimeMode mode_;
  std::function<void()> body_;
  std::vector<Missing> missing_;
  std::unique_ptr<char[]> fault_stack_;  ///< for handlers with SA_ONSTACK: of a fault that overflowed the stack
  std::binary_semaphore decided_{0};     ///< released once: begin(), or an end without it
  bool begun_ = false;
  pthread_t thread_{};
  bool joined_ = false;
};

}  // namespace stereotrack::runtime
