#pragma once

#include <array>
#include <cstddef>
#include <span>

namespace stereotrack {

/// A list of at most `capacity` elements in memory that somebody else owns (usually the arena).
/// push() on a full list changes nothing and answers false: the caller counts what it dropped.
template <class T>
class BoundedVector {
 public:
  BoundedVector() noexcept = default;
  explicit BoundedVector(std::span<T> storage) noexcept : storage_(storage) {}

  [[nodiscard]] bool push(const T& value) noexcept {
    if (size_ == storage_.size()) return false;
    storage_[size_++] = value;
    return true;
  }
  void clear() noexcept { size_ = 0; }
  /// Shortens to `size` elements; never lengthens.
  void truncate(std::size_t size) noexcept {
    if (size < size_) size_ = size;
  }
  [[nodiscard]] std::size_t size() const noexcept { return size_; }
  [[nodiscard]] std::size_t capacity() const noexcept { return storage_.size(); }
  [[nodiscard]] bool empty() const noexcept { return size_ == 0; }
  [[nodiscard]] bool full() const noexcept { return size_ == storage_.size(); }
  [[nodiscard]] T& operator[](std::size_t i) noexcept { return storage_[i]; }
  [[nodiscard]] const T& operator[](std::size_t i) const noexcept { return storage_[i]; }
  [[nodiscard]] T* begin() noexcept { return storage_.data(); }
  [[nodiscard]] T* end() noexcept { return storage_.data() + size_; }
  [[nodiscard]] const T* begin() const noexcept { return storage_.data(); }
  [[nodiscard]] const T* end() const noexcept { return storage_.data() + size_; }
  [[nodiscard]] std::span<const T> view() const noexcept { return {storage_.data(), size_}; }

 private:
  std::span<T> storage_;
  std::size_t size_ = 0;
};

/// The same with its memory inside: a value that can be copied, for members of small structs.
template <class T, std::size_t N>
class FixedVector {
 public:
  [[nodiscard]] bool push(const T& value) noexcept {
    if (size_ == N) return false;
    storage_[size_++] = value;
    return true;
  }
  void clear() noexcept { size_ = 0; }
  [[nodiscard]] std::size_t size() const noexcept { return size_; }
  [[nodiscard]] static constexpr std::size_t capacity() noexcept { return N; }
  [[nodiscard]] bool empty() const noexcept { return size_ == 0; }
  [[nodiscard]] T& operator[](std::size_t i) noexcept { return storage_[i]; }
  [[nodiscard]] const T& operator[](std::size_t i) const noexcept { return storage_[i]; }
  [[nodiscard]] T* begin() noexcept { return storage_.data(); }
  [[nodiscard]] T* end() noexcept { return storage_.data() + size_; }
  [[nodiscard]] const T* begin() const noexcept { return storage_.data(); }
  [[nodiscard]] const T* end() const noexcept { return storage_.data() + size_; }
  [[nodiscard]] std::span<const T> view() const noexcept { return {storage_.data(), size_}; }

 private:
  std::array<T, N> storage_{};
  std::size_t size_ = 0;
};

}  // namespace stereotrack
