#pragma once

#include <array>
#include <cstdint>

#include "pipeline/core/image_view.hpp"
#include "pipeline/core/stage.hpp"

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
  using Table = std::array<std::uint8_t, 256>;

  explicit Equalise(const Config& config) noexcept : mode_(config.mode) {}

  /// Changes `picture` in place.
  void run(ImageView<std::uint8_t> picture) noexcept {
    if (mode_ == EqualiseMode::kOff || picture.empty()) return;
    if (mode_ == EqualiseMode::kFrame || !has_table_) {
      table_ = table_of(picture);
      has_table_ = true;
    }
    for (int y = 0; y < picture.height; ++y) {
      std::uint8_t* row = picture.row(y);
      for (int x = 0; x < picture.width; ++x) row[x] = table_[row[x]];
    }
  }

  /// The transformation T of (3.2)-(3.5). Not decreasing; the brightest value present maps to 255.
  [[nodiscard]] static Table table_of(ImageView<const std::uint8_t> picture) noexcept {
    std::array<std::uint32_t, 256> histogram{};
    for (int y = 0; y < picture.height; ++y) {
      const std::uint8_t* row = picture.row(y);
      for (int x = 0; x < picture.width; ++x) ++histogram[row[x]];
    }
    const std::uint64_t n = static_cast<std::uint64_t>(picture.width) * static_cast<std::uint64_t>(picture.height);
    Table table{};
    if (n == 0) return table;
    std::uint64_t below = 0;
    for (std::size_t i = 0; i < 256; ++i) {
      below += histogram[i];
      table[i] = static_cast<std::uint8_t>((below * 255 * 2 + n) / (2 * n));
    }
    return table;
  }

 private:
  EqualiseMode mode_;
  bool has_table_ = false;
  Table table_{};
};
static_assert(RealTimeStage<Equalise, &Equalise::run>);

}  // namespace stereotrack
