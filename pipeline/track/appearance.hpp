#pragma once

#include <algorithm>
#include <array>
#include <cstdint>

namespace stereotrack {

/// What a region looks like, wherever it is: the histogram of its colours.
///
/// 8 x 8 x 8 bins of Y, Cb, Cr; chroma is dense around grey, so its bins of 12 cover 74..169, grey in the middle
/// of one, and the outer ones take what lies beyond. Each pixel counts half in its bin and half in the next nearer one
/// along Y, so that a slight change of light moves little. Grey sources (Cb = Cr = 128) use the eight bins of Y alone.
/// A value; integers until normalised.
class Appearance {
 public:
  static constexpr int kBins = 512;

  void clear() noexcept { *this = Appearance(); }

  /// How often each colour comes, in the sixteen halves of the bins of Y. Neighbours are alike, and a count that has
  /// just been stored must be waited for: two tables in turns.
  class Counts {
   public:
    /// n pixels of a row; null chroma for grey.
    void add(const std::uint8_t* y, const std::uint8_t* cb, const std::uint8_t* cr, int n) noexcept {
      for (int i = 0; i < n; ++i) {
        const int chroma = cb == nullptr ? kGrey : chroma_bin(cb[i]) * 8 + chroma_bin(cr[i]);
        ++counts_[static_cast<std::size_t>(i & 1)][static_cast<std::size_t>((y[i] >> 4) * kChromas + chroma)];
      }
      pixels_ += n;
    }

   private:
    friend class Appearance;
    std::array<std::array<std::uint32_t, 16 * 64>, 2> counts_{};
    int pixels_ = 0;
  };

  Appearance() noexcept = default;

  /// What add() of each of the pixels gives.
  explicit Appearance(const Counts& counts) noexcept {
    const auto half = [&](int bin, int chroma) {
      const auto at = static_cast<std::size_t>(std::clamp(bin, 0, 15) * kChromas + chroma);
      return counts.counts_[0][at] + counts.counts_[1][at];
    };
    for (int near = 0; near < 8; ++near) {
      for (int chroma = 0; chroma < kChromas; ++chroma) {
        // Its own halves, and those beside it; what lies beside no other bin counts twice.
        const std::uint32_t sum = half(2 * near - 1, chroma) + half(2 * near, chroma) + half(2 * near + 1, chroma) +
                                  half(2 * near + 2, chroma);
        share_[static_cast<std::size_t>(near * kChromas + chroma)] = static_cast<float>(static_cast<std::int32_t>(sum));
      }
    }
    total_ = 2.0F * static_cast<float>(counts.pixels_);
  }

  void add(std::uint8_t y, std::uint8_t cb, std::uint8_t cr) noexcept {
    const int chroma = chroma_bin(cb) * 8 + chroma_bin(cr);
    const int near = y >> 5;
    const int other = std::clamp((y & 31) < 16 ? near - 1 : near + 1, 0, 7);
    share_[static_cast<std::size_t>(near * 64 + chroma)] += 1.0F;
    share_[static_cast<std::size_t>(other * 64 + chroma)] += 1.0F;
    total_ += 2.0F;
  }

  [[nodiscard]] bool known() const noexcept { return total_ > 0; }

  /// Part of the colour (0..1) of a pixel of this colour in the region.
  [[nodiscard]] double share(std::uint8_t y, std::uint8_t cb, std::uint8_t cr) const noexcept {
    const int bin = (y >> 5) * 64 + chroma_bin(cb) * 8 + chroma_bin(cr);
    return total_ > 0 ? static_cast<double>(share_[static_cast<std::size_t>(bin)] / total_) : 0;
  }

  /// How much of `seen` (0..1) is explained if `seen` is `part` (0..1) of a thing that looks like this: the
  /// intersection of the histograms, this one scaled up by 1 / part. 1 where either is unknown.
  [[nodiscard]] double explains(const Appearance& seen, double part = 1) const noexcept {
    if (!known() || !seen.known()) return 1;
    const float scale = seen.total_ / total_ / static_cast<float>(std::clamp(part, 0.1, 1.0));
    float common = 0;
    for (std::size_t i = 0; i < kBins; ++i) common += std::min(seen.share_[i], share_[i] * scale);
    return static_cast<double>(common / seen.total_);
  }

  /// Moves towards `seen` by `rate` (0..1).
  void learn(const Appearance& seen, double rate) noexcept {
    if (!seen.known()) return;
    if (!known()) {
      *this = seen;
      return;
    }
    const auto keep = static_cast<float>(1 - rate) / total_;
    const auto take = static_cast<float>(rate) / seen.total_;
    for (std::size_t i = 0; i < kBins; ++i) share_[i] = share_[i] * keep + seen.share_[i] * take;
    total_ = 1;
  }

  /// What crosses frames: pipeline/core/state.hpp.
  template <class Self, class Archive>
  static void visit_state(Self& self, Archive& archive) noexcept {
    archive(self.share_, self.total_);
  }

 private:
  static constexpr std::array<std::uint8_t, 256> kChromaBins = [] {
    std::array<std::uint8_t, 256> bins{};
    for (int c = 0; c < 256; ++c) {
      bins[static_cast<std::size_t>(c)] = static_cast<std::uint8_t>(std::clamp((c - 74) / 12, 0, 7));
    }
    return bins;
  }();
  static constexpr int kChromas = 64;
  static constexpr int kGrey = 4 * 8 + 4;
  static constexpr int chroma_bin(std::uint8_t c) noexcept { return kChromaBins[c]; }

  std::array<float, kBins> share_{};
  float total_ = 0;
};

}  // namespace stereotrack
