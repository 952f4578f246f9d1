#include "config/key.hpp"

#include <algorithm>
#include <charconv>
#include <cstdio>

namespace stereotrack::config {
namespace {

/// Shortest decimal that reads back as the same bits, whatever the locale.
template <class T>
std::string shortest(T value) {
  std::array<char, 64> buffer{};
  const auto end = std::to_chars(buffer.data(), buffer.data() + buffer.size(), value).ptr;
  return {buffer.data(), end};
}

/// As TOML: a float carries a point or an exponent, an integer neither.
std::string number_text(double value, bool integer) {
  if (integer) return shortest(static_cast<long long>(value));
  std::string text = shortest(value);
  if (text.find_first_of(".en") == std::string::npos) text += ".0";
  return text;
}

std::string number_refusal(const Key& key, double value) {
  if (!std::isfinite(value)) return shortest(value) + " is not finite: give " + range_text(key);
  if (value < key.min || value > key.max) return shortest(value) + " is out of range: give " + range_text(key);
  if (key.odd && std::fmod(value, 2) == 0) return shortest(value) + " is even: give " + range_text(key);
  return {};
}

std::string choice_list(const Key& key) {
  std::string list;
  for (const std::string& choice : key.choices) list += (list.empty() ? "" : ", ") + quoted(choice);
  return list;
}

}  // namespace

namespace detail {

double widen(float value) {
  const std::string text = shortest(value);
  double wide = 0;
  std::from_chars(text.data(), text.data() + text.size(), wide);
  return wide;
}

Key named(std::string_view name, Kind kind, std::string_view unit, std::string_view doc) {
  Key made;
  made.name = name;
  made.kind = kind;
  made.unit = unit;
  made.doc = doc;
  return made;
}

}  // namespace detail

Key key(std::string_view name, bool& member, std::string_view doc) {
  Key made = detail::named(name, Kind::kSwitch, "", doc);
  made.get = [&member] { return Value{member}; };
  made.set = [&member](const Value& value) { member = std::get<bool>(value); };
  return made;
}

Key key(std::string_view name, std::string& member, TextCheck check, std::string_view doc) {
  Key made = detail::named(name, Kind::kText, "", doc);
  made.check = check;
  made.get = [&member] { return Value{member}; };
  made.set = [&member](const Value& value) { member = std::get<std::string>(value); };
  return made;
}

Key key(std::string_view name, std::string& member, std::vector<std::string> choices, std::string_view doc) {
  Key made = key(name, member, TextCheck{nullptr}, doc);
  made.kind = Kind::kChoice;
  made.choices = std::move(choices);
  return made;
}

Key key(std::string_view name, std::vector<std::string>& member, TextCheck check, std::string_view doc) {
  Key made = detail::named(name, Kind::kTextList, "", doc);
  made.check = check;
  made.get = [&member] { return Value{member}; };
  made.set = [&member](const Value& value) { member = std::get<std::vector<std::string>>(value); };
  return made;
}

Key key(std::string_view name, std::vector<std::array<double, 2>>& member, std::size_t most, double min, double max,
        std::string_view unit, std::string_view doc) {
  Key made = detail::named(name, Kind::kPointList, unit, doc);
  made.min = min;
  made.max = max;
  made.length = most;
  made.get = [&member] {
    std::vector<double> numbers;
    for (const auto& point : member) numbers.insert(numbers.end(), point.begin(), point.end());
    return Value{numbers};
  };
  made.set = [&member](const Value& value) {
    const auto& numbers = std::get<std::vector<double>>(value);
    member.clear();
    for (std::size_t i = 0; i + 1 < numbers.size(); i += 2) member.push_back({numbers[i], numbers[i + 1]});
  };
  return made;
}

Key required(Key key) {
  key.required = true;
  return key;
}

std::string table_name(std::string_view tables, std::size_t i) {
  return std::string(tables).append("[").append(std::to_string(i + 1)).append("]");
}

Key odd(Key key) {
  key.odd = true;
  return key;
}

std::string refusal(const Key& key, const Value& value) {
  switch (key.kind) {
    case Kind::kSwitch: return {};
    case Kind::kInteger:
    case Kind::kNumber: return number_refusal(key, std::get<double>(value));
    case Kind::kText: return key.check == nullptr ? std::string() : key.check(std::get<std::string>(value));
    case Kind::kChoice: {
      const auto& chosen = std::get<std::string>(value);
      if (std::find(key.choices.begin(), key.choices.end(), chosen) != key.choices.end()) return {};
      return quoted(chosen) + " is not known: give " + range_text(key);
    }
    case Kind::kTextList:
      for (const std::string& text : std::get<std::vector<std::string>>(value)) {
        std::string wrong = key.check == nullptr ? std::string() : key.check(text);
        if (!wrong.empty()) return wrong;
      }
      return {};
    case Kind::kTables: {
      if (std::get<double>(value) <= key.max) return {};
      return "there may be " + number_text(key.max, true) + ": leave one out";
    }
    case Kind::kNumberList:
    case Kind::kPointList: {
      const auto& numbers = std::get<std::vector<double>>(value);
      if (key.kind == Kind::kNumberList && numbers.size() != key.length) {
        return std::to_string(numbers.size()) + " numbers given: give " + std::to_string(key.length);
      }
      if (key.kind == Kind::kPointList && numbers.size() > 2 * key.length) {
        return std::to_string(numbers.size() / 2) + " points given: give at most " + std::to_string(key.length);
      }
      for (const double number : numbers) {
        std::string wrong = number_refusal(key, number);
        if (!wrong.empty()) return wrong;
      }
      return {};
    }
  }
  return {};
}

std::string expectation(const Key& key) {
  switch (key.kind) {
    case Kind::kSwitch: return "true or false";
    case Kind::kInteger: return "an integer such as " + value_text(key);
    case Kind::kNumber: return "a number such as " + value_text(key);
    case Kind::kText: return "a text in quotes";
    case Kind::kChoice: return "one of " + choice_list(key);
    case Kind::kTextList: return "a list of texts such as [\"a\", \"b\"]";
    case Kind::kNumberList: return "a list of " + std::to_string(key.length) + " numbers such as " + value_text(key);
    case Kind::kPointList: return "a list of points such as [[0, 0], [100, 0], [100, 480]]";
    case Kind::kTables: return "a list of tables, [[" + key.name + "]] and its keys below each,";
  }
  return {};
}

std::string range_text(const Key& key) {
  switch (key.kind) {
    case Kind::kInteger:
    case Kind::kNumber:
    case Kind::kNumberList:
    case Kind::kPointList: {
      const bool integer = key.kind == Kind::kInteger;
      const auto bound = [integer](double value) {
        return integer || value == std::floor(value) ? number_text(value, true) : shortest(value);
      };
      return bound(key.min) + " to " + bound(key.max) + (key.unit.empty() ? "" : " " + key.unit) +
             (key.odd ? ", odd" : "");
    }
    case Kind::kChoice: return "one of " + choice_list(key);
    case Kind::kSwitch:
    case Kind::kText:
    case Kind::kTextList:
    case Kind::kTables: return {};
  }
  return {};
}

namespace {

/// All on one line.
std::string tables_text(const Key& key, std::size_t count) {
  std::string all;
  for (std::size_t i = 0; i < count; ++i) {
    std::string table;
    for (const Key& each : key.keys(i)) {
      table += (table.empty() ? "" : ", ") + each.name.substr(each.name.rfind('.') + 1) + " = " + value_text(each);
    }
    all += (i == 0 ? "{" : ", {") + table + "}";
  }
  return "[" + all + "]";
}

std::string points_text(const std::vector<double>& numbers) {
  std::string all;
  for (std::size_t i = 0; i + 1 < numbers.size(); i += 2) {
    all += (i == 0 ? "[" : ", [") + number_text(numbers[i], false) + ", " + number_text(numbers[i + 1], false) + "]";
  }
  return "[" + all + "]";
}

}  // namespace

std::string value_text(const Key& key) {
  const Value value = key.get();
  const auto list = [](const auto& items, const auto& text) {
    std::string all;
    for (const auto& item : items) all += (all.empty() ? "" : ", ") + text(item);
    return "[" + all + "]";
  };
  switch (key.kind) {
    case Kind::kSwitch: return std::get<bool>(value) ? "true" : "false";
    case Kind::kInteger: return number_text(std::get<double>(value), true);
    case Kind::kNumber: return number_text(std::get<double>(value), false);
    case Kind::kText:
    case Kind::kChoice: return quoted(std::get<std::string>(value));
    case Kind::kTextList: return list(std::get<std::vector<std::string>>(value), quoted);
    case Kind::kNumberList:
      return list(std::get<std::vector<double>>(value), [](double number) { return number_text(number, false); });
    case Kind::kPointList: return points_text(std::get<std::vector<double>>(value));
    case Kind::kTables: return tables_text(key, static_cast<std::size_t>(std::get<double>(value)));
  }
  return {};
}

std::string quoted(std::string_view text) {
  std::string out = "\"";
  for (const char letter : text) {
    const auto code = static_cast<unsigned char>(letter);
    if (letter == '"' || letter == '\\') {
      out += '\\';
      out += letter;
    } else if (code < 0x20 || code == 0x7F) {
      std::array<char, 8> escape{};
      std::snprintf(escape.data(), escape.size(), "\\u%04X", code);
      out += escape.data();
    } else {
      out += letter;
    }
  }
  return out + "\"";
}

}  // namespace stereotrack::config
