#include <algorithm>
#include <cmath>

#include "firmware-app/stereotrack/doctor/measure.hpp"

namespace stereotrack::doctor {

namespace {

constexpr double kSpare = 0.25;  ///< of compute: scenes with more in them than synthetic:eleven

}  // namespace

Tail tail_of(std::vector<std::int64_t> values_ns) {
  Tail tail;
  tail.count = values_ns.size();
  if (values_ns.empty()) return tail;
  std::sort(values_ns.begin(), values_ns.end());
  // The smallest value that at least this part of them does not exceed.
  const auto at = [&values_ns](double part) {
    const auto rank = static_cast<std::size_t>(std::ceil(part * static_cast<double>(values_ns.size())));
    return static_cast<double>(values_ns[std::clamp<std::size_t>(rank, 1, values_ns.size()) - 1]) * 1e-3;
  };
  tail.p50_us = at(0.5);
  tail.p99_us = at(0.99);
  tail.p999_us = at(0.999);
  tail.max_us = static_cast<double>(values_ns.back()) * 1e-3;
  return tail;
}

/// A result leaves at the middle of its exposure + L. Until then
///     arrival   frames come, of both cameras: p99.9; with the phase, where the right one exposes later, and as if no
///               stamp were after its arrival. Not measured:
///               a period, which reading out takes at most. A film's pairs: nothing
///     wake      the frame loop and the publisher are woken: p99.9, twice
///     compute   the pipeline: p99.9 on synthetic:eleven
///     spare     a quarter of that
///     lead      the publisher decides: latency.lead_ms
/// L is their sum, rounded up to a millisecond. Sums of p99.9 are pessimistic: they rarely fall together.
std::optional<LatencyVerdict> latency_of(const Findings& findings) {
  if (!findings.pipeline || findings.pipeline->compute.count == 0) return std::nullopt;
  LatencyVerdict verdict;
  verdict.period_ms = findings.pipeline->period_ms;
  verdict.arrival_is_assumed = findings.cameras_wanted;
  double arrival_us = 0;
  for (const CaptureMeasure& camera : findings.capture) {
    if (camera.delay.count == 0) continue;
    verdict.arrival_is_assumed = false;
    const double later_ms =
        camera.side == "right" && findings.pair ? std::max(0.0, findings.pair->phase_ms.value_or(0)) : 0;
    // Stamps after the arrival are set right by camera.readout_us, which then moves all of them.
    const double early_us = std::max(0.0, -camera.delay_min_us);
    arrival_us = std::max(arrival_us, camera.delay.p999_us + early_us + later_ms * 1e3);
  }
  verdict.arrival_ms = verdict.arrival_is_assumed ? verdict.period_ms : arrival_us * 1e-3;
  verdict.compute_ms = findings.pipeline->compute.p999_us * 1e-3;
  if (findings.wake_up) verdict.wake_ms = 2 * findings.wake_up->latency.p999_us * 1e-3;
  verdict.lead_ms = findings.configuration.latency.lead_ms;
  verdict.spare_ms = kSpare * verdict.compute_ms;
  verdict.achievable_ms =
      std::ceil(verdict.arrival_ms + verdict.compute_ms + verdict.wake_ms + verdict.lead_ms + verdict.spare_ms);
  verdict.configured_ms = findings.configuration.latency.output_ms;
  return verdict;
}

}  // namespace stereotrack::doctor
