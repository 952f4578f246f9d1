#include "drivers/capture/replay/pairing.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdlib>
#include <limits>
#include <optional>
#include <stdexcept>

namespace stereotrack::capture {
namespace {

using std::chrono::nanoseconds;

constexpr std::int64_t kLongestNumbering = 100'000'000;

/// A view's files with the integer by which they find their partners, sorted by it.
struct Keyed {
  struct Item {
    std::int64_t key;
    const ViewFile* file;
  };
  std::vector<Item> items;
  std::vector<const ViewFile*> strays;  ///< files without the key
};

std::optional<std::int64_t> key_of(const ViewFile& file, PairedBy by, std::size_t index) {
  switch (by) {
    case PairedBy::kTime:
      if (file.time) return file.time->count();
      break;
    case PairedBy::kNumber:
      if (file.number) return static_cast<std::int64_t>(*file.number);
      break;
    case PairedBy::kOrder: return static_cast<std::int64_t>(index);
  }
  return std::nullopt;
}

Keyed sort_by_key(const View& view, PairedBy by) {
  Keyed keyed;
  for (std::size_t i = 0; i < view.size(); ++i) {
    if (const auto key = key_of(view[i], by, i)) {
      keyed.items.push_back({*key, &view[i]});
    } else {
      keyed.strays.push_back(&view[i]);
    }
  }
  std::stable_sort(keyed.items.begin(), keyed.items.end(),
                   [](const Keyed::Item& a, const Keyed::Item& b) { return a.key < b.key; });
  return keyed;
}

bool most_have(const View& view, PairedBy by) {
  std::size_t count = 0;
  for (const ViewFile& file : view) count += key_of(file, by, 0).has_value() ? 1 : 0;
  return 2 * count > view.size();
}

std::optional<std::int64_t> median_difference(const Keyed& keyed) {
  std::vector<std::int64_t> differences;
  for (std::size_t i = 1; i < keyed.items.size(); ++i) {
    const std::int64_t difference = keyed.items[i].key - keyed.items[i - 1].key;
    if (difference > 0) differences.push_back(difference);
  }
  if (differences.empty()) return std::nullopt;
  const auto middle = differences.begin() + static_cast<std::ptrdiff_t>(differences.size() / 2);
  std::nth_element(differences.begin(), middle, differences.end());
  return *middle;
}

constexpr std::size_t kNone = std::numeric_limits<std::size_t>::max();

/// For each left item the index of its right partner, or kNone.
std::vector<std::size_t> match(const Keyed& left, const Keyed& right, std::int64_t tolerance) {
  struct Candidate {
    std::int64_t distance;
    std::size_t left;
    std::size_t right;
  };
  std::vector<Candidate> candidates;
  std::size_t first = 0;
  for (std::size_t i = 0; i < left.items.size(); ++i) {
    const std::int64_t key = left.items[i].key;
    while (first < right.items.size() && right.items[first].key < key - tolerance) ++first;
    for (std::size_t j = first; j < right.items.size() && right.items[j].key <= key + tolerance; ++j) {
      candidates.push_back({std::abs(right.items[j].key - key), i, j});
    }
  }
  std::sort(candidates.begin(), candidates.end(), [](const Candidate& a, const Candidate& b) {
    if (a.distance != b.distance) return a.distance < b.distance;
    return a.left != b.left ? a.left < b.left : a.right < b.right;
  });
  std::vector<std::size_t> partner(left.items.size(), kNone);
  std::vector<char> taken(right.items.size(), 0);
  for (const Candidate& candidate : candidates) {
    if (partner[candidate.left] != kNone || taken[candidate.right] != 0) continue;
    partner[candidate.left] = candidate.right;
    taken[candidate.right] = 1;
  }
  return partner;
}

struct KeyedEntry {
  std::int64_t key;
  PairEntry entry;
};

std::string no_partner(const ViewFile& file, const char* other, PairedBy by, nanoseconds period) {
  std::string text = file.path.string() + ": no " + other + " picture ";
  switch (by) {
    case PairedBy::kTime: return text + "within half a period of " + std::to_string(period.count() / 1000) + " us";
    case PairedBy::kNumber: return text + "of number " + std::to_string(*file.number) + " is left for it";
    case PairedBy::kOrder: break;
  }
  return text + "is left for it";
}

/// Times, strays and the last check, common to one view and two.
Pairing finish(PairedBy by, nanoseconds period, double fps, std::vector<KeyedEntry> keyed,
               const std::vector<const ViewFile*>& strays_left, const std::vector<const ViewFile*>& strays_right) {
  std::stable_sort(keyed.begin(), keyed.end(), [](const KeyedEntry& a, const KeyedEntry& b) { return a.key < b.key; });
  Pairing pairing{by, period, {}};
  const std::int64_t first = keyed.empty() ? 0 : keyed.front().key;
  const bool counts_frames = by == PairedBy::kNumber && !keyed.empty() && keyed.back().key - first <= kLongestNumbering;
  std::optional<CaptureTime> last;
  for (KeyedEntry& item : keyed) {
    PairEntry& entry = item.entry;
    if (by == PairedBy::kTime) {
      entry.time = CaptureTime(nanoseconds(item.key));
    } else {
      const std::uint64_t periods =
          counts_frames ? static_cast<std::uint64_t>(item.key - first) : pairing.entries.size();
      entry.time = CaptureTime(at_rate(periods, fps));
    }
    if (entry.fault.empty()) {
      if (last && entry.time <= *last) {
        entry.fault = entry.left.string() + ": has the time or number of the picture before it";
      } else {
        last = entry.time;
      }
    }
    pairing.entries.push_back(std::move(entry));
  }
  const char* missing = by == PairedBy::kTime ? ": no time stamp in the name as in the others"
                                              : ": no number in the name as in the others";
  const CaptureTime end = pairing.entries.empty() ? CaptureTime{} : pairing.entries.back().time;
  for (const ViewFile* file : strays_left) {
    pairing.entries.push_back({file->path, {}, end, {}, file->path.string() + missing});
  }
  for (const ViewFile* file : strays_right) {
    pairing.entries.push_back({{}, file->path, end, {}, file->path.string() + missing});
  }
  return pairing;
}

}  // namespace

nanoseconds at_rate(std::uint64_t periods, double fps) {
  return nanoseconds(std::llround(static_cast<double>(periods) * 1e9 / fps));
}

Pairing pair_views(const View& left, const View& right, double fps) {
  PairedBy by = PairedBy::kOrder;
  if (most_have(left, PairedBy::kTime) && most_have(right, PairedBy::kTime)) {
    by = PairedBy::kTime;
  } else if (most_have(left, PairedBy::kNumber) && most_have(right, PairedBy::kNumber)) {
    by = PairedBy::kNumber;
  }
  Keyed lefts = sort_by_key(left, by);
  Keyed rights = sort_by_key(right, by);

  nanoseconds period = at_rate(1, fps);
  if (by == PairedBy::kTime) {
    auto median = median_difference(lefts);
    if (!median) median = median_difference(rights);
    if (median) period = nanoseconds(*median);
  }
  std::vector<std::size_t> partner = match(lefts, rights, by == PairedBy::kTime ? period.count() / 2 : 0);
  const auto none = [&] { return std::all_of(partner.begin(), partner.end(), [](auto p) { return p == kNone; }); };
  if (by == PairedBy::kTime && none()) {
    throw std::runtime_error(lefts.items.front().file->path.parent_path().string() +
                             ": no time stamp lies within half a period of one of the other view: the two views are "
                             "from different recordings or clocks; give names with plain numbers instead");
  }
  if (by == PairedBy::kNumber && none()) {
    by = PairedBy::kOrder;
    lefts = sort_by_key(left, by);
    rights = sort_by_key(right, by);
    partner = match(lefts, rights, 0);
  }

  std::vector<KeyedEntry> entries;
  std::vector<char> taken(rights.items.size(), 0);
  for (std::size_t i = 0; i < lefts.items.size(); ++i) {
    const Keyed::Item& l = lefts.items[i];
    if (partner[i] == kNone) {
      entries.push_back({l.key, {l.file->path, {}, {}, {}, no_partner(*l.file, "right", by, period)}});
      continue;
    }
    const Keyed::Item& r = rights.items[partner[i]];
    taken[partner[i]] = 1;
    PairEntry pair{l.file->path, r.file->path, {}, {}, {}};
    if (by == PairedBy::kTime) pair.skew = nanoseconds(r.key - l.key);
    entries.push_back({l.key, std::move(pair)});
  }
  for (std::size_t j = 0; j < rights.items.size(); ++j) {
    if (taken[j] != 0) continue;
    const Keyed::Item& r = rights.items[j];
    entries.push_back({r.key, {{}, r.file->path, {}, {}, no_partner(*r.file, "left", by, period)}});
  }
  return finish(by, period, fps, std::move(entries), lefts.strays, rights.strays);
}

Pairing single_view(const View& view, double fps) {
  PairedBy by = PairedBy::kOrder;
  if (most_have(view, PairedBy::kTime)) {
    by = PairedBy::kTime;
  } else if (most_have(view, PairedBy::kNumber)) {
    by = PairedBy::kNumber;
  }
  const Keyed keyed = sort_by_key(view, by);
  nanoseconds period = at_rate(1, fps);
  if (by == PairedBy::kTime) {
    if (const auto median = median_difference(keyed)) period = nanoseconds(*median);
  }
  std::vector<KeyedEntry> entries;
  for (const Keyed::Item& item : keyed.items) {
    entries.push_back({item.key, {item.file->path, {}, {}, {}, {}}});
  }
  return finish(by, period, fps, std::move(entries), keyed.strays, {});
}

}  // namespace stereotrack::capture
