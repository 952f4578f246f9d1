#pragma once

#include <array>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <functional>
#include <initializer_list>
#include <limits>
#include <memory>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

namespace stereotrack::config {

/// A value on its way between TOML text and a member. Integers travel as double: exact to 2^53.
using Value = std::variant<bool, double, std::string, std::vector<std::string>, std::vector<double>>;

enum class Kind : unsigned char {
  kSwitch,
  kInteger,
  kNumber,
  kText,
  kChoice,
  kTextList,
  kNumberList,
  kPointList,  ///< as a Value: x and y in turns
  kTables,     ///< as a Value: how many there are; those that set() adds have their defaults
};

/// Says what is wrong with a text and the way out; empty if nothing is.
using TextCheck = std::string (*)(std::string_view);

/// One configuration key, bound to one member of one object. Made by the functions below, a line each.
/// `set` expects a value that refusal() lets pass.
struct Key {
  std::string name;  ///< dotted: the part before the last dot is the TOML table
  Kind kind = Kind::kSwitch;
  std::string doc;   ///< one sentence: what the value does to the result
  std::string unit;  ///< empty: none
  double min = 0;    ///< kInteger, kNumber, kNumberList, kPointList; kTables: of their number
  double max = 0;
  bool odd = false;                  ///< kInteger: even values are refused
  bool required = false;             ///< in a table of kTables: it has to be given
  std::size_t length = 0;            ///< kNumberList: exactly so many; kPointList: at most
  std::vector<std::string> choices;  ///< kChoice
  TextCheck check = nullptr;         ///< kText, and each element of kTextList
  std::function<Value()> get;
  std::function<void(const Value&)> set;
  /// kTables: the keys of table i, from 0, bound to it until set(). Their names begin with table_name().
  std::function<std::vector<Key>(std::size_t i)> keys;
  /// kTables: the keys of one that shows how it is written.
  std::function<std::vector<Key>()> example;
};

/// "signal[1]", the first of them. Its keys are signal[1].name and so on.
[[nodiscard]] std::string table_name(std::string_view tables, std::size_t i);

/// What is wrong with a value of the right type (range, choice, finiteness, length) and the way out;
/// empty if nothing is.
[[nodiscard]] std::string refusal(const Key& key, const Value& value);

/// What the key takes, for people: "a number such as 30.0".
[[nodiscard]] std::string expectation(const Key& key);

/// "0.1 to 1000 1/s", "one of ..."; empty where every value of the type is good.
[[nodiscard]] std::string range_text(const Key& key);

/// The key's present value as TOML. Reading it back gives the same bits.
[[nodiscard]] std::string value_text(const Key& key);

/// `text` as a TOML string on one line, in quotes, with what cannot be printed escaped.
[[nodiscard]] std::string quoted(std::string_view text);

namespace detail {

/// The double that prints like the float: 0.1F becomes 0.1, not 0.100000001490116.
[[nodiscard]] double widen(float value);
template <class T>
[[nodiscard]] double widen(T value) {
  return static_cast<double>(value);
}
[[nodiscard]] Key named(std::string_view name, Kind kind, std::string_view unit, std::string_view doc);

}  // namespace detail

/// A switch: true or false.
[[nodiscard]] Key key(std::string_view name, bool& member, std::string_view doc);

/// A text. `check` may be null.
[[nodiscard]] Key key(std::string_view name, std::string& member, TextCheck check, std::string_view doc);

/// One of some texts.
[[nodiscard]] Key key(std::string_view name, std::string& member, std::vector<std::string> choices,
                      std::string_view doc);

/// A list of texts. `check` may be null.
[[nodiscard]] Key key(std::string_view name, std::vector<std::string>& member, TextCheck check, std::string_view doc);

/// A number, min <= value <= max. An integer member takes integers only.
template <class T>
requires(std::is_arithmetic_v<T> && !std::same_as<T, bool>) [[nodiscard]] Key
    key(std::string_view name, T& member, double min, double max, std::string_view unit, std::string_view doc) {
  Key made = detail::named(name, std::integral<T> ? Kind::kInteger : Kind::kNumber, unit, doc);
  made.min = min;
  made.max = max;
  made.get = [&member] { return Value{detail::widen(member)}; };
  made.set = [&member](const Value& value) { member = static_cast<T>(std::get<double>(value)); };
  return made;
}

/// Exactly N numbers, each min <= value <= max.
template <class T, std::size_t N>
requires std::floating_point<T>
[[nodiscard]] Key key(std::string_view name, std::array<T, N>& member, double min, double max, std::string_view unit,
                      std::string_view doc) {
  Key made = detail::named(name, Kind::kNumberList, unit, doc);
  made.min = min;
  made.max = max;
  made.length = N;
  made.get = [&member] {
    std::vector<double> numbers;
    numbers.reserve(N);
    for (const T number : member) numbers.push_back(detail::widen(number));
    return Value{numbers};
  };
  made.set = [&member](const Value& value) {
    const auto& numbers = std::get<std::vector<double>>(value);
    for (std::size_t i = 0; i < N; ++i) member[i] = static_cast<T>(numbers[i]);
  };
  return made;
}

/// Points of a picture, at most `most`.
[[nodiscard]] Key key(std::string_view name, std::vector<std::array<double, 2>>& member, std::size_t most, double min,
                      double max, std::string_view unit, std::string_view doc);

/// A list of tables, [[name]] each, at most `most`. `keys` binds the keys of one, by their names in it.
template <class T>
[[nodiscard]] Key tables(std::string_view name, std::vector<T>& member, std::size_t most, std::vector<Key> (*keys)(T&),
                         const T& example, std::string_view doc) {
  Key made = detail::named(name, Kind::kTables, "", doc);
  made.max = static_cast<double>(most);
  made.get = [&member] { return Value{static_cast<double>(member.size())}; };
  made.set = [&member](const Value& value) { member.resize(static_cast<std::size_t>(std::get<double>(value))); };
  made.keys = [&member, keys, list = made.name](std::size_t i) {
    std::vector<Key> bound = keys(member[i]);
    for (Key& each : bound) each.name = table_name(list, i) + "." + each.name;
    return bound;
  };
  made.example = [keys, shown = std::make_shared<T>(example)] { return keys(*shown); };
  return made;
}

/// The same key, which each table of its list has to give.
[[nodiscard]] Key required(Key key);

/// The same key, for windows that have a middle: takes odd integers only.
[[nodiscard]] Key odd(Key key);

/// An enumeration by its names. Every enumerator that the member can have must be listed.
template <class E>
requires std::is_enum_v<E>
[[nodiscard]] Key key(std::string_view name, E& member, std::initializer_list<std::pair<const char*, E>> names,
                      std::string_view doc) {
  Key made = detail::named(name, Kind::kChoice, "", doc);
  for (const auto& [text, value] : names) made.choices.emplace_back(text);
  const std::vector<std::pair<const char*, E>> table(names);
  made.get = [&member, table] {
    for (const auto& [text, value] : table) {
      if (value == member) return Value{std::string(text)};
    }
    return Value{std::string()};
  };
  made.set = [&member, table](const Value& chosen) {
    for (const auto& [text, value] : table) {
      if (std::get<std::string>(chosen) == text) member = value;
    }
  };
  return made;
}

}  // namespace stereotrack::config
