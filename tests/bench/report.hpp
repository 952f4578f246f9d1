#pragma once

#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "tests/bench/harness.hpp"

namespace stereotrack::bench {

/// One side of an entry.
struct Side {
  Times ms;
  Times wall_ms;
  double allocations = 0;              ///< heap calls a call
  std::optional<double> instructions;  ///< a call
  std::optional<int> targets;          ///< confirmed and seen in the last frame: that both do the work
};

/// A stage that both sides have, or one side alone.
struct StageRow {
  std::string name;
  std::optional<Times> ours;
  std::optional<Times> theirs;
};

/// Ours against theirs, measured in turns.
struct Entry {
  std::string name;
  std::string what;
  std::optional<double> target;  ///< of the ratio
  Side ours;
  Side theirs;
  double bytes = 0;  ///< that any program must read and write for it, each once
  std::vector<StageRow> stages;
  std::vector<StageRow> calls;  ///< theirs, finer

  [[nodiscard]] double ratio() const noexcept { return theirs.ms.p50 / ours.ms.p50; }
};

/// How ours grows.
struct Scaling {
  std::string name;
  std::string what;
  std::string unit;
  std::vector<std::pair<std::string, double>> values;
  double limit = 0;  ///< of dearest over cheapest

  [[nodiscard]] double growth() const;
};

struct Report {
  bool quick = false;
  int frames = 0;   ///< timed
  int warm_up = 0;  ///< before them
  double copy_gb_s = 0;
  std::string instructions_by;      ///< "perf_event_open", "callgrind"; empty: not counted
  std::string instructions_why;     ///< not counted, or on which SIMD target
  std::vector<std::string> checks;  ///< results of ours that equal the naive ones
  std::vector<Entry> entries;
  std::vector<Scaling> scalings;
};

/// build/bench.json. Throws std::runtime_error.
void write_json(const Report& report, const std::string& file);

/// Instructions by contestant from the dumps in `folder` that `valgrind --tool=callgrind` left there.
[[nodiscard]] std::map<std::string, double> read_callgrind(const std::string& folder);

/// Aligned Markdown. `for_page`: with date, machine and stages, as docs/PERFORMANCE.md wants it.
[[nodiscard]] std::string to_text(const Report& report, bool for_page);

}  // namespace stereotrack::bench
