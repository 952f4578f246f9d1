#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "drivers/capture/live_source.hpp"

namespace stereotrack::capture {

/// A recording or a scene as if cameras saw it now. All of it is in memory, so that the capture thread waits for no
/// disk and draws nothing; it is exposed pair by pair at the intervals of its own capture times, on the monotonic
/// clock, which is its capture clock. A pair is put in the moment it is exposed.
///
///     pair i of n:   t_i = t_start + (capture_i - capture_1),  a period between the last and the next first
///
/// Pairs that the source could not read leave a gap: their ordinal is counted and no pair comes. Ordinals and times
/// rise for ever, whichever way it is played.
class Film final : public LiveSource {
 public:
  enum class Repeat : std::uint8_t { kBounce, kLoop, kOnce };
  struct Config {
    Repeat repeat = Repeat::kBounce;
    std::uint64_t most_bytes = std::uint64_t{1} << 30;
  };

  /// Whether a film of that would be taken, as far as can be said before it is read. Throws std::runtime_error.
  static void check(const SourceInfo& info, const Config& config);

  /// Reads the source to its end. Throws std::runtime_error: no pair could be read, or more than most_bytes.
  Film(FrameSource& source, const Config& config);

  [[nodiscard]] const SourceInfo& info() const noexcept override { return info_; }
  [[nodiscard]] Step step(PairOutlet& outlet, MonotonicTime until) noexcept override;
  [[nodiscard]] ClockMap clock_map() const noexcept override { return {}; }
  [[nodiscard]] const std::string& failure() const noexcept override { return failure_; }

  [[nodiscard]] std::uint64_t bytes() const noexcept { return bytes_; }
  [[nodiscard]] std::size_t pairs() const noexcept { return pairs_.size(); }

 private:
  struct Pair {
    FramePair pair;  ///< views of `left` and `right`; empty where the source could not read it
    std::unique_ptr<std::uint8_t[]> left;
    std::unique_ptr<std::uint8_t[]> right;
  };

  [[nodiscard]] std::unique_ptr<std::uint8_t[]> keep(Picture& picture, const Config& config);
  void advance() noexcept;

  SourceInfo info_;
  std::string failure_;
  std::vector<Pair> pairs_;
  std::uint64_t bytes_ = 0;
  Repeat repeat_;

  std::optional<MonotonicTime> next_;  ///< exposure of the next pair; none: not started
  std::size_t at_ = 0;
  bool backwards_ = false;
  bool ended_ = false;
  std::uint64_t ordinal_ = 1;
};

}  // namespace stereotrack::capture
