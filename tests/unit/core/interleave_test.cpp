// The rings and mailboxes that ship, through every schedule of two small threads; and wrong ones, which must be found
// out.
#include "tests/support/interleave.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cstdint>
#include <optional>
#include <set>
#include <string>

#include "pipeline/core/bounded_vector.hpp"
#include "pipeline/core/mailbox.hpp"
#include "pipeline/core/queue.hpp"
#include "pipeline/core/ring.hpp"

namespace stereotrack {
namespace {

using interleave::Exploration;
using interleave::explore;
using interleave::Reduction;

using Log = FixedVector<int, 16>;

bool rises(const Log& log) {
  for (std::size_t i = 1; i < log.size(); ++i) {
    if (log[i - 1] >= log[i]) return false;
  }
  return true;
}

std::string text(const Log& log) {
  std::string out;
  for (const int value : log) out += std::to_string(value) + " ";
  return out;
}

/// What must hold for a ring into which 1, 2, ... `pushed` were pushed.
std::string ring_fault(const Log& popped, const Log& evicted, const Log& left, int pushed, std::size_t capacity) {
  const std::string all = "popped " + text(popped) + "evicted " + text(evicted) + "left " + text(left);
  if (!rises(popped) || !rises(evicted) || !rises(left)) return "out of order: " + all;
  std::array<int, 17> seen{};
  for (const Log* log : {&popped, &evicted, &left}) {
    for (const int value : *log) {
      if (value < 1 || value > pushed) return "never pushed: " + all;
      ++seen[static_cast<std::size_t>(value)];
    }
  }
  for (int value = 1; value <= pushed; ++value) {
    if (seen[static_cast<std::size_t>(value)] != 1) return "lost or doubled " + std::to_string(value) + ": " + all;
  }
  for (const Log* gone : {&popped, &evicted}) {
    if (!gone->empty() && !left.empty() && (*gone)[gone->size() - 1] > left[0]) return "not the oldest went: " + all;
  }
  if (left.size() > capacity) return "more left than there is room: " + all;
  return {};
}

template <class Ring, int kBefore, int kPushes, int kPops, int kEvicts = 0>
struct RingTrial {
  Ring ring;
  int pushed = 0;
  Log popped, evicted;

  RingTrial() { push(kBefore); }
  void push(int count) {
    for (int i = 0; i < count; ++i) {
      if (const auto old = ring.push(++pushed)) (void)evicted.push(*old);
    }
  }
  void first() {
    push(kPushes);
    for (int i = 0; i < kEvicts; ++i) {
      if (const auto old = ring.evict()) (void)evicted.push(*old);
    }
  }
  void second() {
    for (int i = 0; i < kPops; ++i) {
      if (const auto value = ring.pop()) (void)popped.push(*value);
    }
  }
  std::string fault() {
    Log left;
    while (const auto value = ring.pop()) {
      if (!left.push(*value)) return "no end of elements";
    }
    std::string found = ring_fault(popped, evicted, left, pushed, Ring::capacity());
    if (found.empty() && ring.evicted() != evicted.size()) found = "evictions miscounted";
    if (found.empty() && kEvicts == 0 && evicted.size() + Ring::capacity() > static_cast<std::size_t>(pushed) &&
        !evicted.empty()) {
      found = "evicted though there was room";
    }
    return found;
  }
};

template <std::size_t kCapacity>
using Ring = EvictingRing<int, kCapacity, interleave::Atomic>;

template <class Trial>
void expect_right(std::uint64_t at_least) {
  const Exploration found = explore<Trial>();
  EXPECT_EQ(found.fault, "") << "schedule " << found.schedule;
  EXPECT_TRUE(found.complete);
  EXPECT_GE(found.schedules, at_least);
}

TEST(InterleaveRing, OfOneElementLosesAndDoublesNothing) {
  expect_right<RingTrial<Ring<1>, 0, 3, 3>>(100);
  expect_right<RingTrial<Ring<1>, 1, 3, 3>>(100);
}

TEST(InterleaveRing, FullAtTheStartLosesAndDoublesNothing) {
  expect_right<RingTrial<Ring<2>, 2, 3, 3>>(100);
  expect_right<RingTrial<Ring<4>, 4, 3, 3>>(100);
}

TEST(InterleaveRing, FilledWhileItIsEmptiedLosesAndDoublesNothing) {
  expect_right<RingTrial<Ring<2>, 0, 4, 3>>(100);
  expect_right<RingTrial<Ring<2>, 1, 4, 2>>(100);
}

TEST(InterleaveRing, ThatGoesRoundTwiceLosesAndDoublesNothing) { expect_right<RingTrial<Ring<2>, 2, 4, 2>>(100); }

TEST(InterleaveRing, EvictsOnDemandWithoutLoss) {
  expect_right<RingTrial<Ring<2>, 2, 0, 2, 2>>(10);
  expect_right<RingTrial<Ring<2>, 2, 1, 3, 3>>(100);
}

TEST(InterleaveRing, AllSchedulesWithoutAnyReduction) {
  // 2 pushes of 4 accesses, 2 pops of up to 4: the plain search, for which nobody has to believe in sleep sets.
  const Exploration found = explore<RingTrial<Ring<1>, 1, 2, 2>>(Reduction::kNone);
  EXPECT_EQ(found.fault, "") << "schedule " << found.schedule;
  EXPECT_TRUE(found.complete);
  EXPECT_GE(found.schedules, 10000U);
}

/// Evicts by storing the position that it read a moment ago.
template <std::size_t kCapacity>
class RingWithoutCompareExchange {
 public:
  std::optional<int> push(int value) noexcept {
    std::optional<int> oldest;
    const std::uint64_t read = read_.load();
    if (next_ - read == kCapacity) {
      oldest = slots_[read % kCapacity].load();
      read_.store(read + 1);
      ++evicted_;
    }
    slots_[next_ % kCapacity].store(value);
    write_.store(++next_);
    return oldest;
  }
  std::optional<int> pop() noexcept {
    std::uint64_t read = read_.load();
    while (read != write_.load()) {
      const int value = slots_[read % kCapacity].load();
      if (read_.compare_exchange_strong(read, read + 1)) return value;
    }
    return std::nullopt;
  }
  std::optional<int> evict() noexcept { return std::nullopt; }
  static constexpr std::size_t capacity() noexcept { return kCapacity; }
  [[nodiscard]] std::uint64_t evicted() const noexcept { return evicted_; }

 private:
  interleave::Atomic<std::uint64_t> read_{0};
  interleave::Atomic<std::uint64_t> write_{0};
  std::array<interleave::Atomic<int>, kCapacity> slots_{};
  std::uint64_t next_ = 0;
  std::uint64_t evicted_ = 0;
};

TEST(InterleaveFindsOut, EvictionWithoutCompareExchange) {
  for (const Reduction reduction : {Reduction::kNone, Reduction::kCommuting}) {
    const Exploration found = explore<RingTrial<RingWithoutCompareExchange<2>, 2, 1, 1>>(reduction);
    EXPECT_NE(found.fault, "");
    EXPECT_FALSE(found.complete);
    EXPECT_FALSE(found.schedule.empty());
  }
}

TEST(InterleaveFindsOut, NothingWhereTheWrongRingRunsAlone) {
  // The fault above is one of the interleaving: without a second thread that ring is right.
  expect_right<RingTrial<RingWithoutCompareExchange<2>, 2, 3, 0>>(1);
}

/// Its compare-exchange is two steps.
template <class T>
class TwoStepAtomic : public interleave::Atomic<T> {
 public:
  using interleave::Atomic<T>::Atomic;
  bool compare_exchange_strong(T& expected, T desired, std::memory_order, std::memory_order) noexcept {
    const T now = this->load();
    if (now != expected) {
      expected = now;
      return false;
    }
    this->store(desired);
    return true;
  }
};

TEST(InterleaveFindsOut, ThatTheRingNeedsAnAtomicCompareExchange) {
  const Exploration found = explore<RingTrial<EvictingRing<int, 2, TwoStepAtomic>, 2, 1, 1>>();
  EXPECT_NE(found.fault, "");
  EXPECT_FALSE(found.complete);
}

/// Keeps what is newest though it has moved: a store too early.
template <std::size_t kCapacity>
class RingThatPublishesFirst {
 public:
  std::optional<int> push(int value) noexcept {
    write_.store(next_ + 1);
    slots_[next_++ % kCapacity].store(value);
    return std::nullopt;
  }
  std::optional<int> pop() noexcept {
    const std::uint64_t read = read_;
    if (read == write_.load()) return std::nullopt;
    ++read_;
    return slots_[read % kCapacity].load();
  }
  std::optional<int> evict() noexcept { return std::nullopt; }
  static constexpr std::size_t capacity() noexcept { return kCapacity; }
  [[nodiscard]] static std::uint64_t evicted() noexcept { return 0; }

 private:
  std::uint64_t read_ = 0;
  interleave::Atomic<std::uint64_t> write_{0};
  std::array<interleave::Atomic<int>, kCapacity> slots_{};
  std::uint64_t next_ = 0;
};

TEST(InterleaveFindsOut, AnElementPublishedBeforeItIsThere) {
  const Exploration found = explore<RingTrial<RingThatPublishesFirst<4>, 0, 1, 1>>();
  EXPECT_NE(found.fault, "");
}

/// Large: two halves that are written one after the other.
struct Halves {
  interleave::Atomic<int> a;
  interleave::Atomic<int> b;
};

/// The same with copies that take two steps, too.
struct CopiedHalves {
  interleave::Atomic<int> a;
  interleave::Atomic<int> b;
  CopiedHalves() = default;
  explicit CopiedHalves(int value) : a(value), b(value) {}
  CopiedHalves(const CopiedHalves& other) noexcept : a(other.a.load()), b(other.b.load()) {}
  CopiedHalves& operator=(const CopiedHalves& other) noexcept {
    if (this != &other) {
      a.store(other.a.load());
      b.store(other.b.load());
    }
    return *this;
  }
  ~CopiedHalves() = default;
};

template <class Queue, int kPushes, int kPops>
struct QueueTrial {
  Queue queue;
  int pushed = 0;
  int refused = 0;
  int popped = 0;
  std::string wrong;

  void first() {
    for (int i = 0; i < kPushes; ++i) {
      if (queue.push(CopiedHalves(pushed + 1))) {
        ++pushed;
      } else {
        ++refused;
      }
    }
  }
  bool look() {
    CopiedHalves value;
    if (!queue.pop(value)) return false;
    if (value.a.load() != value.b.load()) wrong = "torn";
    if (value.a.load() != ++popped) wrong = "lost, doubled or out of order";
    return true;
  }
  void second() {
    for (int i = 0; i < kPops; ++i) (void)look();
  }
  std::string fault() {
    while (popped <= pushed && look()) {
    }
    if (wrong.empty() && popped != pushed) wrong = "lost or doubled";
    if (wrong.empty() && queue.refused() != static_cast<std::uint64_t>(refused)) wrong = "refusals miscounted";
    return wrong;
  }
};

template <std::size_t kCapacity>
using Queue = HandoverQueue<CopiedHalves, kCapacity, interleave::Atomic>;

TEST(InterleaveQueue, LosesDoublesAndTearsNothing) {
  expect_right<QueueTrial<Queue<1>, 3, 3>>(10);
  expect_right<QueueTrial<Queue<2>, 4, 3>>(10);
  expect_right<QueueTrial<Queue<2>, 5, 2>>(10);
}

/// Gives the slot back before it has read it.
template <std::size_t kCapacity>
class QueueThatMovesOnFirst {
 public:
  bool push(const CopiedHalves& value) noexcept {
    if (next_write_ - read_.load() == kCapacity) {
      ++refused_;
      return false;
    }
    slots_[next_write_ % kCapacity] = value;
    write_.store(++next_write_);
    return true;
  }
  bool pop(CopiedHalves& out) noexcept {
    if (next_read_ == write_.load()) return false;
    read_.store(next_read_ + 1);
    out = slots_[next_read_++ % kCapacity];
    return true;
  }
  [[nodiscard]] std::uint64_t refused() const noexcept { return refused_; }

 private:
  interleave::Atomic<std::uint64_t> read_{0};
  interleave::Atomic<std::uint64_t> write_{0};
  std::array<CopiedHalves, kCapacity> slots_{};
  std::uint64_t next_read_ = 0;
  std::uint64_t next_write_ = 0;
  std::uint64_t refused_ = 0;
};

TEST(InterleaveFindsOut, ASlotGivenBackBeforeItIsRead) {
  const Exploration found = explore<QueueTrial<QueueThatMovesOnFirst<1>, 2, 1>>();
  EXPECT_NE(found.fault, "");
  EXPECT_FALSE(found.complete);
}

template <class Box, int kPublishes, int kTakes>
struct MailboxTrial {
  Box box;
  int last = 0;
  std::string wrong;

  void first() {
    for (int i = 1; i <= kPublishes; ++i) {
      Halves& draft = box.draft();
      draft.a.store(i);
      draft.b.store(i);
      box.publish();
    }
  }
  void look() {
    const Halves* value = box.take();
    if (value == nullptr) return;
    const int a = value->a.load();
    const int b = value->b.load();
    if (a != b) wrong = "torn: " + std::to_string(a) + " and " + std::to_string(b);
    if (a <= last) wrong = "backwards or twice: " + std::to_string(a) + " after " + std::to_string(last);
    last = a;
  }
  void second() {
    for (int i = 0; i < kTakes; ++i) look();
  }
  std::string fault() {
    look();  // both have ended: the newest must be there
    if (wrong.empty() && last != kPublishes) wrong = "the newest never came";
    return wrong;
  }
};

template <template <class> class Atomic>
using BoxOf = Mailbox<Halves, Atomic>;
using Box = BoxOf<interleave::Atomic>;

TEST(InterleaveMailbox, IsNeverTornAndNeverGoesBack) {
  expect_right<MailboxTrial<Box, 5, 5>>(1000);
  expect_right<MailboxTrial<Box, 12, 2>>(100);
  expect_right<MailboxTrial<Box, 2, 12>>(100);
}

TEST(InterleaveMailbox, AllSchedulesWithoutAnyReduction) {
  const Exploration found = explore<MailboxTrial<Box, 4, 3>>(Reduction::kNone);
  EXPECT_EQ(found.fault, "") << "schedule " << found.schedule;
  EXPECT_TRUE(found.complete);
  EXPECT_GE(found.schedules, 10000U);
}

/// The reader reads the slot that was published, the writer fills the other one.
class TwoSlotMailbox {
 public:
  Halves& draft() noexcept { return slots_[back_]; }
  void publish() noexcept {
    state_.store(static_cast<std::uint8_t>(back_ | 2));
    back_ ^= 1;
  }
  const Halves* take() noexcept {
    const std::uint8_t state = state_.load();
    if ((state & 2) == 0) return nullptr;
    state_.store(state & 1);
    return &slots_[state & 1];
  }

 private:
  std::array<Halves, 2> slots_{};
  interleave::Atomic<std::uint8_t> state_{1};
  std::uint8_t back_ = 0;
};

TEST(InterleaveFindsOut, AMailboxOfTwoSlots) {
  for (const Reduction reduction : {Reduction::kNone, Reduction::kCommuting}) {
    const Exploration found = explore<MailboxTrial<TwoSlotMailbox, 3, 2>>(reduction);
    EXPECT_NE(found.fault, "");
    EXPECT_FALSE(found.complete);
  }
}

/// Its exchange is two steps.
template <class T>
class TwoStepExchange : public interleave::Atomic<T> {
 public:
  using interleave::Atomic<T>::Atomic;
  T exchange(T value, std::memory_order) noexcept {
    const T old = this->load();
    this->store(value);
    return old;
  }
};

TEST(InterleaveFindsOut, ThatTheMailboxNeedsAnAtomicExchange) {
  const Exploration found = explore<MailboxTrial<BoxOf<TwoStepExchange>, 3, 2>>();
  EXPECT_NE(found.fault, "");
}

/// Two threads that add one to a number, each in two steps: 2, or 1 where they overlap.
std::set<int>* outcomes = nullptr;
int read_between = 0;
struct Increments {
  interleave::Atomic<int> number;
  interleave::Atomic<int> other;
  void first() {
    number.store(number.load() + 1);
    other.store(1);
  }
  void second() {
    read_between = other.load();
    number.store(number.load() + 1);
  }
  std::string fault() {
    outcomes->insert(10 * number.load() + read_between);
    return {};
  }
};

TEST(Interleave, NumberOfSchedulesIsTheBinomialOfTheSteps) {
  std::set<int> seen;
  outcomes = &seen;
  const Exploration all = explore<Increments>(Reduction::kNone);
  EXPECT_EQ(all.schedules, 20U);  // 6! / (3! 3!)
  EXPECT_TRUE(all.complete);
  EXPECT_EQ(seen, (std::set<int>{10, 20, 21}));
}

TEST(Interleave, ReductionKeepsEveryOutcome) {
  std::set<int> plain;
  std::set<int> reduced;
  outcomes = &plain;
  const Exploration all = explore<Increments>(Reduction::kNone);
  outcomes = &reduced;
  const Exploration few = explore<Increments>(Reduction::kCommuting);
  EXPECT_EQ(plain, reduced);
  EXPECT_LT(few.schedules, all.schedules);
  EXPECT_TRUE(few.complete);
}

TEST(Interleave, StopsAtItsLimitAndSaysSo) {
  const Exploration found = explore<RingTrial<Ring<2>, 2, 3, 3>>(Reduction::kNone, 50);
  EXPECT_EQ(found.schedules, 50U);
  EXPECT_FALSE(found.complete);
  EXPECT_EQ(found.fault, "");
}

/// One waits for the other, without end where the other has not moved.
struct Spinning {
  interleave::Atomic<int> flag;
  void first() {
    while (flag.load() == 0) {
    }
  }
  void second() { flag.store(1); }
  static std::string fault() { return {}; }
};

TEST(Interleave, FindsAThreadThatDoesNotEnd) {
  const Exploration found = explore<Spinning>();
  EXPECT_EQ(found.fault, "a thread does not end");
}

}  // namespace
}  // namespace stereotrack
