#pragma once

#include <ucontext.h>

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#if defined(__has_feature)
#if __has_feature(address_sanitizer)
#define STEREOTRACK_FIBERS_ASAN
#endif
#if __has_feature(thread_sanitizer)
#define STEREOTRACK_FIBERS_TSAN
#endif
#endif
#if defined(__SANITIZE_ADDRESS__)
#define STEREOTRACK_FIBERS_ASAN
#endif
#if defined(__SANITIZE_THREAD__)
#define STEREOTRACK_FIBERS_TSAN
#endif
#ifdef STEREOTRACK_FIBERS_ASAN
#include <sanitizer/common_interface_defs.h>
#endif
#ifdef STEREOTRACK_FIBERS_TSAN
#include <sanitizer/tsan_interface.h>
#endif

/// Every schedule of two small threads.
///
/// A trial is a type with a default constructor, `void first()`, `void second()` and `std::string fault()` (empty: all
/// is well). explore<Trial>() makes one after another and runs first() and second() as two threads of which one moves
/// at a time; before each operation on an interleave::Atomic the explorer decides which. Depth first, until all ways to
/// decide have been gone; fault() is asked at the end of each. Memory is sequentially consistent: what weaker orders
/// allow is ThreadSanitizer's part. Bodies are bounded, throw nothing and own nothing when they pause.
///
/// Reduction::kCommuting leaves out schedules that differ only in the order of two neighbours that commute (other
/// variables, or both read): sleep sets (Godefroid, 1996). Every outcome still occurs.
namespace stereotrack::interleave {

enum class Reduction : std::uint8_t { kNone, kCommuting };

struct Exploration {
  std::uint64_t schedules = 0;  ///< run to their end
  bool complete = false;        ///< all were run; false: a fault was found, or more than the limit
  std::string fault;            ///< of the first schedule that has one
  std::string schedule;         ///< that schedule: who moved, 1 or 2
};

/// What a thread is about to do.
struct Access {
  const void* where = nullptr;
  bool writes = false;
};

class Explorer {
 public:
  Explorer() {
    for (std::size_t i = 0; i < 2; ++i) {
      stacks_[i].resize(kStackBytes);
      make_context(contexts_[i], stacks_[i]);
#ifdef STEREOTRACK_FIBERS_TSAN
      fibers_[i] = __tsan_create_fiber(0);
#endif
    }
#ifdef STEREOTRACK_FIBERS_TSAN
    scheduler_fiber_ = __tsan_get_current_fiber();
#endif
    current() = this;
  }
  Explorer(const Explorer&) = delete;
  Explorer& operator=(const Explorer&) = delete;
  ~Explorer() {
    current() = nullptr;
#ifdef STEREOTRACK_FIBERS_TSAN
    for (void* fiber : fibers_) __tsan_destroy_fiber(fiber);
#endif
  }

  template <class Trial>
  Exploration explore(Reduction reduction, std::uint64_t limit) {
    Exploration found;
    std::vector<Node> nodes;
    do {
      std::optional<Trial> trial;
      trial.emplace();
      bodies_[0] = [&trial] { trial->first(); };
      bodies_[1] = [&trial] { trial->second(); };
      const std::string schedule = run(nodes, reduction);
      ++found.schedules;
      found.fault = endless_ ? "a thread does not end" : trial->fault();
      if (!found.fault.empty()) {
        found.schedule = schedule;
        return found;
      }
      if (found.schedules >= limit) return found;
    } while (turn_back(nodes));
    found.complete = true;
    return found;
  }

  /// Called by Atomic. Outside of the two threads it does nothing.
  static void before(Access access) noexcept {
    Explorer* explorer = current();
    if (explorer == nullptr || explorer->running_ < 0) return;
    explorer->pending_[static_cast<std::size_t>(explorer->running_)] = access;
    explorer->leave();
  }

 private:
  static constexpr std::size_t kStackBytes = 256 * 1024;
  static constexpr std::size_t kMostSteps = 10000;

  /// One decision. Threads are bits.
  struct Node {
    unsigned enabled;
    unsigned asleep;  ///< moving it here is a schedule that another branch has gone
    unsigned tried;
    std::size_t taken;
  };

  static Explorer*& current() noexcept {
    thread_local Explorer* explorer = nullptr;
    return explorer;
  }

  static void make_context(ucontext_t& context, std::vector<std::byte>& stack) {
    getcontext(&context);
    context.uc_stack.ss_sp = stack.data();
    context.uc_stack.ss_size = stack.size();
    context.uc_link = nullptr;
    makecontext(&context, &Explorer::enter, 0);
  }

  static unsigned bit(std::size_t thread) noexcept { return 1U << thread; }
  static std::size_t lowest(unsigned threads) noexcept { return (threads & 1U) != 0 ? 0 : 1; }
  static bool commute(const Access& a, const Access& b) noexcept {
    return a.where != b.where || (!a.writes && !b.writes);
  }

  /// One schedule: the decisions of `nodes`, then the first one possible each time, which it adds.
  std::string run(std::vector<Node>& nodes, Reduction reduction) {
    std::string schedule;
    finished_ = {};
    endless_ = false;
    resume(0);  // up to their first access, which is nobody else's business
    resume(1);
    std::size_t depth = 0;
    unsigned asleep = 0;
    bool known = false;  // all that can move is asleep: the rest is run, but leads nowhere new
    while (!finished_[0] || !finished_[1]) {
      if (schedule.size() > kMostSteps) {
        endless_ = true;  // its context is left where it is: the exploration ends here
        return schedule;
      }
      const unsigned enabled = (finished_[0] ? 0 : bit(0)) | (finished_[1] ? 0 : bit(1));
      std::size_t mover = lowest(enabled);
      if (!known && depth == nodes.size()) {
        if ((enabled & ~asleep) == 0) {
          known = true;
        } else {
          nodes.push_back({enabled, asleep, 0, lowest(enabled & ~asleep)});
        }
      }
      if (!known) {
        const Node& node = nodes[depth++];
        mover = node.taken;
        const std::size_t other = 1 - mover;
        const bool sleeps = ((node.asleep | node.tried) & bit(other)) != 0;
        asleep = sleeps && reduction == Reduction::kCommuting && commute(pending_[0], pending_[1]) ? bit(other) : 0;
      }
      schedule += mover == 0 ? '1' : '2';
      resume(mover);
    }
    return schedule;
  }

  /// To the last decision that has another way. False: there is none.
  static bool turn_back(std::vector<Node>& nodes) {
    while (!nodes.empty()) {
      Node& node = nodes.back();
      node.tried |= bit(node.taken);
      const unsigned rest = node.enabled & ~node.asleep & ~node.tried;
      if (rest != 0) {
        node.taken = lowest(rest);
        return true;
      }
      nodes.pop_back();
    }
    return false;
  }

  /// Lets a thread move until its next access, or to its end.
  void resume(std::size_t thread) noexcept {
    running_ = static_cast<int>(thread);
#ifdef STEREOTRACK_FIBERS_ASAN
    void* fake = nullptr;
    __sanitizer_start_switch_fiber(&fake, stacks_[thread].data(), stacks_[thread].size());
#endif
#ifdef STEREOTRACK_FIBERS_TSAN
    __tsan_switch_to_fiber(fibers_[thread], 0);
#endif
    swapcontext(&scheduler_, &contexts_[thread]);
#ifdef STEREOTRACK_FIBERS_ASAN
    __sanitizer_finish_switch_fiber(fake, nullptr, nullptr);
#endif
    running_ = -1;
  }

  /// Back to the scheduler.
  void leave() noexcept {
    const auto thread = static_cast<std::size_t>(running_);
#ifdef STEREOTRACK_FIBERS_ASAN
    void* fake = nullptr;
    __sanitizer_start_switch_fiber(&fake, scheduler_stack_, scheduler_bytes_);
#endif
#ifdef STEREOTRACK_FIBERS_TSAN
    __tsan_switch_to_fiber(scheduler_fiber_, 0);
#endif
    swapcontext(&contexts_[thread], &scheduler_);
#ifdef STEREOTRACK_FIBERS_ASAN
    __sanitizer_finish_switch_fiber(fake, nullptr, nullptr);
#endif
  }

  /// A thread's life: one body a schedule.
  static void enter() noexcept {
    Explorer* self = current();
#ifdef STEREOTRACK_FIBERS_ASAN
    __sanitizer_finish_switch_fiber(nullptr, &self->scheduler_stack_, &self->scheduler_bytes_);
#endif
    const auto thread = static_cast<std::size_t>(self->running_);
    for (;;) {
      self->bodies_[thread]();
      self->finished_[thread] = true;
      self->leave();
    }
  }

  std::array<std::vector<std::byte>, 2> stacks_;
  std::array<ucontext_t, 2> contexts_{};
  ucontext_t scheduler_{};
  std::array<std::function<void()>, 2> bodies_;
  std::array<Access, 2> pending_{};
  std::array<bool, 2> finished_{};
  bool endless_ = false;
  int running_ = -1;  ///< which thread moves; -1: the scheduler
#ifdef STEREOTRACK_FIBERS_ASAN
  const void* scheduler_stack_ = nullptr;
  std::size_t scheduler_bytes_ = 0;
#endif
#ifdef STEREOTRACK_FIBERS_TSAN
  std::array<void*, 2> fibers_{};
  void* scheduler_fiber_ = nullptr;
#endif
};

template <class Trial>
Exploration explore(Reduction reduction = Reduction::kCommuting, std::uint64_t limit = 2'000'000) {
  Explorer explorer;
  return explorer.explore<Trial>(reduction, limit);
}

/// As much of std::atomic as the lock-free types use, each operation a point where the other thread may come in.
template <class T>
class Atomic {
 public:
  // NOLINTNEXTLINE(readability-identifier-naming): the standard's name
  static constexpr bool is_always_lock_free = true;

  Atomic() noexcept = default;
  explicit Atomic(T value) noexcept : value_(value) {}

  T load(std::memory_order = std::memory_order_seq_cst) const noexcept {
    Explorer::before({this, false});
    return value_;
  }
  void store(T value, std::memory_order = std::memory_order_seq_cst) noexcept {
    Explorer::before({this, true});
    value_ = value;
  }
  T exchange(T value, std::memory_order = std::memory_order_seq_cst) noexcept {
    Explorer::before({this, true});
    const T old = value_;
    value_ = value;
    return old;
  }
  bool compare_exchange_strong(T& expected, T desired, std::memory_order = std::memory_order_seq_cst,
                               std::memory_order = std::memory_order_seq_cst) noexcept {
    Explorer::before({this, true});
    if (value_ == expected) {
      value_ = desired;
      return true;
    }
    expected = value_;
    return false;
  }

 private:
  T value_{};
};

}  // namespace stereotrack::interleave
