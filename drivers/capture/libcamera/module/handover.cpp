#include "drivers/capture/libcamera/module/handover.hpp"

#include <sys/eventfd.h>
#include <unistd.h>

#include <cerrno>
#include <system_error>

namespace stereotrack::libcamera_module {
namespace {

int make_event(int flags) {
  const int descriptor = ::eventfd(0, EFD_CLOEXEC | EFD_SEMAPHORE | flags);
  if (descriptor < 0) throw std::system_error(errno, std::generic_category(), "eventfd");
  return descriptor;
}

void ring(int descriptor) noexcept {
  const std::uint64_t one = 1;
  (void)!::write(descriptor, &one, sizeof one);
}

}  // namespace

Handover::Handover() : ready_(make_event(EFD_NONBLOCK)) {
  try {
    wanted_ = make_event(0);
  } catch (...) {
    ::close(ready_);
    throw;
  }
}

Handover::~Handover() {
  ::close(ready_);
  ::close(wanted_);
}

void Handover::push(const LibcameraFrame& frame) noexcept {
  if (frames_.push(frame)) ring(ready_);
}

void Handover::lose(const char* cause) noexcept {
  const char* none = nullptr;
  if (loss_.compare_exchange_strong(none, cause, std::memory_order_acq_rel)) ring(ready_);
}

void Handover::end() noexcept {
  ended_.store(true, std::memory_order_release);
  ring(wanted_);
}

std::int32_t Handover::take(LibcameraFrame& frame) noexcept {
  std::uint64_t one = 0;
  if (::read(ready_, &one, sizeof one) != sizeof one) return loss() != nullptr ? kLibcameraLost : kLibcameraNothing;
  if (frames_.pop(frame)) return kLibcameraTaken;
  ring(ready_);  // the loss's: it stays to be seen
  return kLibcameraLost;
}

void Handover::give_back(std::uint32_t buffer) noexcept {
  if (returned_.push(buffer)) ring(wanted_);
}

bool Handover::wait_returned(std::uint32_t& buffer) noexcept {
  while (!ended_.load(std::memory_order_acquire)) {
    std::uint64_t one = 0;
    if (::read(wanted_, &one, sizeof one) != sizeof one) continue;  // a signal
    if (ended_.load(std::memory_order_acquire)) return false;
    if (returned_.pop(buffer)) return true;
  }
  return false;
}

}  // namespace stereotrack::libcamera_module
