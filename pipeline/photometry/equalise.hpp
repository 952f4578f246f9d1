#pragma once

#include <array>
#include <cstdint>
#include <numeric>

#include "pipeline/core/image_view.hpp"
#include "pipeline/core/stage.hpp"
#include "pipeline/photometry/equalise_kernel.hpp"
#include "pipeline/photometry/ingest_kernel.hpp"

namespace stereotrack {

/// When the gray picture is equalised.
enum class EqualiseMode : std::uint8_t {
  kOff,     ///< never
  kFrame,   ///< each picture with its own histogram, as the document does; the background then flickers
  kFrozen,  ///< all pictures with the table of the first one, so that equal pixels stay equal
};

/// Histogram equalisation of an 8-bit picture.
///     p(i)  = n_i / n                                                     (3.2)
///     c(i)  = sum of p(j), j <= i                                         (3.3)
///     y_i   = c(i)                                                        (3.4)
///     y'_i  = y_i (max - min) + min,  max = 255, min = 0                  (3.5)
/// in integers, rounded half up. One instance a view (it keeps the frozen table). O(pixels).
class Equalise {
 public:
  struct Config {
    EqualiseMode mode = EqualiseMode::kOff;
  };
  using Table = GreyTable;

  explicit Equalise(const Config& config) noexcept : mode_(config.mode) {}

  /// Whether a histogram is wanted of the next picture.
  [[nodiscard]] bool needs_histogram() const noexcept {
    return mode_ == EqualiseMode::kFrame || (mode_ == EqualiseMode::kFrozen && !has_table_);
  }

  /// Changes `picture` in place. histogram: the picture's; not looked at unless needs_histogram().
  void run(const Histogram& histogram, ImageView<std::uint8_t> picture) noexcept {
    if (mode_ == EqualiseMode::kOff || picture.empty()) return;
    if (needs_histogram()) {
      table_ = table_of(histogram);
      has_table_ = true;
    }
    for (int y = 0; y < picture.height; ++y) map_row(table_, picture.width, picture.row(y));
  }

  /// The transformation T of (3.2)-(3.5). Not decreasing; the brightest value present maps to 255.
  [[nodiscard]] static Table table_of(const Histogram& histogram) noexcept {
    const std::uint64_t n = std::accumulate(histogram.begin(), histogram.end(), std::uint64_t{0});
    Table table{};
    if (n == 0) return table;
    std::uint64_t below = 0;
    for (std::size_t i = 0; i < 256; ++i) {
      below += histogram[i];
      table[i] = static_cast<std::uint8_t>((below * 255 * 2 + n) / (2 * n));
    }
    return table;
  }

  /// What crosses frames: pipeline/core/state.hpp.
  template <class Self, class Archive>
  static void visit_state(Self& self, Archive& archive) noexcept {
    archive(self.has_table_, self.table_);
  }

 private:
  EqualiseMode mode_;
  bool has_table_ = false;
  Table table_{};
};
static_assert(RealTimeStage<Equalise, &Equalise::run>);

}  // namespace stereotrack
