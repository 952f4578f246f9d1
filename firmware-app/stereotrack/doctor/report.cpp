#include "firmware-app/stereotrack/doctor/report.hpp"

#include <algorithm>
#include <string_view>

#include "firmware-app/formatted.hpp"
#include "firmware-app/stereotrack/doctor/words.hpp"

namespace stereotrack::doctor {

namespace {

constexpr std::size_t kColumns = kScreenColumns;
constexpr std::size_t kTextColumn = 20;    ///< after verdict and topic
constexpr std::size_t kMostTextLines = 4;  ///< of one item
constexpr std::string_view kArrow = "         -> ";

/// Broken between words. The first line begins with `head`, the others with as many blanks.
std::vector<std::string> wrapped(std::string_view head, const std::string& text) {
  std::vector<std::string> lines{std::string(head)};
  bool is_empty = true;
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t end = std::min(text.find(' ', at), text.size());
    std::string word = text.substr(at, end - at);
    at = end + 1;
    if (word.empty()) continue;
    if (!is_empty && lines.back().size() + 1 + word.size() > kColumns) {
      lines.emplace_back(head.size(), ' ');
      is_empty = true;
    }
    if (word.size() > kColumns - head.size()) word = word.substr(0, kColumns - head.size() - 3) + "...";
    if (!is_empty) lines.back() += ' ';
    lines.back() += word;
    is_empty = false;
  }
  if (lines.size() > kMostTextLines) {
    lines.resize(kMostTextLines);
    lines.back() = lines.back().substr(0, kColumns - 4) + " ...";
  }
  return lines;
}

std::string padded(std::string text, std::size_t columns) {
  text.resize(std::max(columns, text.size() + 1), ' ');
  return text;
}

std::vector<std::string> lines_of(const Item& item) {
  std::vector<std::string> lines =
      wrapped(padded(padded(to_string(item.verdict), 8) + item.topic, kTextColumn), item.text);
  const std::string both = joined({item.way_out, item.command}, ": ");
  if (both.empty()) return lines;
  if (item.command.empty() || kArrow.size() + both.size() <= kColumns) {
    for (std::string& line : wrapped(kArrow, both)) lines.push_back(std::move(line));
    return lines;
  }
  if (!item.way_out.empty()) {
    for (std::string& line : wrapped(kArrow, item.way_out + ":")) lines.push_back(std::move(line));
  }
  // As it is to be typed: never broken, and the arrow's column is all that stands before it.
  lines.push_back(std::string(item.way_out.empty() ? kArrow : std::string_view("            ")) + item.command);
  return lines;
}

std::vector<std::string> topics_of(const std::vector<Item>& items, Verdict verdict) {
  std::vector<std::string> topics;
  for (const Item& item : items) {
    if (item.verdict == verdict && std::find(topics.begin(), topics.end(), item.topic) == topics.end()) {
      topics.push_back(item.topic);
    }
  }
  return topics;
}

std::vector<std::string> head_of(const Findings& f) {
  std::string text = joined({f.host, f.kernel.board}, ", ") + ", user " + f.limits.user + "; " +
                     (f.config.empty() ? "no configuration: the cameras that there are" : f.config);
  text += f.seconds > 0 ? formatted("; %g s each", f.seconds) : "; nothing measured";
  return wrapped(f.program + " doctor: ", text);
}

std::vector<std::string> end_of(const std::vector<Item>& items) {
  const Verdict worst = worst_of(items);
  const std::string topics = joined(topics_of(items, worst), ", ");
  switch (worst) {
    case Verdict::kOk: return {"ready (exit code 0)"};
    case Verdict::kNote: return wrapped("works with limits (exit code 1): ", topics);
    case Verdict::kProblem: break;
  }
  return wrapped("cannot run (exit code 2): ", topics);
}

}  // namespace

std::string report(const Findings& findings, const std::vector<Item>& items) {
  const std::vector<std::string> head = head_of(findings);
  const std::vector<std::string> end = end_of(items);
  const std::size_t room = kScreenLines - head.size() - end.size();

  std::vector<std::vector<std::string>> blocks;
  std::vector<Verdict> verdicts;
  std::size_t lines = 0;
  for (const Item& item : items) {
    blocks.push_back(lines_of(item));
    verdicts.push_back(item.verdict);
    lines += blocks.back().size();
  }
  // What is fine goes first, facts before what was measured, which stands at the end; then limits, from the end.
  std::size_t left_out = 0;
  for (const Verdict least : {Verdict::kOk, Verdict::kNote, Verdict::kProblem}) {
    for (std::size_t n = 0; n < blocks.size() && lines + (left_out > 0 ? 1 : 0) > room; ++n) {
      const std::size_t i = least == Verdict::kOk ? n : blocks.size() - 1 - n;
      if (verdicts[i] != least) continue;
      lines -= blocks[i].size();
      blocks[i].clear();
      ++left_out;
    }
  }

  std::string text;
  const auto add = [&text](const std::vector<std::string>& some) {
    for (const std::string& line : some) text += line + '\n';
  };
  add(head);
  for (const auto& block : blocks) add(block);
  if (left_out > 0)
    text += formatted("... and %zu more, for which there is no room: stereotrack doctor --json\n", left_out);
  add(end);
  return text;
}

}  // namespace stereotrack::doctor
