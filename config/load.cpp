#include "config/load.hpp"

#include <toml++/toml.h>
#include <algorithm>
#include <cerrno>
#include <cstdint>
#include <fstream>
#include <iterator>
#include <optional>
#include <sstream>
#include <system_error>
#include <utility>

#include "config/presets.hpp"
#include "config/rules.hpp"
#include "config/schema.hpp"

namespace stereotrack::config {
namespace {

constexpr std::size_t kMaxBytes = std::size_t{1} << 20;

struct Position {
  std::uint32_t line = 0;
  std::uint32_t column = 0;
  // NOLINTNEXTLINE(modernize-use-nullptr): clang-tidy 14 takes the 0 of the generated comparison for a pointer
  friend auto operator<=>(const Position&, const Position&) = default;
};

Position position_of(const toml::source_region& region) {
  return {static_cast<std::uint32_t>(region.begin.line), static_cast<std::uint32_t>(region.begin.column)};
}

/// Something wrong at a place of a layer.
struct Problem {
  Position position;
  std::string what;
};

/// Names as the user may type them, safe on one line.
std::string printable(std::string_view name) {
  const bool bare = std::all_of(name.begin(), name.end(), [](char letter) {
    return (letter >= 'a' && letter <= 'z') || (letter >= 'A' && letter <= 'Z') || (letter >= '0' && letter <= '9') ||
           letter == '_' || letter == '-' || letter == '.' || letter == '[' || letter == ']';
  });
  return bare && !name.empty() ? std::string(name) : quoted(name);
}

/// Edits (insert, delete, replace, exchange of neighbours) that make one of the other.
std::size_t edit_distance(std::string_view a, std::string_view b) {
  std::vector<std::vector<std::size_t>> cost(a.size() + 1, std::vector<std::size_t>(b.size() + 1));
  for (std::size_t i = 0; i <= a.size(); ++i) {
    for (std::size_t j = 0; j <= b.size(); ++j) {
      if (i == 0 || j == 0) {
        cost[i][j] = i + j;
        continue;
      }
      cost[i][j] = std::min({cost[i - 1][j] + 1, cost[i][j - 1] + 1, cost[i - 1][j - 1] + (a[i - 1] != b[j - 1])});
      if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1]) {
        cost[i][j] = std::min(cost[i][j], cost[i - 2][j - 2] + 1);
      }
    }
  }
  return cost[a.size()][b.size()];
}

/// The name nearest to what was written, and the way out. A right last part in a wrong section counts
/// as one edit: that is the commonest slip.
std::string way_out(std::string_view written, const std::vector<std::string>& names) {
  constexpr std::size_t kLongest = 64;  // an endless name costs no time
  const auto leaf = [](std::string_view name) { return name.substr(name.rfind('.') + 1); };
  const std::string* best = nullptr;
  std::size_t best_distance = std::max<std::size_t>(2, written.size() / 3) + 1;
  for (const std::string& name : names) {
    if (written.size() > kLongest) break;
    std::size_t distance = edit_distance(written, name);
    if (leaf(written) == leaf(name)) distance = std::min<std::size_t>(distance, 1);
    if (distance < best_distance) {
      best = &name;
      best_distance = distance;
    }
  }
  return best != nullptr ? "did you mean " + *best + "?" : "config/stereotrack.sample.toml lists all keys";
}

std::vector<std::string> names_of(std::span<const Key> keys) {
  std::vector<std::string> names;
  for (const Key& key : keys) names.push_back(key.name);
  return names;
}

const Key* find(std::span<const Key> keys, std::string_view name) {
  const auto found = std::find_if(keys.begin(), keys.end(), [&](const Key& key) { return key.name == name; });
  return found == keys.end() ? nullptr : &*found;
}

/// All tables that keys lie in: "a.b.c" gives "a" and "a.b".
std::vector<std::string> sections_of(std::span<const Key> keys) {
  std::vector<std::string> sections;
  for (const Key& key : keys) {
    for (std::size_t dot = key.name.find('.'); dot != std::string::npos; dot = key.name.find('.', dot + 1)) {
      const std::string section = key.name.substr(0, dot);
      if (std::find(sections.begin(), sections.end(), section) == sections.end()) sections.push_back(section);
    }
  }
  return sections;
}

std::string type_name(const toml::node& node) {
  switch (node.type()) {
    case toml::node_type::table: return "a table";
    case toml::node_type::array: return "a list";
    case toml::node_type::string: return "a text";
    case toml::node_type::integer: return "an integer";
    case toml::node_type::floating_point: return "a number with a point";
    case toml::node_type::boolean: return "true or false";
    default: return "a date or time";
  }
}

std::optional<double> number_of(const toml::node& node) {
  if (const auto* integer = node.as_integer()) return static_cast<double>(integer->get());
  if (const auto* number = node.as_floating_point()) return number->get();
  return std::nullopt;
}

template <class Element, class Read>
std::optional<Value> list_of(const toml::node& node, const Read& read) {
  const toml::array* array = node.as_array();
  if (array == nullptr) return std::nullopt;
  std::vector<Element> elements;
  for (const toml::node& item : *array) {
    std::optional<Element> element = read(item);
    if (!element) return std::nullopt;
    elements.push_back(*element);
  }
  return Value{elements};
}

/// A list of lists of two numbers.
std::optional<Value> points_of(const toml::node& node) {
  const toml::array* array = node.as_array();
  if (array == nullptr) return std::nullopt;
  std::vector<double> numbers;
  for (const toml::node& item : *array) {
    const toml::array* point = item.as_array();
    if (point == nullptr || point->size() != 2) return std::nullopt;
    for (const toml::node& coordinate : *point) {
      const std::optional<double> number = number_of(coordinate);
      if (!number) return std::nullopt;
      numbers.push_back(*number);
    }
  }
  return Value{numbers};
}

/// The node's value if it has the key's type.
std::optional<Value> value_of(const Key& key, const toml::node& node) {
  const auto text_of = [](const toml::node& item) -> std::optional<std::string> {
    if (const auto* text = item.as_string()) return text->get();
    return std::nullopt;
  };
  switch (key.kind) {
    case Kind::kSwitch:
      if (const auto* on = node.as_boolean()) return Value{on->get()};
      return std::nullopt;
    case Kind::kInteger:
      if (node.is_integer()) return Value{*number_of(node)};
      return std::nullopt;
    case Kind::kNumber:
      if (const auto number = number_of(node)) return Value{*number};
      return std::nullopt;
    case Kind::kText:
    case Kind::kChoice:
      if (const auto text = text_of(node)) return Value{*text};
      return std::nullopt;
    case Kind::kTextList: return list_of<std::string>(node, text_of);
    case Kind::kNumberList: return list_of<double>(node, number_of);
    case Kind::kPointList: return points_of(node);
    case Kind::kTables: return std::nullopt;  // Walker's business
  }
  return std::nullopt;
}

/// What is wrong with the value of `key`, after it was set if nothing is.
std::string assign(const Key& key, const toml::node& node) {
  const std::optional<Value> value = value_of(key, node);
  if (!value) {
    const bool list = key.kind == Kind::kTextList || key.kind == Kind::kNumberList || key.kind == Kind::kPointList;
    return key.name + ": " + expectation(key) + " is expected, not " +
           (list && node.is_array() ? "another list" : type_name(node));
  }
  std::string wrong = refusal(key, *value);
  if (!wrong.empty()) return key.name + ": " + wrong;
  key.set(*value);
  return {};
}

/// Sets every key of a table, notes where, and collects what is wrong.
class Walker {
 public:
  Walker(std::string layer, std::span<const Key> keys, Origins& origins)
      : layer_(std::move(layer)), keys_(keys), sections_(sections_of(keys)), origins_(origins) {}

  void walk(const toml::table& table, const std::string& prefix) {
    for (const auto& [name, node] : table) {
      const std::string path = prefix + std::string(name.str());
      const Position at = position_of(name.source());
      if (name.str().find('.') != std::string_view::npos) {
        // "source.fps" in quotes is one name for TOML, not a key in a section.
        problems_.push_back({at, quoted(path) + ": unknown key: write dotted keys without quotes"});
        continue;
      }
      const bool section = std::find(sections_.begin(), sections_.end(), path) != sections_.end();
      const Key* key = find(keys_, path);
      if (key != nullptr && key->kind == Kind::kTables) {
        walk_tables(*key, node);
      } else if (key != nullptr) {
        const Position value_at = position_of(node.source());
        std::string wrong = assign(*key, node);
        if (!wrong.empty()) problems_.push_back({value_at, std::move(wrong)});
        origins_.insert_or_assign(path, place(value_at));
      } else if (section && node.is_table()) {
        walk(*node.as_table(), path + ".");
      } else if (section) {
        problems_.push_back({at, path + ": a section of keys is expected, not " + type_name(node) + ": write [" + path +
                                     "] and its keys below"});
      } else if (node.is_table()) {
        problems_.push_back({at, printable(path) + ": unknown section: " + way_out(path, sections_)});
      } else {
        problems_.push_back({at, printable(path) + ": unknown key: " + way_out(path, names_of(keys_))});
      }
    }
  }

  /// Throws for the first problem of the text; the table itself is sorted by name.
  void finish() const {
    const auto first = std::min_element(problems_.begin(), problems_.end(),
                                        [](const Problem& a, const Problem& b) { return a.position < b.position; });
    if (first != problems_.end()) throw Error(place(first->position) + ": " + first->what);
  }

 private:
  /// The list of this layer in place of that of the layers before.
  void walk_tables(const Key& list, const toml::node& node) {
    std::erase_if(origins_, [&](const auto& origin) { return origin.first.starts_with(list.name + "["); });
    origins_.insert_or_assign(list.name, place(position_of(node.source())));
    list.set(Value{0.0});
    const toml::array* tables = node.as_array();
    const bool good = tables != nullptr && std::all_of(tables->begin(), tables->end(),
                                                       [](const toml::node& item) { return item.is_table(); });
    if (!good) {
      problems_.push_back({position_of(node.source()), list.name + ": " + expectation(list) + " is expected, not " +
                                                           (tables != nullptr ? "another list" : type_name(node))});
      return;
    }
    for (std::size_t i = 0; i < tables->size(); ++i) {
      const toml::node& item = *tables->get(i);
      const Position at = position_of(item.source());
      const Value count{static_cast<double>(i + 1)};
      std::string wrong = refusal(list, count);
      if (!wrong.empty()) {
        problems_.push_back({at, list.name + ": " + std::move(wrong)});
        return;
      }
      list.set(count);
      const std::string name = table_name(list.name, i);
      origins_.insert_or_assign(name, place(at));
      const std::vector<Key> keys = list.keys(i);
      Walker inner(layer_, keys, origins_);
      inner.walk(*item.as_table(), name + ".");
      for (const Key& key : keys) {
        if (!key.required || origins_.contains(key.name)) continue;
        inner.problems_.push_back({at, key.name + ": it is missing: give " + expectation(key)});
      }
      problems_.insert(problems_.end(), inner.problems_.begin(), inner.problems_.end());
    }
  }

  [[nodiscard]] std::string place(Position at) const {
    return layer_ + ":" + std::to_string(at.line) + ":" + std::to_string(at.column);
  }

  std::string layer_;
  std::span<const Key> keys_;
  std::vector<std::string> sections_;
  Origins& origins_;
  std::vector<Problem> problems_;
};

toml::table parse(const Layer& layer) {
  try {
    return toml::parse(std::string_view(layer.text));
  } catch (const toml::parse_error& error) {
    const Position at = position_of(error.source());
    throw Error(layer.name + ":" + std::to_string(at.line) + ":" + std::to_string(at.column) + ": not valid TOML: " +
                std::string(error.description()) + ": write KEY = VALUE, texts in quotes, each key once");
  }
}

/// KEY and VALUE of an override, without blanks around them.
std::pair<std::string, std::string> split(const Layer& layer) {
  const std::size_t equals = layer.text.find('=');
  const auto trimmed = [](std::string_view text) {
    const std::size_t first = text.find_first_not_of(" \t");
    if (first == std::string_view::npos) return std::string();
    return std::string(text.substr(first, text.find_last_not_of(" \t") - first + 1));
  };
  std::pair<std::string, std::string> parts;
  parts.first = trimmed(std::string_view(layer.text).substr(0, equals));
  if (equals == std::string::npos || parts.first.empty()) {
    throw Error("--set " + printable(layer.text) + ": no KEY=VALUE: write it like --set source.fps=25");
  }
  parts.second = trimmed(std::string_view(layer.text).substr(equals + 1));
  return parts;
}

/// `text` as a value of TOML; nothing if it is none.
std::optional<toml::table> parse_value(const std::string& text) {
  if (text.find_first_of("\n\r") != std::string::npos) return std::nullopt;  // it would be more than one line
  try {
    return toml::parse("value = " + text);
  } catch (const toml::parse_error&) {
    return std::nullopt;
  }
}

/// The override's value for a key: TOML, or for texts and lists of texts the bare words.
std::optional<toml::table> override_value(const Key& key, const std::string& text) {
  const bool takes_text = key.kind == Kind::kText || key.kind == Kind::kChoice;
  if (takes_text && !text.starts_with('"') && !text.starts_with('\'')) {
    return toml::table{{"value", text}};
  }
  if (key.kind == Kind::kTextList && !text.starts_with('[')) {
    toml::array words;
    std::istringstream stream(text);
    for (std::string word; std::getline(stream, word, ',');) words.push_back(word);
    return toml::table{{"value", words}};
  }
  return parse_value(text);
}

void apply_override(const Layer& layer, std::span<const Key> keys, Origins& origins) {
  const auto [name, text] = split(layer);
  const std::string place = "--set " + name + "=" + (text.empty() ? "" : printable(text));
  const Key* key = find(keys, name);
  const Key* list = find(keys, name.substr(0, name.find_first_of(".[")));
  if (list != nullptr && list->kind == Kind::kTables) {
    throw Error("--set " + printable(name) + ": " + list->name + " is a list of tables: write [[" + list->name +
                "]] into a file and give it to --config");
  }
  if (key == nullptr) {
    const std::vector<std::string> sections = sections_of(keys);
    if (std::find(sections.begin(), sections.end(), name) != sections.end()) {
      throw Error("--set " + name + ": it is a section, not a key: write --set " + name + ".KEY=VALUE");
    }
    throw Error("--set " + printable(name) + ": unknown key: " + way_out(name, names_of(keys)));
  }
  const std::optional<toml::table> parsed = override_value(*key, text);
  const toml::node* value = parsed ? parsed->get("value") : nullptr;
  if (value == nullptr) throw Error(place + ": " + name + ": " + expectation(*key) + " is expected");
  const std::string wrong = assign(*key, *value);
  if (!wrong.empty()) throw Error(place + ": " + wrong);
  origins.insert_or_assign(name, place);
}

/// The preset that the layers ask for. The layers go onto a throw-away configuration for that, so what is
/// wrong in them is told before anything else.
std::string chosen_preset(std::span<const Layer> layers) {
  Configuration asked;
  const std::vector<Key> keys = keys_of(asked);
  Origins origins;
  for (const Layer& layer : layers) apply(layer, keys, origins);
  return asked.preset;
}

}  // namespace

Layer file_layer(const std::string& path) {
  const std::string way = ": give --config a readable TOML file";
  errno = 0;
  std::ifstream file(path, std::ios::binary);
  std::string text;
  if (file) {
    text.resize(kMaxBytes + 1);
    file.read(text.data(), static_cast<std::streamsize>(text.size()));
    text.resize(static_cast<std::size_t>(std::max<std::streamsize>(file.gcount(), 0)));
  }
  // The end of the file sets failbit, so only these tell a file that could not be opened or read.
  if (!file.is_open() || file.bad() || (!file.eof() && text.size() <= kMaxBytes)) {
    const std::string reason = errno != 0 ? std::generic_category().message(errno) : "cannot be read";
    throw Error(path + ": " + reason + way);
  }
  if (text.size() > kMaxBytes) throw Error(path + ": over 1 MiB, not a configuration" + way);
  return text_layer(path, std::move(text));
}

Layer text_layer(std::string name, std::string toml) { return {Layer::Form::kToml, std::move(name), std::move(toml)}; }

Layer override_layer(std::string key_and_value) { return {Layer::Form::kOverride, {}, std::move(key_and_value)}; }

Error error_at(const Origins& origins, std::string_view key, std::string_view what) {
  const auto origin = origins.find(key);
  const std::string place = origin == origins.end() ? "default" : origin->second;
  return Error(place + ": " + std::string(key) + ": " + std::string(what));
}

void apply(const Layer& layer, std::span<const Key> keys, Origins& origins) {
  if (layer.form == Layer::Form::kOverride) {
    apply_override(layer, keys, origins);
    return;
  }
  const toml::table table = parse(layer);
  Walker walker(layer.name, keys, origins);
  walker.walk(table, "");
  walker.finish();
}

Loaded load(std::span<const Layer> layers) {
  const std::string preset = chosen_preset(layers);
  Loaded loaded;
  const std::vector<Key> keys = keys_of(loaded.configuration);
  for (const Preset& candidate : presets()) {
    if (candidate.name != preset) continue;
    const std::string name(candidate.name);
    apply(text_layer("config/presets/" + name + ".toml", std::string(candidate.text)), keys, loaded.origins);
  }
  loaded.configuration.preset = preset;
  for (const Layer& layer : layers) apply(layer, keys, loaded.origins);
  check_rules(loaded);
  return loaded;
}

}  // namespace stereotrack::config
