#pragma once

#include <string>
#include <string_view>

namespace stereotrack::capture::v4l2 {

/// The one place where the kernel is asked: ioctl(2), again where a signal cut in. 0, or errno. No heap, no lock.
[[nodiscard]] int ask_kernel(int descriptor, unsigned long request, void* argument) noexcept;

/// An open device node; closed with its owner. Moves.
class Device {
 public:
  Device() noexcept = default;
  Device(Device&& other) noexcept;
  Device& operator=(Device&& other) noexcept;
  Device(const Device&) = delete;
  Device& operator=(const Device&) = delete;
  ~Device();

  /// Opens for reading and writing, without waiting in any later call. 0, or errno.
  [[nodiscard]] int open(const std::string& path) noexcept;
  /// The same node by a descriptor of its own: calls by one do not wait for calls by the other, and the other is told
  /// of what this one changes. 0, or errno.
  [[nodiscard]] int open_beside(const Device& other) noexcept;
  void close() noexcept;

  [[nodiscard]] bool is_open() const noexcept { return descriptor_ >= 0; }
  [[nodiscard]] int descriptor() const noexcept { return descriptor_; }

  /// As ask_kernel().
  template <class Argument>
  [[nodiscard]] int ask(unsigned long request, Argument& argument) const noexcept {
    return ask_kernel(descriptor_, request, &argument);
  }

 private:
  int descriptor_ = -1;
};

/// Throws std::runtime_error: "camera NAME: WHAT".
[[noreturn]] void refuse(std::string_view name, const std::string& what);

/// What an errno means, for people; of those that drivers answer with. No heap, no lock, no locale.
[[nodiscard]] const char* error_text(int error) noexcept;

/// Why a node did not open, with the way out.
[[nodiscard]] std::string open_refusal(const std::string& path, int error);

}  // namespace stereotrack::capture::v4l2
