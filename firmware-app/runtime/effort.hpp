#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>

#include "pipeline/core/bounded_vector.hpp"
#include "pipeline/core/result.hpp"
#include "pipeline/effort.hpp"

namespace stereotrack::runtime {

/// Decides, after each frame, what the next one leaves out.
///
///     load = compute time / budget
///     shed one more     load > 1 in one frame, or load > shed_above in shed_after frames in a row
///     take one back     load < restore_below in `patience` frames in a row
///
/// One at a time, in the configured order; back in the opposite order. A frame between the two fractions ends both
/// rows.
///
/// Against swinging: the load without an effort does not tell what it will cost to have it back. So each return is a
/// trial. If something must be shed again within `patience` frames of it, the trial has failed, and `patience` doubles,
/// up to patience_most; a trial that is survived sets it back to restore_after. An effort for which there is no room
/// thus costs one overrun in patience_most frames in the long run, where a plain hysteresis pays one in restore_after.
///
/// The frame loop measures Pipeline::run by its clock, calls next() with the time that was left when it began as
/// budget, and gives the bits to the next Pipeline::run; the bits that were in force go into the frame's flags and
/// telemetry, and into a recording, whose replay passes them in instead of deciding. Pure logic: the same times give
/// the same decisions. One thread, O(1), no memory but its own.
class EffortController {
 public:
  struct Config {
    FixedVector<Effort, kEfforts> order;  ///< first to go first, each at most once; what is not named is never shed
    double shed_above = 0.9;              ///< of the budget: restore_below < shed_above <= 1
    double restore_below = 0.6;           ///< of the budget, > 0
    int shed_after = 3;                   ///< frames, >= 1
    int restore_after = 60;               ///< frames, >= 1
    int patience_most = 3600;             ///< frames, >= restore_after
  };
  struct Counters {
    std::array<std::uint64_t, kEfforts> sheds{};     ///< by Effort
    std::array<std::uint64_t, kEfforts> restores{};  ///< by Effort
    std::array<std::uint64_t, kEfforts> frames{};    ///< told to go without, by Effort
    std::uint64_t overruns = 0;                      ///< frames with load > 1
    std::uint64_t helpless = 0;                      ///< of these, with nothing left to shed
    std::uint64_t failed_trials = 0;
  };

  /// Faults: kBadConfig.
  [[nodiscard]] static Result<EffortController> create(const Config& config) noexcept;

  /// A frame took `compute` of `budget`. What the next one leaves out. No budget at all (<= 0) is an overrun.
  EffortBits next(std::chrono::nanoseconds compute, std::chrono::nanoseconds budget) noexcept;

  [[nodiscard]] EffortBits shed() const noexcept;
  /// Good frames in a row that bring the next effort back.
  [[nodiscard]] int patience() const noexcept { return patience_; }
  [[nodiscard]] const Counters& counters() const noexcept { return counters_; }

 private:
  explicit EffortController(const Config& config) noexcept : config_(config), patience_(config.restore_after) {}

  void shed_one() noexcept;
  void restore_one() noexcept;

  Config config_;
  Counters counters_;
  std::size_t level_ = 0;  ///< so many of the order are shed
  int heavy_ = 0;          ///< frames in a row over shed_above
  int light_ = 0;          ///< frames in a row under restore_below
  int patience_;
  bool on_trial_ = false;  ///< something came back less than patience_ frames ago
  int trial_ = 0;          ///< frames since
};

}  // namespace stereotrack::runtime
