#include "firmware-app/evaluation/report.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <ostream>
#include <string>
#include <string_view>
#include <vector>

namespace stereotrack::evaluation {
namespace {

struct Cell {
  std::string heading;
  std::string value;
};

// Streams and printf follow the locale, which may write a decimal comma.
std::string fixed(double value, int digits) {
  std::array<char, 400> text{};  // the largest double has 309 digits before the point
  const auto end = std::to_chars(text.begin(), text.end(), value, std::chars_format::fixed, digits).ptr;
  return {text.begin(), end};
}

std::string percent(double rate) { return fixed(100 * rate, 1) + " %"; }

std::string shortest(double value) {
  std::array<char, 32> text{};
  const auto end = std::to_chars(text.begin(), text.end(), value).ptr;
  return {text.begin(), end};
}

void write_group(const std::string& title, const std::vector<Cell>& cells, std::ostream& out) {
  constexpr std::size_t kTitleWidth = 10;
  constexpr std::size_t kGap = 2;
  constexpr std::size_t kLeastWidth = 7;
  std::string headings = title + std::string(kTitleWidth - title.size(), ' ');
  std::string values(kTitleWidth, ' ');
  for (const Cell& cell : cells) {
    const std::size_t width = kGap + std::max({cell.heading.size(), cell.value.size(), kLeastWidth});
    headings += std::string(width - cell.heading.size(), ' ') + cell.heading;
    values += std::string(width - cell.value.size(), ' ') + cell.value;
  }
  out << headings << '\n' << values << '\n';
}

}  // namespace

void write_table(const Scores& s, std::ostream& out) {
  const auto count = [](std::size_t n) { return std::to_string(n); };
  const auto known = [](std::size_t pairs, const std::string& value) { return pairs > 0 ? value : std::string("-"); };
  const PositionError& p = s.position;
  write_group("data",
              {{"frames", count(s.frames)},
               {"objects", count(s.truth_ids)},
               {"boxes", count(s.truth_boxes)},
               {"ignored", count(s.ignored_boxes)},
               {"tracks", count(s.track_ids)},
               {"boxes", count(s.track_boxes)},
               {"dropped", count(s.dropped_boxes)}},
              out);
  write_group("HOTA",
              {{"HOTA", percent(s.hota)},
               {"DetA", percent(s.det_a)},
               {"AssA", percent(s.ass_a)},
               {"LocA", percent(s.loc_a)},
               {"DetRe", percent(s.det_re)},
               {"DetPr", percent(s.det_pr)},
               {"AssRe", percent(s.ass_re)},
               {"AssPr", percent(s.ass_pr)}},
              out);
  write_group("CLEAR",
              {{"MOTA", percent(s.mota)},
               {"MOTP", percent(s.motp)},
               {"recall", percent(s.recall)},
               {"precision", percent(s.precision)},
               {"FP", count(s.false_positives)},
               {"FN", count(s.false_negatives)},
               {"IDSW", count(s.identity_switches)},
               {"Frag", count(s.fragmentations)}},
              out);
  write_group("identity",
              {{"IDF1", percent(s.idf1)},
               {"IDP", percent(s.idp)},
               {"IDR", percent(s.idr)},
               {"MT", count(s.mostly_tracked)},
               {"PT", count(s.partly_tracked)},
               {"ML", count(s.mostly_lost)}},
              out);
  write_group("3-D error",
              {{"median", known(p.pairs, fixed(p.median, 4))},
               {"95 %", known(p.pairs, fixed(p.p95, 4))},
               {"median/z", known(p.relative_pairs, percent(p.relative_median))},
               {"95 %/z", known(p.relative_pairs, percent(p.relative_p95))},
               {"pairs", count(p.pairs)},
               {"no x y z", count(p.missing)},
               {"/(1/4 px)", known(p.geometry_pairs, fixed(p.geometry_median, 2))}},
              out);
  write_group("velocity",
              {{"median", known(s.velocity.pairs, percent(s.velocity.median))},
               {"95 %", known(s.velocity.pairs, percent(s.velocity.p95))},
               {"pairs", count(s.velocity.pairs)}},
              out);
  write_group("false", {{"tracks", count(s.false_tracks)}, {"a minute", fixed(s.false_tracks_a_minute, 2)}}, out);
}

void write_json(const Scores& s, std::ostream& out) {
  std::string text;
  const auto put = [&text](std::string_view key, const std::string& value) {
    text += text.empty() ? "{\n  \"" : ",\n  \"";
    text += key;
    text += "\": " + value;
  };
  const auto count = [&put](std::string_view key, std::size_t value) { put(key, std::to_string(value)); };
  const auto real = [&put](std::string_view key, double value) { put(key, shortest(value)); };
  const auto real_if = [&put](std::size_t pairs, std::string_view key, double value) {
    put(key, pairs > 0 ? shortest(value) : "null");
  };
  count("frames", s.frames);
  count("truth_boxes", s.truth_boxes);
  count("truth_ids", s.truth_ids);
  count("ignored_boxes", s.ignored_boxes);
  count("track_boxes", s.track_boxes);
  count("track_ids", s.track_ids);
  count("dropped_boxes", s.dropped_boxes);
  real("hota", s.hota);
  real("det_a", s.det_a);
  real("ass_a", s.ass_a);
  real("loc_a", s.loc_a);
  real("det_re", s.det_re);
  real("det_pr", s.det_pr);
  real("ass_re", s.ass_re);
  real("ass_pr", s.ass_pr);
  real("mota", s.mota);
  real_if(s.true_positives, "motp", s.motp);
  real("recall", s.recall);
  real("precision", s.precision);
  count("true_positives", s.true_positives);
  count("false_positives", s.false_positives);
  count("false_negatives", s.false_negatives);
  count("identity_switches", s.identity_switches);
  count("fragmentations", s.fragmentations);
  count("mostly_tracked", s.mostly_tracked);
  count("partly_tracked", s.partly_tracked);
  count("mostly_lost", s.mostly_lost);
  real("idf1", s.idf1);
  real("idp", s.idp);
  real("idr", s.idr);
  count("id_true_positives", s.id_true_positives);
  count("id_false_positives", s.id_false_positives);
  count("id_false_negatives", s.id_false_negatives);
  const PositionError& p = s.position;
  count("position_pairs", p.pairs);
  count("position_missing", p.missing);
  real_if(p.pairs, "position_median", p.median);
  real_if(p.pairs, "position_p95", p.p95);
  count("position_relative_pairs", p.relative_pairs);
  real_if(p.relative_pairs, "position_relative_median", p.relative_median);
  real_if(p.relative_pairs, "position_relative_p95", p.relative_p95);
  real_if(p.geometry_pairs, "position_geometry_median", p.geometry_median);
  count("velocity_pairs", s.velocity.pairs);
  real_if(s.velocity.pairs, "velocity_median", s.velocity.median);
  real_if(s.velocity.pairs, "velocity_p95", s.velocity.p95);
  count("false_tracks", s.false_tracks);
  real("false_tracks_a_minute", s.false_tracks_a_minute);
  out << text << "\n}\n";
}

}  // namespace stereotrack::evaluation
