#include "tests/bench/harness.hpp"

#include <linux/perf_event.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <cstring>
#include <ctime>
#include <stdexcept>

#include "firmware-app/runtime/allocation_count.hpp"

#if __has_include(<valgrind/callgrind.h>)
#include <valgrind/callgrind.h>
#else
#define RUNNING_ON_VALGRIND 0
#define CALLGRIND_START_INSTRUMENTATION
#define CALLGRIND_STOP_INSTRUMENTATION
#define CALLGRIND_DUMP_STATS_AT(name)
#endif

namespace stereotrack::bench {

namespace {

double percentile(const std::vector<double>& sorted, double percent) {
  const auto rank = static_cast<std::size_t>(std::ceil(percent / 100 * static_cast<double>(sorted.size())));
  return sorted[std::clamp<std::size_t>(rank, 1, sorted.size()) - 1];
}

}  // namespace

double thread_ms() noexcept {
  timespec now{};
  (void)clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) * 1e3 + static_cast<double>(now.tv_nsec) * 1e-6;
}

Times times_of(std::vector<double> ms) {
  std::sort(ms.begin(), ms.end());
  return {percentile(ms, 50), percentile(ms, 99), ms.back()};
}

double median_of(std::vector<double> values) { return times_of(std::move(values)).p50; }

StageClock::StageClock(std::vector<std::string> names) : names_(std::move(names)), ms_(names_.size()) {}

void StageClock::begin(bool records) noexcept {
  records_ = records;
  last_ = thread_ms();
}

void StageClock::ended(std::size_t stage) noexcept {
  const double now = thread_ms();
  if (records_ && ms_[stage].size() < ms_[stage].capacity()) {
    ms_[stage].push_back(now - last_);
  }
  last_ = now;
}

void StageClock::reserve(std::size_t calls) {
  for (std::vector<double>& ms : ms_) ms.reserve(calls);
}

InstructionCounter::InstructionCounter() {
  perf_event_attr wanted{};
  wanted.size = sizeof wanted;
  wanted.type = PERF_TYPE_HARDWARE;
  wanted.config = PERF_COUNT_HW_INSTRUCTIONS;
  wanted.exclude_kernel = 1;
  wanted.exclude_hv = 1;
  fd_ = static_cast<int>(syscall(SYS_perf_event_open, &wanted, 0, -1, -1, 0UL));
  if (fd_ < 0) why_not_ = std::string("perf_event_open: ") + std::strerror(errno);
}

InstructionCounter::~InstructionCounter() {
  if (fd_ >= 0) (void)close(fd_);
}

std::uint64_t InstructionCounter::count() const noexcept {
  std::uint64_t value = 0;
  if (fd_ < 0 || read(fd_, &value, sizeof value) != sizeof value) return 0;
  return value;
}

void Contest::add(std::string name, std::function<void()> work, StageClock* stages) {
  Contestant contestant{std::move(work), stages, {}};
  contestant.measured.name = std::move(name);
  contestant.measured.stages = stages;
  contestants_.push_back(std::move(contestant));
}

void Contest::reserve(std::size_t rounds) {
  for (Contestant& contestant : contestants_) {
    contestant.measured.ms.reserve(rounds);
    contestant.measured.wall_ms.reserve(rounds);
    if (contestant.stages != nullptr) contestant.stages->reserve(rounds);
  }
}

void Contest::round(bool records) {
  for (std::size_t i = 0; i < contestants_.size(); ++i) {
    call(contestants_[(first_ + i) % contestants_.size()], records);
  }
  ++first_;
}

void Contest::call(Contestant& contestant, bool records) {
  const bool dumps = records && under_valgrind();
  if (contestant.stages != nullptr) contestant.stages->begin(records);
  if (dumps) {
    CALLGRIND_START_INSTRUMENTATION;
  }
  const std::uint64_t instructions_before = counter_.count();
  const std::uint64_t allocations_before = allocations_of_this_thread();
  const auto wall_start = std::chrono::steady_clock::now();
  const double start = thread_ms();
  contestant.work();
  const double ms = thread_ms() - start;
  const std::chrono::duration<double, std::milli> wall = std::chrono::steady_clock::now() - wall_start;
  const std::uint64_t allocations = allocations_of_this_thread() - allocations_before;
  const std::uint64_t instructions = counter_.count() - instructions_before;
  if (dumps) {
    CALLGRIND_DUMP_STATS_AT(contestant.measured.name.c_str());
    CALLGRIND_STOP_INSTRUMENTATION;
  }
  if (!records) return;
  Measured& measured = contestant.measured;
  measured.ms.push_back(ms);
  measured.wall_ms.push_back(wall.count());
  const auto calls = static_cast<double>(measured.ms.size());
  measured.allocations += (static_cast<double>(allocations) - measured.allocations) / calls;
  if (counter_.works()) {
    const double mean = measured.instructions.value_or(0);
    measured.instructions = mean + (static_cast<double>(instructions) - mean) / calls;
  }
}

const Measured& Contest::of(std::string_view name) const {
  for (const Contestant& contestant : contestants_) {
    if (contestant.measured.name == name) return contestant.measured;
  }
  throw std::logic_error(std::string(name) + ": nobody of that name in this contest");
}

bool under_valgrind() noexcept { return RUNNING_ON_VALGRIND != 0; }

double copy_bandwidth() {
  constexpr std::size_t kBytes = std::size_t{128} << 20;
  constexpr int kTimes = 9;
  const std::vector<char> from(kBytes, 1);
  std::vector<char> to(kBytes, 2);
  std::vector<double> gigabytes_a_second;
  for (int i = 0; i < kTimes; ++i) {
    const double start = thread_ms();
    std::memcpy(to.data(), from.data(), kBytes);
    gigabytes_a_second.push_back(2.0 * kBytes / 1e6 / (thread_ms() - start));
  }
  return median_of(std::move(gigabytes_a_second));
}

}  // namespace stereotrack::bench
