#include <algorithm>
#include <array>
#include <stdexcept>

#include "drivers/gpio/line.hpp"
#include "firmware-app/runtime/clock.hpp"
#include "firmware-app/stereotrack/doctor/measure.hpp"
#include "firmware-app/stereotrack/doctor/threads.hpp"
#include "firmware-app/stereotrack/interrupt.hpp"

namespace stereotrack::doctor {

namespace {

constexpr int kMostSets = 1000;
constexpr std::chrono::milliseconds kApart{1};

}  // namespace

LineMeasure measure_line(const std::string& line, const RealTime& realtime, std::chrono::nanoseconds time) {
  LineMeasure measure;
  measure.line = line;
  try {
    const std::array<gpio::LineSpec, 1> specs{{{gpio::parse_line_name(line), false, false}}};
    // ctrl-C while it is active: it is made inactive all the same.
    const Interrupts interrupts;
    gpio::OutputLines lines = gpio::open_lines(specs, "stereotrack doctor");
    std::vector<std::int64_t> took_ns;
    took_ns.reserve(kMostSets);
    runtime::Thread thread(plan_of("st-publisher", realtime.publisher), mode_of(realtime), [&] {
      const MonotonicTime begin = runtime::monotonic_now();
      MonotonicTime due = begin;
      for (int n = 1; n <= kMostSets && due - begin < time && !interrupts.asked(); ++n) {
        runtime::sleep_until(due);
        const MonotonicTime before = runtime::monotonic_now();
        const gpio::OutputLines::SetResult result = lines.set(n % 2 == 1 ? 1U : 0U, before);
        took_ns.push_back((runtime::monotonic_now() - before).count());
        if (result.failed != 0) ++measure.failures;
        due = std::max(due + kApart, before);
      }
    });
    thread.begin();
    thread.join();
    if (measure.failures > 0) measure.problem = "the chip refused it: is it still plugged in?";
    measure.latency = tail_of(std::move(took_ns));
  } catch (const std::runtime_error& error) {
    measure.problem = error.what();
  }
  return measure;
}

}  // namespace stereotrack::doctor
