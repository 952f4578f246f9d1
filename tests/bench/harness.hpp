#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace stereotrack::bench {

/// Times are those for which the calling thread had the CPU: what else the machine does at the same time lengthens
/// caches' misses, but not the time that somebody else computes. All contestants work in one thread; the time on the
/// wall is kept beside it, and would show who does not.
[[nodiscard]] double thread_ms() noexcept;

/// Of a set of times [ms].
struct Times {
  double p50 = 0;
  double p99 = 0;
  double max = 0;
};
/// Percentile p is the smallest value that at least p % of all do not exceed. In: at least one.
[[nodiscard]] Times times_of(std::vector<double> ms);
[[nodiscard]] double median_of(std::vector<double> values);

/// Splits one call into its stages. The rooms for the times are taken beforehand: ended() takes none.
class StageClock {
 public:
  explicit StageClock(std::vector<std::string> names);
  void begin(bool records) noexcept;
  void ended(std::size_t stage) noexcept;
  void reserve(std::size_t calls);
  [[nodiscard]] const std::vector<std::string>& names() const noexcept { return names_; }
  [[nodiscard]] const std::vector<double>& ms(std::size_t stage) const { return ms_[stage]; }

 private:
  std::vector<std::string> names_;
  std::vector<std::vector<double>> ms_;  ///< [stage][call]
  double last_ = 0;                      ///< [ms]
  bool records_ = false;
};

/// Retired instructions of this thread in user mode, from the CPU's own counter where the kernel gives one.
class InstructionCounter {
 public:
  InstructionCounter();
  InstructionCounter(const InstructionCounter&) = delete;
  InstructionCounter& operator=(const InstructionCounter&) = delete;
  ~InstructionCounter();
  [[nodiscard]] bool works() const noexcept { return fd_ >= 0; }
  [[nodiscard]] const std::string& why_not() const noexcept { return why_not_; }
  [[nodiscard]] std::uint64_t count() const noexcept;

 private:
  int fd_ = -1;
  std::string why_not_;
};

/// What one contestant took.
struct Measured {
  std::string name;
  std::vector<double> ms;              ///< each timed call
  std::vector<double> wall_ms;         ///< likewise
  double allocations = 0;              ///< heap calls, mean of the timed calls
  std::optional<double> instructions;  ///< mean of the timed calls
  const StageClock* stages = nullptr;  ///< of whoever has any
};

/// Several who do the same work on the same pictures, in turns: A B C, B C A, C A B..., so that a stall of the machine
/// and what the one before left in the caches meet all of them alike. Under `valgrind --tool=callgrind` each timed call
/// dumps what it cost under its contestant's name.
class Contest {
 public:
  explicit Contest(const InstructionCounter& counter) : counter_(counter) {}

  /// Names are unique in the process.
  void add(std::string name, std::function<void()> work, StageClock* stages = nullptr);
  void reserve(std::size_t rounds);
  /// Everybody once. Nothing is kept of a round that does not record.
  void round(bool records);
  [[nodiscard]] const Measured& of(std::string_view name) const;

 private:
  struct Contestant {
    std::function<void()> work;
    StageClock* stages;
    Measured measured;
  };
  void call(Contestant& contestant, bool records);

  const InstructionCounter& counter_;
  std::vector<Contestant> contestants_;
  std::size_t first_ = 0;
};

/// Whether the process runs under valgrind, where times mean nothing and instructions are counted.
[[nodiscard]] bool under_valgrind() noexcept;

/// What memcpy moves between buffers much larger than the caches, bytes read and bytes written together [GB/s].
[[nodiscard]] double copy_bandwidth();

}  // namespace stereotrack::bench
