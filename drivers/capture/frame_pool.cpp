#include "drivers/capture/frame_pool.hpp"

#include <cassert>
#include <stdexcept>
#include <string>

namespace stereotrack::capture {

namespace {

constexpr std::uint32_t kNone = ~0U;

void add_one(std::atomic<std::uint64_t>& counter) noexcept {
  counter.store(counter.load(std::memory_order_relaxed) + 1, std::memory_order_relaxed);
}

}  // namespace

const FramePair& PairLease::operator*() const noexcept {
  assert(pool_ != nullptr);
  return pool_->pairs_[slot_];
}

void PairLease::release() noexcept {
  FramePool* pool = std::exchange(pool_, nullptr);
  if (pool != nullptr) (void)pool->returned_.push(slot_);
}

FramePool::FramePool(std::size_t slots) : slots_(slots), claimed_(kNone), free_low_(slots) {
  if (slots < kMinSlots || slots > kMaxSlots) {
    throw std::invalid_argument("a pool of " + std::to_string(slots) + " frame pairs: want " +
                                std::to_string(kMinSlots) + " to " + std::to_string(kMaxSlots));
  }
  // The lowest number on top, so that the order of use is the same in every run.
  for (std::size_t i = 0; i < slots; ++i) free_[free_count_++] = static_cast<std::uint32_t>(slots - 1 - i);
}

void FramePool::count_free_low() noexcept {
  if (free_count_ < free_low_.load(std::memory_order_relaxed)) free_low_.store(free_count_, std::memory_order_relaxed);
}

FramePool::Claimed FramePool::claim() noexcept {
  assert(claimed_ == kNone);
  Claim how = Claim::kFree;
  if (free_count_ > 0) {
    claimed_ = free_[--free_count_];
  } else if (const auto back = returned_.pop()) {
    claimed_ = *back;
  } else if (const auto oldest = waiting_.evict()) {
    claimed_ = *oldest;
    how = Claim::kEvicted;
  } else if (const auto late = returned_.pop()) {
    // Taken and given back while evict() looked.
    claimed_ = *late;
  } else {
    add_one(starved_);
    count_free_low();
    return {};
  }
  count_free_low();
  return {how, claimed_, &pairs_[claimed_]};
}

void FramePool::publish() noexcept {
  assert(claimed_ != kNone);
  (void)waiting_.push(std::exchange(claimed_, kNone));
  add_one(captured_);
  doorbell_.ring();
}

void FramePool::give_up() noexcept {
  assert(claimed_ != kNone);
  free_[free_count_++] = std::exchange(claimed_, kNone);
}

bool FramePool::take_back(std::uint32_t& slot) noexcept {
  const auto back = returned_.pop();
  if (!back) return false;
  slot = *back;
  free_[free_count_++] = slot;
  return true;
}

void FramePool::close() noexcept {
  // Release: who sees it closed sees all that was published.
  closed_.store(true, std::memory_order_release);
  doorbell_.ring();
}

FramePool::Wait FramePool::wait(MonotonicTime deadline) noexcept {
  for (;;) {
    const Doorbell::Count seen = doorbell_.rings();
    const bool closed = closed_.load(std::memory_order_acquire);
    if (!waiting_.empty()) return Wait::kPair;
    if (closed) return Wait::kClosed;
    if (!doorbell_.wait(seen, deadline)) return waiting_.empty() ? Wait::kDeadline : Wait::kPair;
  }
}

PairLease FramePool::take_oldest() noexcept {
  const auto slot = waiting_.pop();
  return slot ? PairLease(this, *slot) : PairLease();
}

PairLease FramePool::take_newest() noexcept {
  PairLease lease = take_oldest();
  while (PairLease newer = take_oldest()) {
    lease = std::move(newer);
    add_one(skipped_);
  }
  return lease;
}

FramePool::Counters FramePool::counters() const noexcept {
  Counters out;
  out.captured = captured_.load(std::memory_order_relaxed);
  out.evicted = waiting_.evicted();
  out.skipped = skipped_.load(std::memory_order_relaxed);
  out.starved = starved_.load(std::memory_order_relaxed);
  out.free_low = free_low_.load(std::memory_order_relaxed);
  out.waiting_high = waiting_.high_water();
  return out;
}

}  // namespace stereotrack::capture
