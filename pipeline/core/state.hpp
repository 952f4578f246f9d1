#pragma once

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <optional>
#include <span>
#include <type_traits>

#include "pipeline/core/bounded_vector.hpp"
#include "pipeline/core/image_view.hpp"

namespace stereotrack {

/// State that crosses frames, as bytes. A stage that keeps some from one frame to the next names it once, for all
/// directions:
///
///     template <class Self, class Archive>
///     static void visit_state(Self& self, Archive& archive) noexcept {
///       archive(self.started_, self.mean_);
///       archive.bounded(self.next_row_, 0, self.map_.height - 1);
///     }
///
/// Self is const where it is written. What is made anew in each frame before it is read, and what create() makes of
/// the configuration, is no state. tests/unit/pipeline/state_test.cpp finds what was forgotten.
///
/// Bytes: each field as it lies in memory, little-endian, one after the other without padding; bool as a byte; a
/// picture row by row without what lies between; a list as its length (4 bytes) and its elements; an optional as what
/// it holds, if anything: what exists is the configuration's business. Equal states give equal bytes. No heap, no
/// exception; O(bytes).
template <class Archive>
class StateFields {
 public:
  template <class... Field>
  void operator()(Field&... fields) noexcept {
    (field(fields), ...);
  }

  /// A number that must lie within [low, high]; the reader takes the nearest that does.
  template <class T>
  void bounded(T& value, std::type_identity_t<std::remove_const_t<T>> low,
               std::type_identity_t<std::remove_const_t<T>> high) noexcept {
    field(value);
    if constexpr (!std::is_const_v<T>) value = std::clamp(value, low, high);
  }

 private:
  [[nodiscard]] Archive& self() noexcept { return static_cast<Archive&>(*this); }

  template <class T>
  void field(T& value) noexcept {
    using Plain = std::remove_const_t<T>;
    if constexpr (requires { Plain::visit_state(value, self()); }) {
      Plain::visit_state(value, self());
    } else if constexpr (std::is_arithmetic_v<Plain> || std::is_enum_v<Plain>) {
      self().numbers(&value, 1);
    } else if constexpr (requires { typename Plain::Scalar; }) {  // a matrix of fixed size
      self().numbers(value.data(), static_cast<std::size_t>(value.size()));
    } else {
      parts(value);
    }
  }

  template <class U>
  void parts(const ImageView<U>& picture) noexcept {
    self().rows(picture);
  }
  template <class U>
  void parts(const std::optional<U>& value) noexcept {
    if (value) field(*value);
  }
  template <class U>
  void parts(std::optional<U>& value) noexcept {
    if (value) field(*value);
  }
  template <class U, std::size_t N>
  void parts(const std::array<U, N>& values) noexcept {
    self().numbers(values.data(), N);
  }
  template <class U, std::size_t N>
  void parts(std::array<U, N>& values) noexcept {
    self().numbers(values.data(), N);
  }
  template <class U>
  void parts(const BoundedVector<U>& list) noexcept {
    self().list(list);
  }
  template <class U>
  void parts(BoundedVector<U>& list) noexcept {
    self().list(list);
  }
  template <class U, std::size_t N>
  void parts(const FixedVector<U, N>& list) noexcept {
    self().list(list);
  }
  template <class U, std::size_t N>
  void parts(FixedVector<U, N>& list) noexcept {
    self().list(list);
  }
  template <class Clock, class Duration>
  void parts(const std::chrono::time_point<Clock, Duration>& time) noexcept {
    const auto count = time.time_since_epoch().count();
    self().numbers(&count, 1);
  }
  template <class Clock, class Duration>
  void parts(std::chrono::time_point<Clock, Duration>& time) noexcept {
    auto count = time.time_since_epoch().count();
    self().numbers(&count, 1);
    time = std::chrono::time_point<Clock, Duration>(Duration(count));
  }
};

/// Writes the part of the state that lies in a window of its bytes, [first, first + out.size()), and counts all of it:
/// a state too large for one gap between frames is written window by window. What lies outside costs a comparison.
class StateWriter : public StateFields<StateWriter> {
 public:
  explicit StateWriter(std::span<std::byte> out, std::size_t first = 0) noexcept : out_(out), first_(first) {}

  /// Bytes of the state so far.
  [[nodiscard]] std::size_t position() const noexcept { return at_; }

  template <class T>
  void numbers(const T* from, std::size_t count) noexcept {
    const auto* bytes = reinterpret_cast<const std::byte*>(from);
    const std::size_t size = count * sizeof(T);
    const std::size_t begin = std::max(at_, first_);
    const std::size_t end = std::min(at_ + size, first_ + out_.size());
    if (begin < end) std::memcpy(out_.data() + (begin - first_), bytes + (begin - at_), end - begin);
    at_ += size;
  }
  template <class T>
  void rows(const ImageView<T>& picture) noexcept {
    if (picture.empty()) return;
    const std::size_t row = sizeof(T) * static_cast<std::size_t>(picture.width);
    const std::size_t size = row * static_cast<std::size_t>(picture.height);
    if (at_ + size <= first_ || at_ >= first_ + out_.size()) {
      at_ += size;
      return;
    }
    for (int y = 0; y < picture.height; ++y) numbers(picture.row(y), static_cast<std::size_t>(picture.width));
  }
  template <class List>
  void list(const List& list) noexcept {
    const auto size = static_cast<std::uint32_t>(list.size());
    numbers(&size, 1);
    for (const auto& element : list) (*this)(element);
  }

 private:
  std::span<std::byte> out_;
  std::size_t first_;
  std::size_t at_ = 0;
};

/// The bytes that a state can have at most: all lists full.
class StateSizer : public StateFields<StateSizer> {
 public:
  [[nodiscard]] std::size_t bytes() const noexcept { return bytes_; }

  template <class T>
  void numbers(const T* /*from*/, std::size_t count) noexcept {
    bytes_ += count * sizeof(T);
  }
  template <class T>
  void rows(const ImageView<T>& picture) noexcept {
    if (picture.empty()) return;
    bytes_ += sizeof(T) * static_cast<std::size_t>(picture.width) * static_cast<std::size_t>(picture.height);
  }
  /// The elements' own lists hold their capacity wherever they stand: one is measured for all.
  template <class List>
  void list(const List& list) noexcept {
    bytes_ += sizeof(std::uint32_t);
    const std::size_t before = bytes_;
    const std::remove_cvref_t<decltype(*list.begin())> element{};
    (*this)(element);
    bytes_ = before + (bytes_ - before) * list.capacity();
  }

 private:
  std::size_t bytes_ = 0;
};

/// Reads what StateWriter wrote. No value of a damaged state does harm: lengths and bounded() numbers are bounded, a
/// bool is one, a NaN or an infinity becomes 0, and what is missing keeps its value and failed() says so.
class StateReader : public StateFields<StateReader> {
 public:
  explicit StateReader(std::span<const std::byte> in) noexcept : in_(in) {}

  /// Bytes were missing, or a list was too long.
  [[nodiscard]] bool failed() const noexcept { return failed_; }
  [[nodiscard]] std::size_t position() const noexcept { return at_; }

  template <class T>
  void numbers(T* to, std::size_t count) noexcept {
    const std::size_t size = count * sizeof(T);
    if (failed_ || in_.size() - at_ < size) {
      failed_ = true;
      return;
    }
    if constexpr (std::is_same_v<T, bool>) {
      for (std::size_t i = 0; i < count; ++i) to[i] = in_[at_ + i] != std::byte{0};
    } else {
      std::memcpy(to, in_.data() + at_, size);
    }
    if constexpr (std::is_floating_point_v<T>) {
      for (std::size_t i = 0; i < count; ++i) to[i] = std::isfinite(to[i]) ? to[i] : T{0};
    }
    at_ += size;
  }
  template <class T>
  void rows(const ImageView<T>& picture) noexcept {
    for (int y = 0; y < picture.height; ++y) numbers(picture.row(y), static_cast<std::size_t>(picture.width));
  }
  template <class List>
  void list(List& list) noexcept {
    std::uint32_t size = 0;
    numbers(&size, 1);
    list.clear();
    if (size > list.capacity()) failed_ = true;
    for (std::uint32_t i = 0; i < size && !failed_; ++i) {
      std::remove_cvref_t<decltype(*list.begin())> element{};
      (*this)(element);
      (void)list.push(element);
    }
  }

 private:
  std::span<const std::byte> in_;
  std::size_t at_ = 0;
  bool failed_ = false;
};

}  // namespace stereotrack
