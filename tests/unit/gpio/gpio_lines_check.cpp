// What no machine without GPIO chips shows: whether edges of real lines come through libgpiod, once each, in order,
// with stamps of CLOCK_MONOTONIC, and whether a chip that is unplugged comes back. ctest has no chip and runs it on the
// simulated one, the emulated board (cases/gpio) on gpio-sim, by each libgpiod that is supported; run it by hand on a
// board of yours.
//
//     gpio_lines_check CHIP OUT_LINE IN_LINE                   OUT_LINE is wired to IN_LINE by a jumper
//     gpio_lines_check CHIP OUT_LINE IN_LINE DEVICE            numbers of lines of gpio-sim; DEVICE is its folder,
//                                                              /sys/devices/platform/gpio-sim.0: this is the wire
//     gpio_lines_check CHIP OUT_LINE IN_LINE DEVICE CONFIG     besides pulls the chip out and plugs it in: CONFIG is
//                                                              /sys/kernel/config/gpio-sim/NAME; CHIP is a label, as
//                                                              the chip's number may change
//     gpio_lines_check sim A B                                 the simulated chip: whether this program is right
//
// Prints a line for each fact; exit code 0 if all hold.
#include <poll.h>

#include <array>
#include <chrono>
#include <cstdio>
#include <ctime>
#include <exception>
#include <filesystem>
#include <fstream>
#include <span>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "drivers/gpio/gpiod.hpp"
#include "drivers/gpio/input_lines.hpp"
#include "drivers/gpio/line.hpp"
#include "drivers/gpio/simulated_chip.hpp"

namespace stereotrack::gpio {
namespace {

namespace fs = std::filesystem;
using std::chrono::milliseconds;

constexpr milliseconds kPatience{500};  ///< an edge is there by then

MonotonicTime now() {
  timespec time{};
  (void)clock_gettime(CLOCK_MONOTONIC, &time);
  return MonotonicTime(std::chrono::seconds(time.tv_sec) + std::chrono::nanoseconds(time.tv_nsec));
}

class Check {
 public:
  Check(std::string chip, std::string out, std::string in, fs::path device, fs::path config)
      : out_{chip, std::move(out)}, in_{std::move(chip), std::move(in)}, device_(device), config_(config) {}

  int run() {
    edges_come_once_in_order();
    what_overflows_is_counted();
    active_low_turns_edges_round();
    a_line_in_use_is_refused();
    if (gpiod::interface() == "2" && !is_simulated()) what_bounces_counts_once_it_is_still();
    if (is_simulated() || !config_.empty()) a_chip_comes_back();
    std::printf("%s\n", failures_ == 0 ? "all hold" : "NOT ALL HOLD");
    return failures_ == 0 ? 0 : 1;
  }

 private:
  [[nodiscard]] bool is_simulated() const { return out_.chip == simulated_chip::kChip; }

  void expect(bool holds, const std::string& what) {
    std::printf("%s %s\n", holds ? "ok    " : "FAILED", what.c_str());
    if (!holds) ++failures_;
  }

  [[nodiscard]] OutputLines output() const { return open_lines(std::vector{LineSpec{out_}}, "gpio_lines_check"); }
  [[nodiscard]] InputLines input(Edges edges, bool active_low = false) const {
    // Behind a line of another chip, so that numbers in the program are not those on the chip.
    const InputSpec before{.name = {std::string(simulated_chip::kChip), "before"}};
    const InputSpec spec{.name = in_, .active_low = active_low, .edges = edges};
    return open_inputs(std::vector{before, spec}, "gpio_lines_check");
  }

  /// Attribute of a line of gpio-sim.
  [[nodiscard]] fs::path attribute(const LineName& line, const std::string& name) const {
    for (const fs::directory_entry& chip : fs::directory_iterator(device_)) {
      const fs::path file = chip.path() / ("sim_gpio" + line.line) / name;
      if (fs::exists(file)) return file;
    }
    throw std::runtime_error(device_.string() + ": no line " + line.line + " of gpio-sim: give its number");
  }

  static void write(const fs::path& file, const std::string& text) {
    std::ofstream out(file);
    out << text << std::flush;
    if (!out) throw std::runtime_error(file.string() + ": cannot be written");
  }

  void drive(OutputLines& lines, bool high) {
    if (lines.set(high ? 1 : 0, now()).failed != 0) throw std::runtime_error("the output is refused");
    if (is_simulated()) {
      simulated_chip::drive(in_.line, simulated_chip::level(out_.line) == true, now());
    } else if (!device_.empty()) {
      std::string level;
      std::ifstream(attribute(out_, "value")) >> level;
      write(attribute(in_, "pull"), level == "1" ? "pull-up" : "pull-down");
    }
  }

  /// Those that come within kPatience, `most` of them.
  static std::vector<EdgeEvent> take(InputLines& lines, std::size_t most) {
    std::vector<EdgeEvent> all;
    while (all.size() < most) {
      pollfd waited{lines.descriptor(), POLLIN, 0};
      if (poll(&waited, 1, static_cast<int>(kPatience.count())) <= 0) break;
      std::array<EdgeEvent, 4> some;
      const std::size_t count = lines.read(some);
      all.insert(all.end(), some.begin(), some.begin() + static_cast<std::ptrdiff_t>(count));
      if (count == 0) break;
    }
    return all;
  }

  void edges_come_once_in_order() {
    OutputLines lines = output();
    drive(lines, false);
    InputLines edges = input(Edges::kBoth);
    bool all = true;
    bool in_time = true;
    bool numbered = true;
    for (int i = 0; i < 20; ++i) {
      const MonotonicTime before = now();
      drive(lines, i % 2 == 0);
      const std::vector<EdgeEvent> came = take(edges, 1);
      all =
          all && came.size() == 1 && came[0].line == 1 && came[0].edge == (i % 2 == 0 ? Edge::kRising : Edge::kFalling);
      if (came.empty()) continue;
      in_time = in_time && came[0].time >= before && came[0].time <= now();
      const auto wanted = static_cast<std::uint32_t>(gpiod::interface() == "1" && !is_simulated() ? 0 : i + 1);
      numbered = numbered && came[0].sequence == wanted;
    }
    expect(all, "20 edges come once each, in order");
    expect(in_time, "their stamps are of CLOCK_MONOTONIC, between driving and reading");
    expect(numbered, "their sequence numbers are what this interface has");
    expect(take(edges, 1).empty() && edges.reading(1).lost == 0, "no more than these, none lost");
  }

  void what_overflows_is_counted() {
    OutputLines lines = output();
    drive(lines, false);
    InputLines edges = input(Edges::kBoth);
    for (int i = 0; i < 201; ++i) {
      drive(lines, i % 2 == 0);
      // gpio-sim's interrupts tell what came since they last did: edges without a pause between them are one.
      std::this_thread::sleep_for(milliseconds(1));
    }
    const std::size_t kept = take(edges, 1000).size();
    drive(lines, false);
    const std::size_t after = take(edges, 1).size();
    const std::uint64_t lost = edges.reading(1).lost;
    std::printf("       of 201 edges unread %zu were kept, %llu are known to be lost\n", kept,
                static_cast<unsigned long long>(lost));
    expect(after == 1, "and the next one comes");
    const bool counts = gpiod::interface() != "1" || is_simulated();
    expect(counts ? kept + after + lost == 202 : kept == 16, "what overflowed is known as well as can be");
  }

  void active_low_turns_edges_round() {
    OutputLines lines = output();
    drive(lines, false);
    InputLines edges = input(Edges::kRising, true);
    drive(lines, true);
    expect(take(edges, 1).empty(), "a level that rises is no rising edge of a line that is active low");
    drive(lines, false);
    const std::vector<EdgeEvent> came = take(edges, 1);
    expect(came.size() == 1 && came[0].edge == Edge::kRising, "one that falls is");
  }

  void a_line_in_use_is_refused() {
    const InputLines held = input(Edges::kBoth);
    try {
      (void)input(Edges::kBoth);
      expect(false, "a line in use is refused");
    } catch (const std::runtime_error& error) {
      const std::string told = error.what();
      expect(told.find("busy: held by \"gpio_lines_check\"") != std::string::npos, "refused: " + told);
    }
  }

  void what_bounces_counts_once_it_is_still() {
    constexpr milliseconds kStill{50};
    OutputLines lines = output();
    drive(lines, false);
    InputLines edges =
        open_inputs(std::vector{InputSpec{.name = in_, .edges = Edges::kBoth, .debounce = kStill}}, "gpio_lines_check");
    for (int i = 0; i < 10; ++i) drive(lines, i % 2 == 0);
    expect(take(edges, 1).empty(), "what bounces and is as before is no edge");
    const MonotonicTime before = now();
    for (int i = 0; i < 11; ++i) drive(lines, i % 2 == 0);
    const std::vector<EdgeEvent> came = take(edges, 2);
    expect(came.size() == 1 && came[0].edge == Edge::kRising, "what bounces and stays is one");
    expect(now() - before >= kStill, "told once it was still for so long");
  }

  void plug(bool in) {
    if (is_simulated()) {
      for (const LineName& line : {out_, in_}) simulated_chip::set_gone(line.line, !in);
    } else {
      write(config_ / "live", in ? "1" : "0");
      std::this_thread::sleep_for(milliseconds(500));  // udev
    }
  }

  void a_chip_comes_back() {
    OutputLines lines = output();
    drive(lines, false);
    InputLines edges = input(Edges::kBoth);
    plug(false);
    (void)take(edges, 1);
    const bool woken = edges.gone() != 0;
    edges.probe();
    expect((edges.gone() & 2U) != 0,
           std::string("an input that went is noticed, ") + (woken ? "by waking" : "by probing"));
    expect(lines.refresh(now()).failed == 1 && lines.gone() == 1, "an output that went is noticed");
    std::string why;
    const bool away = edges.reopen() == 0 && lines.reopen(&why) == 0;
    expect(away, "neither comes back meanwhile: " + why);
    plug(true);
    expect((edges.reopen() & 2U) != 0 && edges.gone() == 0, "the input is back");
    expect(lines.reopen(&why) == 1, "the output is back");
    drive(lines, true);
    expect(take(edges, 1).size() == 1, "and what the one drives the other reads");
  }

  LineName out_;
  LineName in_;
  fs::path device_;
  fs::path config_;
  int failures_ = 0;
};

}  // namespace
}  // namespace stereotrack::gpio

int main(int argc, char** argv) {
  const std::vector<std::string> words(argv, argv + argc);
  if (words.size() < 4 || words.size() > 6) {
    std::fprintf(stderr, "usage: gpio_lines_check CHIP OUT_LINE IN_LINE [DEVICE [CONFIG]]\n");
    return 2;
  }
  try {
    return stereotrack::gpio::Check(words[1], words[2], words[3], words.size() > 4 ? words[4] : "",
                                    words.size() > 5 ? words[5] : "")
        .run();
  } catch (const std::exception& error) {
    std::fprintf(stderr, "gpio_lines_check: %s\n", error.what());
    return 1;
  }
}
