#pragma once

#include <cstdarg>
#include <cstdio>
#include <string>

namespace stereotrack {

/// What printf would print, of any length. Not for real-time threads: it takes from the heap.
[[nodiscard, gnu::format(printf, 1, 2)]] inline std::string formatted(const char* format, ...) {
  std::va_list values;
  va_start(values, format);
  std::va_list again;
  va_copy(again, values);
  const int size = std::vsnprintf(nullptr, 0, format, values);
  va_end(values);
  std::string text(size > 0 ? static_cast<std::size_t>(size) : 0, '\0');
  // The zero that ends it lies behind the last character, where a string has one anyway.
  if (size > 0) (void)std::vsnprintf(text.data(), text.size() + 1, format, again);
  va_end(again);
  return text;
}

}  // namespace stereotrack
