#include "drivers/trigger/edges.hpp"

#include <sys/epoll.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <stdexcept>
#include <system_error>
#include <utility>

namespace stereotrack::trigger {

namespace {

constexpr std::chrono::milliseconds kFirstWait{500};
constexpr std::chrono::milliseconds kLongestWait{4000};
constexpr std::chrono::seconds kProbePeriod{1};

std::string line_text(const gpio::InputSpec& spec) { return "trigger: GPIO line " + gpio::to_string(spec.name); }

}  // namespace

EdgeTrigger::EdgeTrigger(const gpio::InputSpec& spec, std::string_view consumer)
    : spec_(spec), consumer_(consumer), epoll_(epoll_create1(EPOLL_CLOEXEC)) {
  if (epoll_ < 0) {
    throw std::runtime_error(line_text(spec_) + ": cannot be waited for: " + std::generic_category().message(errno));
  }
  try {
    request_ = gpio::request_input(spec_, consumer_);
    watch(*request_);
  } catch (...) {
    (void)close(epoll_);
    throw;
  }
}

EdgeTrigger::~EdgeTrigger() {
  delete incoming_.load(std::memory_order_acquire);
  delete retired_.load(std::memory_order_acquire);
  request_.reset();
  (void)close(epoll_);
}

void EdgeTrigger::watch(const gpio::InputRequest& request) const {
  for (const int descriptor : request.descriptors()) {
    epoll_event wanted{.events = EPOLLIN, .data = {.fd = descriptor}};
    if (epoll_ctl(epoll_, EPOLL_CTL_ADD, descriptor, &wanted) == 0) continue;
    throw std::runtime_error(line_text(spec_) + ": cannot be waited for: " + std::generic_category().message(errno));
  }
}

// ---- Capture thread

void EdgeTrigger::adopt() noexcept {
  if (request_ || incoming_.load(std::memory_order_relaxed) == nullptr) return;
  request_.reset(incoming_.exchange(nullptr, std::memory_order_acquire));
  sequence_ = 0;
}

/// It is freed by the service thread, and must not wake this one until then.
void EdgeTrigger::lose(int error) noexcept {
  for (const int descriptor : request_->descriptors()) {
    (void)epoll_ctl(epoll_, EPOLL_CTL_DEL, descriptor, nullptr);
  }
  error_.store(error, std::memory_order_relaxed);
  // The place is empty: another request comes only after this one was fetched.
  retired_.store(request_.release(), std::memory_order_release);
}

bool EdgeTrigger::take(Pulse& pulse) noexcept {
  adopt();
  if (next_ == count_) {
    next_ = count_ = 0;
    if (!request_) return false;
    const gpio::InputRequest::ReadResult done = request_->read(events_);
    int error = done.events == 0 ? done.error : 0;  // else what came first counts, and the next reading says it again
    if (error == 0 && probe_wanted_.load(std::memory_order_relaxed)) {
      probe_wanted_.store(false, std::memory_order_relaxed);
      if (done.events == 0) error = request_->probe();
    }
    if (error != 0) lose(error);
    count_ = done.events;
    if (count_ == 0) return false;
  }
  const gpio::EdgeEvent& event = events_[next_++];
  const std::uint32_t gap = event.sequence == 0 ? 0 : event.sequence - sequence_ - 1;
  sequence_ = event.sequence;
  number_ += gap + 1;
  lost_.add(gap);
  taken_.add();
  pulse = {number_, event.time};
  return true;
}

// ---- Service thread

void EdgeTrigger::tend(MonotonicTime now, std::vector<Note>& notes) {
  if (const std::unique_ptr<gpio::InputRequest> dead(retired_.exchange(nullptr, std::memory_order_acquire)); dead) {
    is_wanted_ = true;
    lost_at_ = now;
    back_off_ = kFirstWait;
    next_try_ = now + back_off_;
    last_refusal_.clear();
    notes.push_back({false, line_text(spec_) + ": " + std::generic_category().message(error_.load()) +
                                ": pairs are formed without pulses until its chip is back"});
  }
  if (now >= next_probe_) {
    next_probe_ = now + kProbePeriod;
    probe_wanted_.store(taken_.get() == std::exchange(taken_before_, taken_.get()), std::memory_order_relaxed);
  }
  if (!is_wanted_ || now < next_try_) return;
  try {
    std::unique_ptr<gpio::InputRequest> made = gpio::request_input(spec_, consumer_);
    watch(*made);
    incoming_.store(made.release(), std::memory_order_release);
    is_wanted_ = false;
    std::array<char, 32> after{};
    (void)std::snprintf(after.data(), after.size(), " after %.1f s", to_seconds(now - lost_at_));
    notes.push_back({true, line_text(spec_) + ": works again" + after.data()});
  } catch (const std::runtime_error& error) {
    back_off_ = std::min<std::chrono::nanoseconds>(2 * back_off_, kLongestWait);
    next_try_ = now + back_off_;
    // First it is not there, then it may not be used: said where the reason changes.
    if (last_refusal_ != error.what()) notes.push_back({false, std::string("trigger: ") + error.what()});
    last_refusal_ = error.what();
  }
}

}  // namespace stereotrack::trigger
