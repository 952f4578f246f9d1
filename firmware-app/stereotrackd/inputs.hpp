#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "config/configuration.hpp"
#include "drivers/gpio/input_lines.hpp"
#include "drivers/record/black_box.hpp"
#include "firmware-app/stereotrackd/line_care.hpp"

namespace stereotrack::daemon {

/// The lines of [[input]]: takes their edges, lets the black box write, brings chips that went back. Service thread: it
/// may allocate, and waits where a chip does.
class Inputs {
 public:
  struct Input {
    std::string name;
    gpio::InputSpec spec;
    std::chrono::nanoseconds apart{0};  ///< edges that come sooner after one that triggered trigger nothing
    friend bool operator==(const Input&, const Input&) = default;
  };
  struct Setup {
    std::vector<Input> inputs;
    bool record = false;  ///< edges are triggers of the black box
  };

  Inputs() = default;  ///< none
  /// Requests the lines. Throws std::runtime_error, one line.
  explicit Inputs(Setup setup);

  /// Goes on with other lines, or the same in another way; counts of lines that stay under their name go on. Throws
  /// std::runtime_error, one line, where those cannot be had: then all is as it was. `box`: of take(), for edges that
  /// came until now.
  void exchange(Setup setup, record::BlackBox* box);

  /// Readable when edges wait; -1: there are no lines.
  [[nodiscard]] int descriptor() const noexcept { return lines_.descriptor(); }

  /// Takes the edges that came. `box` may be null: they are counted alone.
  void take(record::BlackBox* box);
  /// Looks after chips, again and again: asks each second whether they are there, and for those that went.
  void tend(MonotonicTime now);

  [[nodiscard]] std::size_t size() const noexcept { return courses_.size(); }
  [[nodiscard]] const std::string& name(std::size_t i) const noexcept { return setup_.inputs[i].name; }
  [[nodiscard]] const gpio::LineName& line(std::size_t i) const noexcept { return lines_.name(i); }
  [[nodiscard]] bool is_gone(std::size_t i) const noexcept { return (lines_.gone() >> i & 1U) != 0; }
  [[nodiscard]] gpio::LineBits gone() const noexcept { return lines_.gone(); }
  [[nodiscard]] std::uint64_t outages() const noexcept { return outages_before_ + lines_.outages(); }
  [[nodiscard]] std::uint64_t events(std::size_t i) const noexcept;
  [[nodiscard]] std::uint64_t lost(std::size_t i) const noexcept;
  [[nodiscard]] std::uint64_t triggers(std::size_t i) const noexcept { return courses_[i].triggers; }

 private:
  struct Course {
    std::uint64_t triggers = 0;
    std::uint64_t events_before = 0;  ///< of lines that were exchanged
    std::uint64_t lost_before = 0;
    bool has_triggered = false;
    MonotonicTime triggered{};
  };

  void begin(Setup setup, gpio::InputLines lines);

  Setup setup_;
  gpio::InputLines lines_;
  std::vector<Course> courses_;
  std::uint64_t outages_before_ = 0;
  LineCare care_{"GPIO inputs"};
  MonotonicTime probed_{};
};

/// What the configuration says. Throws config::Error, one line, for what this build or kernel cannot do, too, whether
/// the chips are there or not.
[[nodiscard]] Inputs::Setup input_setup(const config::Configuration& configuration);

}  // namespace stereotrack::daemon
