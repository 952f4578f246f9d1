#include "drivers/gpio/line.hpp"

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <stdexcept>
#include <utility>

#include "drivers/gpio/gpiod.hpp"
#include "drivers/gpio/locate.hpp"
#include "drivers/gpio/simulated_chip.hpp"

namespace stereotrack::gpio {
namespace {

/// What the metrics read while the lines are driven.
struct Meter {
  std::atomic<bool> active{false};
  std::atomic<std::uint64_t> transitions{0};
  std::atomic<std::int64_t> changed_ns{0};
  std::atomic<std::uint64_t> failures{0};
};

/// A chip's lines among all of the program. Requests are handed over by pointers: what is `incoming` becomes `current`
/// in set(), what was becomes `retired`, and reopen() frees it. Only set(), reopen() and the handler of a fault look.
struct ChipLines {
  ChipLines() = default;
  ChipLines(const ChipLines&) = delete;
  ChipLines& operator=(const ChipLines&) = delete;
  ~ChipLines() {
    for (auto* place : {&current, &incoming, &retired}) delete place->load();
  }

  std::string path;                       ///< of the chip when it was found first, or "sim"
  std::vector<WantedLine> wanted;         ///< as it was requested first: with the safe levels
  std::array<unsigned, kMaxLines> all{};  ///< line k of this chip is line all[k] of the program
  std::size_t count = 0;
  LineBits mine = 0;  ///< the same, as bits
  std::atomic<LineRequest*> current{nullptr};
  std::atomic<LineRequest*> incoming{nullptr};
  std::atomic<LineRequest*> retired{nullptr};
  bool failed = false;  ///< refused last time: what its lines show is not known; set()'s
};

[[noreturn]] void refuse(const LineName& name, const std::string& what) {
  throw std::runtime_error("GPIO line " + to_string(name) + ": " + what);
}

std::unique_ptr<LineRequest> request(const std::string& path, std::span<const WantedLine> lines,
                                     std::string_view consumer) {
  return path == simulated_chip::kChip ? simulated_chip::request(lines, consumer)
                                       : gpiod::request(path, lines, consumer);
}

}  // namespace

struct OutputLines::State {
  std::vector<std::unique_ptr<ChipLines>> chips;
  std::vector<LineName> names;
  std::string consumer;
  LineBits low = 0;   ///< lines that are active_low
  LineBits safe = 0;  ///< lines whose safe state is active
  LineBits told = 0;  ///< active lines, as far as their chips took it
  std::array<Meter, kMaxLines> meters;
  std::atomic<int> last_error{0};
  std::atomic<LineBits> failing{0};
  std::atomic<LineBits> gone{0};
  std::atomic<std::uint64_t> outages{0};
  std::atomic<bool> held{false};  ///< safe for ever

  // Sequentially consistent, here and in reopen(): either it sees that they are held and frees nothing, or this sees
  // the request that is in use since.
  bool hold() noexcept {
    held.store(true);
    bool all = true;
    for (const auto& chip : chips) all = chip->current.load()->set(levels(*chip, safe)) == 0 && all;
    return all;
  }

  /// A chip that is back, if it is.
  void take_over(ChipLines& chip) noexcept {
    // Not before the last one was fetched: there is one place for what is retired.
    if (chip.incoming.load(std::memory_order_relaxed) == nullptr || chip.retired.load() != nullptr) return;
    LineRequest* const next = chip.incoming.exchange(nullptr);
    if (next != nullptr) chip.retired.store(chip.current.exchange(next));
  }

  SetResult set(LineBits active, MonotonicTime now, bool all = false) noexcept {
    SetResult result;
    for (const auto& each : chips) {
      ChipLines& chip = *each;
      const LineBits differ = (active ^ told) & chip.mine;
      if ((differ == 0 && !chip.failed && !all) || held.load()) continue;
      if (chip.failed) take_over(chip);
      const int error = chip.current.load(std::memory_order_relaxed)->set(levels(chip, active));
      if (error == ENODEV && (gone.load(std::memory_order_relaxed) & chip.mine) == 0) {
        outages.fetch_add(1, std::memory_order_relaxed);
      }
      mark(failing, chip.mine, error != 0);
      mark(gone, chip.mine, error == ENODEV);
      chip.failed = error != 0;
      if (chip.failed) {
        last_error.store(error, std::memory_order_relaxed);
        result.failed |= chip.mine;
        continue;
      }
      told ^= differ;
      result.changed |= differ;
    }
    for (unsigned i = 0; i < names.size(); ++i) note(i, result, now);
    return result;
  }

  static void mark(std::atomic<LineBits>& bits, LineBits mine, bool on) noexcept {
    const LineBits before = bits.load(std::memory_order_relaxed);
    bits.store(on ? before | mine : before & ~mine, std::memory_order_relaxed);
  }

  /// Line k of the chip is bit k.
  [[nodiscard]] LineBits levels(const ChipLines& chip, LineBits active) const noexcept {
    const LineBits high = active ^ low;
    LineBits bits = 0;
    for (std::size_t k = 0; k < chip.count; ++k) bits |= (high >> chip.all[k] & 1U) << k;
    return bits;
  }

  void note(unsigned line, const SetResult& result, MonotonicTime now) noexcept {
    Meter& meter = meters[line];
    if ((result.failed >> line & 1U) != 0) meter.failures.fetch_add(1, std::memory_order_relaxed);
    if ((result.changed >> line & 1U) == 0) return;
    meter.active.store((told >> line & 1U) != 0, std::memory_order_relaxed);
    meter.transitions.fetch_add(1, std::memory_order_relaxed);
    meter.changed_ns.store(now.time_since_epoch().count(), std::memory_order_relaxed);
  }
};

OutputLines::OutputLines() : state_(std::make_unique<State>()) {}
OutputLines::OutputLines(OutputLines&&) noexcept = default;
OutputLines& OutputLines::operator=(OutputLines&& other) noexcept {
  std::swap(state_, other.state_);
  return *this;
}

OutputLines::~OutputLines() {
  // Not requested chips, of an open_lines() that failed, were told nothing: they are left alone.
  if (state_ != nullptr) state_->set(state_->safe, {});
}

OutputLines::SetResult OutputLines::refresh(MonotonicTime now) noexcept { return state_->set(state_->told, now, true); }

OutputLines::SetResult OutputLines::set(LineBits active, MonotonicTime now) noexcept {
  return state_->set(active, now);
}

OutputLines::SetResult OutputLines::set_safe(MonotonicTime now) noexcept { return state_->set(state_->safe, now); }

bool OutputLines::hold_safe() noexcept { return state_->hold(); }

std::size_t OutputLines::size() const noexcept { return state_->names.size(); }

const LineName& OutputLines::name(std::size_t line) const noexcept { return state_->names[line]; }

OutputLines::Reading OutputLines::read(std::size_t line) const noexcept {
  const Meter& meter = state_->meters[line];
  return {.active = meter.active.load(std::memory_order_relaxed),
          .transitions = meter.transitions.load(std::memory_order_relaxed),
          .changed = MonotonicTime(std::chrono::nanoseconds(meter.changed_ns.load(std::memory_order_relaxed))),
          .failures = meter.failures.load(std::memory_order_relaxed)};
}

LineBits OutputLines::failing() const noexcept { return state_->failing.load(std::memory_order_relaxed); }

LineBits OutputLines::gone() const noexcept { return state_->gone.load(std::memory_order_relaxed); }

std::uint64_t OutputLines::outages() const noexcept { return state_->outages.load(std::memory_order_relaxed); }

int OutputLines::last_error() const noexcept { return state_->last_error.load(std::memory_order_relaxed); }

OutputLines open_lines(std::span<const LineSpec> specs, std::string_view consumer) {
  if (specs.size() > kMaxLines) {
    refuse(specs[kMaxLines].name, "one too many: a program drives " + std::to_string(kMaxLines) + " lines");
  }
  OutputLines lines;
  OutputLines::State& state = *lines.state_;
  for (const LineSpec& spec : specs) {
    const gpiod::Found found = locate(spec.name);
    auto place = std::find_if(state.chips.begin(), state.chips.end(),
                              [&](const auto& known) { return known->path == found.path; });
    if (place == state.chips.end()) {
      place = state.chips.insert(state.chips.end(), std::make_unique<ChipLines>());
      (*place)->path = found.path;
    }
    ChipLines& chip = **place;
    const WantedLine wanted{spec.name, found.offset, spec.safe != spec.active_low};
    for (const WantedLine& other : chip.wanted) {
      if (is_simulated(spec.name) ? other.name == wanted.name : other.offset == wanted.offset) {
        refuse(spec.name,
               "named twice" +
                   (other.name == spec.name ? std::string() : ", the other time as " + to_string(other.name)) +
                   ": a line has one rule");
      }
    }
    const auto number = static_cast<unsigned>(state.names.size());
    state.names.push_back(spec.name);
    chip.wanted.push_back(wanted);
    chip.all[chip.count++] = number;
    chip.mine |= LineBits{1} << number;
    if (spec.active_low) state.low |= LineBits{1} << number;
    if (spec.safe) state.safe |= LineBits{1} << number;
    state.meters[number].active.store(spec.safe, std::memory_order_relaxed);
  }
  state.told = state.safe;
  state.consumer = consumer;
  for (const auto& chip : state.chips) chip->current.store(request(chip->path, chip->wanted, consumer).release());
  return lines;
}

LineBits OutputLines::reopen(std::string* why) {
  LineBits back = 0;
  for (const auto& chip : state_->chips) {
    LineRequest* const retired = chip->retired.exchange(nullptr);
    if (state_->held.load()) {
      chip->retired.store(retired);  // the handler of a fault may be at it
      continue;
    }
    delete retired;
    if ((gone() & chip->mine) == 0 || chip->incoming.load() != nullptr) continue;
    try {
      // It may have come back under another path.
      std::vector<WantedLine> wanted = chip->wanted;
      std::string path;
      for (WantedLine& line : wanted) {
        const gpiod::Found found = locate(line.name);
        if (!path.empty() && found.path != path)
          refuse(line.name, "it is on " + found.path + " now, others of its chip on " + path);
        path = found.path;
        line.offset = found.offset;
      }
      chip->incoming.store(request(path, wanted, state_->consumer).release());
      back |= chip->mine;
    } catch (const std::runtime_error& error) {
      if (why != nullptr) *why = error.what();
    }
  }
  return back;
}

std::vector<SafeOutcome> set_lines_safe(std::span<const LineSpec> specs, std::string_view consumer) {
  std::vector<SafeOutcome> outcomes;
  for (const LineSpec& spec : specs) {
    try {
      static_cast<void>(open_lines({&spec, 1}, consumer));
      outcomes.push_back({true, "GPIO line " + to_string(spec.name) + ": driven " +
                                    (spec.safe ? "active" : "inactive") + ", its safe state (" +
                                    (spec.safe != spec.active_low ? "high" : "low") + "), and let go"});
    } catch (const std::runtime_error& error) {
      outcomes.push_back({false, error.what()});
    }
  }
  return outcomes;
}

LineName parse_line_name(std::string_view text) {
  const std::size_t colon = text.rfind(':');
  LineName name;
  if (colon != std::string_view::npos) {
    name = {std::string(text.substr(0, colon)), std::string(text.substr(colon + 1))};
  }
  const bool blank = text.find_first_of(" \t\r\n") == 0 || text.find_last_of(" \t\r\n") + 1 == text.size();
  if (name.chip.empty() || name.line.empty() || (blank && !text.empty())) {
    throw std::runtime_error("\"" + std::string(text) +
                             "\" is no GPIO line: write CHIP:LINE, for example gpiochip0:17, pinctrl-bcm2711:GPIO17 or "
                             "sim:near");
  }
  return name;
}

std::string to_string(const LineName& name) { return name.chip + ":" + name.line; }

}  // namespace stereotrack::gpio
