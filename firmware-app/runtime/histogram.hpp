#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <cstddef>
#include <cstdint>

namespace stereotrack::runtime {

/// Counts of durations, in buckets that grow with the value: 16 to each doubling, so that a percentile is known within
/// 1/16 of it, from 1 ns to 2^40 ns (18 minutes; longer ones count in the last bucket, the maximum is kept exactly).
/// 5 kB. One thread records, any number read at the same time; a reader may see a value's count before its maximum.
/// record() takes no lock, no heap, no system call: a few nanoseconds.
class Histogram {
 public:
  /// Negative durations count as 0.
  void record(std::int64_t nanoseconds) noexcept {
    const std::uint64_t value = nanoseconds > 0 ? static_cast<std::uint64_t>(nanoseconds) : 0;
    // One writer: load and store do, without the price of an atomic addition.
    add(counts_[bucket_of(value)], 1);
    add(sum_, value);
    if (value > max_.load(std::memory_order_relaxed)) max_.store(value, std::memory_order_relaxed);
  }

  [[nodiscard]] std::uint64_t count() const noexcept {
    std::uint64_t total = 0;
    for (const auto& one : counts_) total += one.load(std::memory_order_relaxed);
    return total;
  }
  [[nodiscard]] std::uint64_t sum_ns() const noexcept { return sum_.load(std::memory_order_relaxed); }
  [[nodiscard]] std::uint64_t max_ns() const noexcept { return max_.load(std::memory_order_relaxed); }

  /// The smallest duration that at least `part` (0..1) of the counted ones do not exceed, rounded up to the end of its
  /// bucket, but no more than the maximum. 0 where nothing was counted.
  [[nodiscard]] std::uint64_t percentile_ns(double part) const noexcept {
    const auto total = static_cast<double>(count());
    double seen = 0;
    for (std::size_t i = 0; i < kBuckets; ++i) {
      seen += static_cast<double>(counts_[i].load(std::memory_order_relaxed));
      if (seen > 0 && seen >= part * total) return std::min(end_of(i), max_ns());
    }
    return max_ns();
  }

 private:
  static constexpr unsigned kSubBits = 4;  // 16 buckets a doubling
  static constexpr std::uint64_t kSubs = 1U << kSubBits;
  static constexpr unsigned kLargestBits = 40;
  static constexpr std::size_t kBuckets = (kLargestBits - kSubBits + 1) * kSubs;

  static void add(std::atomic<std::uint64_t>& to, std::uint64_t what) noexcept {
    to.store(to.load(std::memory_order_relaxed) + what, std::memory_order_relaxed);
  }
  /// Values under 16 have a bucket each; others are told by their first five binary digits.
  [[nodiscard]] static constexpr std::size_t bucket_of(std::uint64_t value) noexcept {
    if (value < kSubs) return static_cast<std::size_t>(value);
    const auto digits = static_cast<unsigned>(std::bit_width(value));
    if (digits > kLargestBits) return kBuckets - 1;
    const unsigned shift = digits - kSubBits - 1;
    return static_cast<std::size_t>(shift * kSubs + (value >> shift));
  }
  /// The largest value of a bucket.
  [[nodiscard]] static constexpr std::uint64_t end_of(std::size_t bucket) noexcept {
    if (bucket < kSubs) return bucket;
    const std::uint64_t shift = bucket / kSubs - 1;
    return ((bucket - shift * kSubs + 1) << shift) - 1;
  }

  std::array<std::atomic<std::uint64_t>, kBuckets> counts_{};
  std::atomic<std::uint64_t> sum_{0};
  std::atomic<std::uint64_t> max_{0};
};

}  // namespace stereotrack::runtime
