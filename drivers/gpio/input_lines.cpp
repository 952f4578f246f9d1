#include "drivers/gpio/input_lines.hpp"

#include <sys/epoll.h>
#include <sys/utsname.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <stdexcept>
#include <system_error>
#include <utility>
#include <vector>

#include "drivers/gpio/gpiod.hpp"
#include "drivers/gpio/locate.hpp"
#include "drivers/gpio/simulated_chip.hpp"

namespace stereotrack::gpio {
namespace {

[[noreturn]] void refuse(const LineName& name, const std::string& what) {
  throw std::runtime_error("GPIO line " + to_string(name) + ": " + what);
}

/// A chip's lines among all of the program.
struct ChipInputs {
  std::string path;                       ///< of the chip when it was found first, or "sim"
  std::vector<WantedInput> wanted;        ///< line k of this chip
  std::vector<std::size_t> all;           ///< is line all[k] of the program
  LineBits mine = 0;                      ///< the same, as bits
  std::unique_ptr<InputRequest> request;  ///< null: the chip is gone
};

/// What is known of a line.
struct Course {
  InputLines::Reading reading;
  Edges edges = Edges::kRising;
  std::uint32_t sequence = 0;  ///< of its last event
  bool begun = false;          ///< an event came since the request
  Edge edge = Edge::kRising;   ///< of that event

  /// Edges that were lost before this one.
  [[nodiscard]] std::uint32_t lost_before(const EdgeEvent& event) const noexcept {
    if (event.sequence != 0) return event.sequence - sequence - 1;
    return edges == Edges::kBoth && begun && event.edge == edge ? 1 : 0;
  }
};

std::unique_ptr<InputRequest> request(const std::string& path, std::span<const WantedInput> lines,
                                      std::string_view consumer) {
  return path == simulated_chip::kChip ? simulated_chip::request_inputs(lines, consumer)
                                       : gpiod::request_inputs(path, lines, consumer);
}

}  // namespace

struct InputLines::State {
  std::vector<ChipInputs> chips;
  std::vector<LineName> names;
  std::vector<Course> courses;
  std::string consumer;
  int epoll = -1;
  LineBits gone = 0;
  std::uint64_t outages = 0;
  std::string why;

  State() = default;
  State(const State&) = delete;
  State& operator=(const State&) = delete;
  ~State() {
    chips.clear();
    if (epoll >= 0) (void)close(epoll);
  }

  /// Lets the chip's descriptors be waited for. Throws.
  void watch(const ChipInputs& chip, const InputRequest& made) const {
    for (const int descriptor : made.descriptors()) {
      epoll_event wanted{.events = EPOLLIN, .data = {.fd = descriptor}};
      if (epoll_ctl(epoll, EPOLL_CTL_ADD, descriptor, &wanted) == 0) continue;
      refuse(chip.wanted.front().spec.name, "cannot be waited for: " + std::generic_category().message(errno));
    }
  }

  void lose(ChipInputs& chip, int error) noexcept {
    chip.request.reset();  // its descriptors leave the epoll as they are closed
    gone |= chip.mine;
    ++outages;
    try {
      why = std::generic_category().message(error);
    } catch (const std::exception&) {
      why.clear();
    }
  }

  void note(EdgeEvent& event) noexcept {
    Course& course = courses[event.line];
    event.lost = course.lost_before(event);
    course.sequence = event.sequence;
    course.edge = event.edge;
    course.begun = true;
    ++course.reading.events;
    course.reading.lost += event.lost;
    course.reading.last = event.time;
  }
};

InputLines::InputLines() : state_(std::make_unique<State>()) {}
InputLines::InputLines(InputLines&&) noexcept = default;
InputLines& InputLines::operator=(InputLines&& other) noexcept {
  std::swap(state_, other.state_);
  return *this;
}
InputLines::~InputLines() = default;

int InputLines::descriptor() const noexcept { return state_->epoll; }

std::size_t InputLines::read(std::span<EdgeEvent> events) noexcept {
  std::size_t count = 0;
  for (ChipInputs& chip : state_->chips) {
    if (chip.request == nullptr) continue;
    const std::span<EdgeEvent> room = events.subspan(count);
    if (room.empty()) break;
    const InputRequest::ReadResult done = chip.request->read(room);
    for (EdgeEvent& event : room.first(done.events)) {
      event.line = chip.all[event.line];
      state_->note(event);
    }
    count += done.events;
    if (done.error != 0) state_->lose(chip, done.error);
  }
  return count;
}

void InputLines::probe() noexcept {
  for (ChipInputs& chip : state_->chips) {
    if (chip.request == nullptr) continue;
    if (const int error = chip.request->probe(); error != 0) state_->lose(chip, error);
  }
}

LineBits InputLines::gone() const noexcept { return state_->gone; }

std::uint64_t InputLines::outages() const noexcept { return state_->outages; }

const std::string& InputLines::why() const noexcept { return state_->why; }

LineBits InputLines::reopen() {
  LineBits back = 0;
  for (ChipInputs& chip : state_->chips) {
    if (chip.request != nullptr) continue;
    try {
      // It may have come back under another path.
      std::vector<WantedInput> wanted = chip.wanted;
      std::string path;
      for (WantedInput& line : wanted) {
        const LineName& name = line.spec.name;
        const gpiod::Found found = locate(name);
        if (!path.empty() && found.path != path) {
          refuse(name, "it is on " + found.path + " now, others of its chip on " + path);
        }
        path = found.path;
        line.offset = found.offset;
      }
      auto made = request(path, wanted, state_->consumer);
      state_->watch(chip, *made);
      chip.request = std::move(made);
    } catch (const std::runtime_error& error) {
      state_->why = error.what();
      continue;
    }
    for (const std::size_t line : chip.all) {
      state_->courses[line].sequence = 0;
      state_->courses[line].begun = false;
    }
    state_->gone &= ~chip.mine;
    back |= chip.mine;
  }
  return back;
}

std::size_t InputLines::size() const noexcept { return state_->names.size(); }

const LineName& InputLines::name(std::size_t line) const noexcept { return state_->names[line]; }

InputLines::Reading InputLines::reading(std::size_t line) const noexcept { return state_->courses[line].reading; }

bool stamps_are_monotonic(std::string_view kernel_release) noexcept {
  unsigned major = 0;
  unsigned minor = 0;
  const char* const end = kernel_release.data() + kernel_release.size();
  const auto first = std::from_chars(kernel_release.data(), end, major);
  if (first.ec != std::errc{} || first.ptr == end || *first.ptr != '.') return false;
  if (std::from_chars(first.ptr + 1, end, minor).ec != std::errc{}) return false;
  return std::pair(major, minor) >= std::pair(5U, 7U);
}

void check_inputs(std::span<const InputSpec> specs) {
  if (specs.size() > kMaxLines) {
    refuse(specs[kMaxLines].name, "one too many: a program reads " + std::to_string(kMaxLines) + " lines");
  }
  for (std::size_t i = 0; i < specs.size(); ++i) {
    const InputSpec& spec = specs[i];
    for (const InputSpec& before : specs.first(i)) {
      if (before.name == spec.name) refuse(spec.name, "named twice");
    }
    if (is_simulated(spec.name) || gpiod::interface() != "1") continue;
    if (spec.debounce.count() > 0) {
      refuse(spec.name,
             "libgpiod 1.x, which this build has, debounces nothing: leave it out, or build with libgpiod 2.x");
    }
    utsname system{};
    if (uname(&system) == 0 && !stamps_are_monotonic(system.release)) {
      refuse(spec.name, std::string("kernel ") + system.release +
                            " stamps edges with CLOCK_REALTIME, which jumps: 5.7 or newer is needed");
    }
  }
}

std::unique_ptr<InputRequest> request_input(const InputSpec& spec, std::string_view consumer) {
  check_inputs({&spec, 1});
  const gpiod::Found found = locate(spec.name);
  const WantedInput wanted{spec, found.offset};
  return request(found.path, {&wanted, 1}, consumer);
}

InputLines open_inputs(std::span<const InputSpec> specs, std::string_view consumer) {
  check_inputs(specs);
  InputLines lines;
  if (specs.empty()) return lines;
  InputLines::State& state = *lines.state_;
  state.consumer = consumer;
  state.epoll = epoll_create1(EPOLL_CLOEXEC);
  if (state.epoll < 0) {
    refuse(specs.front().name, "cannot be waited for: " + std::generic_category().message(errno));
  }
  for (const InputSpec& spec : specs) {
    const gpiod::Found found = locate(spec.name);
    auto chip = std::find_if(state.chips.begin(), state.chips.end(),
                             [&](const ChipInputs& known) { return known.path == found.path; });
    if (chip == state.chips.end()) {
      chip = state.chips.emplace(state.chips.end());
      chip->path = found.path;
    }
    for (const WantedInput& other : chip->wanted) {
      if (is_simulated(spec.name) || other.offset != found.offset) continue;
      refuse(spec.name, "named twice, the other time as " + to_string(other.spec.name));
    }
    chip->wanted.push_back({spec, found.offset});
    chip->all.push_back(state.names.size());
    chip->mine |= LineBits{1} << state.names.size();
    state.names.push_back(spec.name);
    state.courses.emplace_back().edges = spec.edges;
  }
  for (ChipInputs& chip : state.chips) {
    chip.request = request(chip.path, chip.wanted, consumer);
    state.watch(chip, *chip.request);
  }
  return lines;
}

}  // namespace stereotrack::gpio
