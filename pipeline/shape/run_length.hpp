#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "pipeline/core/image_view.hpp"
#include "pipeline/shape/bit_mask.hpp"

namespace stereotrack {

/// A row of neighbouring pixels of one kind: columns [begin, end) of row y. `parent` links the runs of
/// one component; the root is the component's first run in raster order.
struct Run {
  std::int32_t y = 0;
  std::int32_t begin = 0;
  std::int32_t end = 0;
  std::int32_t parent = 0;

  [[nodiscard]] std::int32_t length() const noexcept { return end - begin; }
};

enum class RunKind : std::uint8_t {
  kObject,      ///< non-zero pixels, joined 8-connected
  kBackground,  ///< zero pixels, joined 4-connected: the complement of 8-connected objects
};

struct RunCount {
  int kept = 0;     ///< runs in the storage
  int dropped = 0;  ///< runs that came after the storage was full
};

/// Runs one kind of pixel of `mask` has at most.
[[nodiscard]] constexpr std::size_t max_run_count(int width, int height) noexcept {
  return (static_cast<std::size_t>(width) + 1) / 2 * static_cast<std::size_t>(height);
}

/// Finds all runs of `kind` in raster order and joins those that touch, by union-find.
/// When `runs` is full the rest of the picture is only counted. O(pixels + runs a(runs)).
[[nodiscard]] RunCount find_components(ImageView<const std::uint8_t> mask, RunKind kind, std::span<Run> runs) noexcept;
[[nodiscard]] RunCount find_components(const BitMask& mask, RunKind kind, std::span<Run> runs) noexcept;

/// Root of run i. Shortens the path on its way.
[[nodiscard]] inline std::int32_t root_of(std::span<Run> runs, std::int32_t i) noexcept {
  while (runs[i].parent != i) {
    runs[i].parent = runs[runs[i].parent].parent;
    i = runs[i].parent;
  }
  return i;
}

}  // namespace stereotrack
