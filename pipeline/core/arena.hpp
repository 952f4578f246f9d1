#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <new>
#include <span>
#include <type_traits>

#include "pipeline/core/image_view.hpp"

namespace stereotrack {

/// All memory of the stages, taken at start and given back together at the end: neighbours in a few slabs that begin on
/// a large page.
/// Set-up only, one thread. After seal() nothing more is handed out: a stage that asks in the frame
/// loop gets nothing and failed() becomes true, which tests look at.
class Arena {
 public:
  static constexpr std::size_t kAlignment = 64;  ///< a cache line, and the widest vector register
  /// Slabs are so large, and multiples of it for requests that are larger: two large pages.
  static constexpr std::size_t kSlabBytes = std::size_t{4} * 1024 * 1024;

  /// Told of each slab before it is written to: where a system can be asked for large pages, of which planes that are
  /// walked side by side need few (`firmware-app/runtime/large_pages.hpp`).
  using Advice = void (*)(void* slab, std::size_t bytes) noexcept;

  explicit Arena(Advice advice = nullptr) noexcept : advice_(advice) {}
  Arena(const Arena&) = delete;
  Arena& operator=(const Arena&) = delete;
  ~Arena();

  /// `count` value-initialised (zeroed) elements, aligned to kAlignment; empty, and failed() from then on, if there is
  /// no memory or the arena is sealed.
  template <class T>
  [[nodiscard]] std::span<T> array(std::size_t count) noexcept {
    static_assert(std::is_default_constructible_v<T> && std::is_trivially_destructible_v<T>);
    if (count > PTRDIFF_MAX / sizeof(T)) {  // no object is larger
      failed_ = true;
      return {};
    }
    void* memory = take(count * sizeof(T));
    if (memory == nullptr) return {};
    T* first = static_cast<T*>(memory);
    std::uninitialized_value_construct_n(first, count);
    return {first, count};
  }

  /// A zeroed picture whose rows start on kAlignment and are followed by at least one vector of padding.
  template <class T>
  [[nodiscard]] ImageView<T> image(int width, int height) noexcept {
    if (width < 0 || height < 0) {
      failed_ = true;
      return {};
    }
    constexpr std::size_t kPerLine = kAlignment / sizeof(T) > 0 ? kAlignment / sizeof(T) : 1;
    const std::size_t stride = ((static_cast<std::size_t>(width) + kPerLine - 1) / kPerLine + 1) * kPerLine;
    std::span<T> pixels = array<T>(stride * static_cast<std::size_t>(height));
    if (pixels.empty()) return {};
    return {pixels.data(), width, height, static_cast<std::ptrdiff_t>(stride)};
  }

  void seal() noexcept { sealed_ = true; }
  [[nodiscard]] bool failed() const noexcept { return failed_; }
  [[nodiscard]] std::size_t bytes_used() const noexcept { return used_; }
  /// What was taken from the system for them, whole slabs.
  [[nodiscard]] std::size_t capacity() const noexcept { return capacity_; }

 private:
  /// At the start of each slab.
  struct Slab {
    Slab* next;
  };

  [[nodiscard]] void* take(std::size_t bytes) noexcept;

  Advice advice_;
  Slab* slabs_ = nullptr;
  char* free_ = nullptr;  ///< the largest rest of a slab
  std::size_t free_bytes_ = 0;
  std::size_t used_ = 0;
  std::size_t capacity_ = 0;
  bool sealed_ = false;
  bool failed_ = false;
};

}  // namespace stereotrack
