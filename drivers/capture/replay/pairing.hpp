#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "drivers/capture/replay/view_files.hpp"
#include "pipeline/core/time.hpp"

namespace stereotrack::capture {

enum class PairedBy : std::uint8_t { kTime, kNumber, kOrder };

/// One ordinal of a source: a pair, or a file whose partner does not exist.
struct PairEntry {
  std::filesystem::path left;
  std::filesystem::path right;                   ///< empty for a single view
  CaptureTime time{};                            ///< of the left file, or of the only one
  std::optional<std::chrono::nanoseconds> skew;  ///< right time - left time; none: not a pair formed by time
  std::string fault;  ///< one line naming the file if this entry cannot be a pair, else empty
};

struct Pairing {
  PairedBy by = PairedBy::kOrder;
  std::chrono::nanoseconds period{0};  ///< median difference of the times, or 1 / fps
  std::vector<PairEntry> entries;      ///< sorted by time, times of those without fault strictly increase
};

/// Which left and right files belong together.
///
///     by time    |t_right - t_left| <= period / 2      if more than half of the files of each view have a time
///     by number  n_right = n_left                      else if more than half have a number and one is common
///     by order   i_right = i_left                      else
///
/// One to one. By time the closest come first (ties: the earlier), so no pair crosses another; the period is
/// the median difference of neighbours in the left view (in the right one if left has one file).
/// Times by number are (n - first n) / fps; numbers that span more than 10^8 count something else than frames
/// (dates, serial numbers): then, and by order, they are (ordinal - 1) / fps.
/// A file without a partner, or without the key that the others have, or at the same time as the pair before, is an
/// entry with a fault. O(N log N). Throws if there are times but none of left lies within half a period of one of
/// right.
[[nodiscard]] Pairing pair_views(const View& left, const View& right, double fps);

/// The same for one view alone.
[[nodiscard]] Pairing single_view(const View& view, double fps);

/// `periods` / fps, rounded to a nanosecond.
[[nodiscard]] std::chrono::nanoseconds at_rate(std::uint64_t periods, double fps);

}  // namespace stereotrack::capture
