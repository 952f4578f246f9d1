#pragma once

#include <array>
#include <charconv>
#include <map>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>

namespace stereotrack::record {

/// Text of lines `key value value...`, numbers in the shortest form that reads back to the same bits.
class TextWriter {
 public:
  TextWriter& key(std::string_view name) {
    if (!text_.empty()) text_ += '\n';
    text_ += name;
    return *this;
  }
  TextWriter& word(std::string_view value) {
    text_ += ' ';
    text_ += value;
    return *this;
  }
  template <class T>
  TextWriter& number(T value) {
    std::array<char, 64> digits{};
    const auto end = std::to_chars(digits.data(), digits.data() + digits.size(), value);
    return word({digits.data(), static_cast<std::size_t>(end.ptr - digits.data())});
  }
  template <class T>
  TextWriter& numbers(std::span<const T> values) {
    for (const T value : values) number(value);
    return *this;
  }
  [[nodiscard]] std::string text() const { return text_ + '\n'; }

 private:
  std::string text_;
};

/// Reads it. What is asked for and not there, or no number, throws std::runtime_error with `name` and the key.
class TextReader {
 public:
  TextReader(std::string_view text, std::string name) : name_(std::move(name)) {
    while (!text.empty()) {
      const std::string_view line = text.substr(0, text.find('\n'));
      text.remove_prefix(line.size() == text.size() ? line.size() : line.size() + 1);
      const std::size_t space = line.find(' ');
      values_[std::string(line.substr(0, space))] = space == std::string_view::npos ? "" : line.substr(space + 1);
    }
  }

  [[nodiscard]] std::string word(const std::string& key) const {
    const auto found = values_.find(key);
    if (found == values_.end()) fail(key, "is missing");
    return found->second;
  }
  template <class T>
  void numbers(const std::string& key, std::span<T> out) const {
    const std::string value = word(key);
    const char* at = value.data();
    const char* end = at + value.size();
    for (T& number : out) {
      while (at != end && *at == ' ') ++at;
      const auto read = std::from_chars(at, end, number);
      if (read.ec != std::errc()) fail(key, "is not what it should be: '" + value + "'");
      at = read.ptr;
    }
    if (at != end) fail(key, "has too many values: '" + value + "'");
  }
  template <class T>
  [[nodiscard]] T number(const std::string& key) const {
    T value{};
    numbers(key, std::span<T>(&value, 1));
    return value;
  }
  [[noreturn]] void fail(const std::string& key, const std::string& what) const {
    throw std::runtime_error(name_ + ": '" + key + "' " + what + "; the recording is damaged or of another version");
  }

 private:
  std::string name_;
  std::map<std::string, std::string> values_;
};

}  // namespace stereotrack::record
