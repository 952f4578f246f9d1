#include "drivers/gpio/simulated_chip.hpp"

#include <fcntl.h>
#include <sys/eventfd.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <mutex>
#include <stdexcept>
#include <system_error>
#include <vector>

namespace stereotrack::gpio::simulated_chip {
namespace {

[[noreturn]] void refuse(const LineName& name, const std::string& what) {
  throw std::runtime_error("GPIO line " + to_string(name) + ": " + what);
}

/// The edges of a pin that is an input, as a kernel would keep them.
struct Input {
  int bell = -1;  ///< eventfd of the request that holds it; -1: it is no input
  bool active_low = false;
  Edges edges = Edges::kBoth;
  std::array<EdgeEvent, kKeptEdges> kept{};
  std::uint32_t told = 0;   ///< edges since the request
  std::uint32_t taken = 0;  ///< of these, that were read or lost

  void note(bool high, MonotonicTime at) noexcept {
    const Edge edge = high != active_low ? Edge::kRising : Edge::kFalling;
    if (edges != Edges::kBoth && (edges == Edges::kRising) != (edge == Edge::kRising)) return;
    kept[told % kKeptEdges] = {.edge = edge, .time = at, .sequence = told + 1};
    ++told;
    if (told - taken > kKeptEdges) ++taken;
    ring();
  }
  void ring() const noexcept {
    // It fails where it was rung 2^64 times without an answer.
    if (bell >= 0) (void)eventfd_write(bell, 1);
  }
};

struct Pin {
  std::string name;              ///< empty: never asked for
  std::string consumer;          ///< empty: nobody holds it
  const void* holder = nullptr;  ///< the request that does, to tell it from others
  Input input;
  std::atomic<bool> high{false};
  std::atomic<std::uint64_t> edges{0};
  std::atomic<bool> gone{false};
  std::atomic<std::uint32_t> life{0};  ///< times that the chip went: requests of a life before are dead
  std::atomic<int> refusal{0};

  bool drive(bool level) noexcept {
    if (high.exchange(level, std::memory_order_relaxed) == level) return false;
    edges.fetch_add(1, std::memory_order_relaxed);
    return true;
  }
};

/// Pins stay where they are, so that a request drives them without the lock.
struct Chip {
  std::mutex names;  ///< guards what of a pin is not atomic
  std::array<Pin, kLines> pins;

  /// The pin of this name; null: none has it.
  Pin* find(std::string_view name) noexcept {
    const auto found = std::find_if(pins.begin(), pins.end(), [&](const Pin& pin) { return pin.name == name; });
    return found == pins.end() || name.empty() ? nullptr : &*found;
  }

  void drive(Pin& pin, bool level, MonotonicTime at) noexcept {
    if (pin.drive(level) && pin.input.bell >= 0) pin.input.note(level, at);
  }
};

Chip& chip() {
  static Chip the_one;
  return the_one;
}

/// What an output and an input request have in common: pins that are theirs. Under the lock, but dead().
class Hold {
 public:
  /// Throws; what was taken before is let go then.
  Pin& take(const LineName& name, std::string_view consumer, bool first_level) {
    Pin* pin = chip().find(name.line);
    if (pin != nullptr && pin->gone.load(std::memory_order_relaxed)) {
      let_go();
      refuse(name, "no such chip: the simulated one is gone");
    }
    if (pin != nullptr && !pin->consumer.empty()) {
      const std::string holder = pin->consumer;
      let_go();
      refuse(name, "busy: held by \"" + holder + "\"");
    }
    if (pin == nullptr) {
      const auto unnamed =
          std::find_if(chip().pins.begin(), chip().pins.end(), [](const Pin& free) { return free.name.empty(); });
      if (unnamed == chip().pins.end()) {
        let_go();
        refuse(name, "the simulated chip has but " + std::to_string(kLines) + " lines: take fewer names");
      }
      pin = &*unnamed;
      pin->name = name.line;
      pin->high.store(first_level, std::memory_order_relaxed);
    }
    pin->consumer = consumer.empty() ? "?" : consumer;
    pin->holder = this;
    lives_[count_] = pin->life.load(std::memory_order_relaxed);
    pins_[count_++] = pin;
    return *pin;
  }

  /// Pins of a chip that went are nobody's, or somebody else's by now.
  void let_go() noexcept {
    for (std::size_t i = 0; i < count_; ++i) {
      if (is_dead(i)) continue;
      pins_[i]->consumer.clear();
      pins_[i]->input = {};
    }
    count_ = 0;
  }

  [[nodiscard]] std::size_t count() const noexcept { return count_; }
  [[nodiscard]] Pin& pin(std::size_t i) const noexcept { return *pins_[i]; }

  /// The errno with which any of them refuses; 0: none does. Takes no lock.
  [[nodiscard]] int refusal() const noexcept {
    for (std::size_t i = 0; i < count_; ++i) {
      if (is_dead(i)) return ENODEV;
      if (const int error = pins_[i]->refusal.load(std::memory_order_relaxed); error != 0) return error;
    }
    return 0;
  }

 private:
  [[nodiscard]] bool is_dead(std::size_t i) const noexcept {
    return pins_[i]->life.load(std::memory_order_relaxed) != lives_[i];
  }

  std::array<Pin*, kMaxLines> pins_{};
  std::array<std::uint32_t, kMaxLines> lives_{};
  std::size_t count_ = 0;
};

class Request final : public LineRequest {
 public:
  Request(std::span<const WantedLine> lines, std::string_view consumer) {
    const std::scoped_lock lock(chip().names);
    for (const WantedLine& line : lines) hold_.take(line.name, consumer, line.high);
    for (std::size_t i = 0; i < lines.size(); ++i) hold_.pin(i).drive(lines[i].high);
  }
  Request(const Request&) = delete;
  Request& operator=(const Request&) = delete;
  ~Request() override {
    const std::scoped_lock lock(chip().names);
    hold_.let_go();
  }

  int set(LineBits high) noexcept override {
    if (const int error = hold_.refusal(); error != 0) return error;
    for (std::size_t i = 0; i < hold_.count(); ++i) hold_.pin(i).drive((high >> i & 1U) != 0);
    return 0;
  }

 private:
  Hold hold_;
};

/// A FIFO that somebody outside writes levels to.
class Fifo {
 public:
  Fifo(const LineName& name, Pin& pin) : path_(name.line), pin_(pin) {
    // One that a crash left over is as good as a new one.
    if (mkfifo(path_.c_str(), 0600) != 0 && errno != EEXIST) cannot_be_made(name, errno);
    // For writing, too: else it would be at its end whenever the last writer goes.
    fd_ = open(path_.c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC);
    if (fd_ < 0) cannot_be_made(name, errno);
    struct stat facts {};
    if (fstat(fd_, &facts) != 0 || !S_ISFIFO(facts.st_mode)) {
      (void)close(fd_);
      refuse(name, "it is no FIFO: delete it, or give another path");
    }
    device_ = facts.st_dev;
    inode_ = facts.st_ino;
  }
  Fifo(const Fifo&) = delete;
  Fifo& operator=(const Fifo&) = delete;
  ~Fifo() {
    if (is_there()) (void)unlink(path_.c_str());
    (void)close(fd_);
  }

  [[nodiscard]] int descriptor() const noexcept { return fd_; }
  [[nodiscard]] Pin& pin() const noexcept { return pin_; }

  [[nodiscard]] bool is_there() const noexcept {
    struct stat facts {};
    return stat(path_.c_str(), &facts) == 0 && facts.st_dev == device_ && facts.st_ino == inode_;
  }

  /// Drives the pin as was written. Under the lock.
  void read_levels() noexcept {
    std::array<char, 64> text{};
    const ssize_t size = ::read(fd_, text.data(), text.size());
    if (size <= 0) return;
    timespec now{};
    (void)clock_gettime(CLOCK_MONOTONIC, &now);
    const MonotonicTime at(std::chrono::seconds(now.tv_sec) + std::chrono::nanoseconds(now.tv_nsec));
    for (const char letter : std::span(text).first(static_cast<std::size_t>(size))) {
      if (letter == '0' || letter == '1') chip().drive(pin_, letter == '1', at);
    }
  }

 private:
  [[noreturn]] static void cannot_be_made(const LineName& name, int error) {
    refuse(name, "no FIFO can be made there: " + std::generic_category().message(error) +
                     ": give the path of a file in a folder that can be written to");
  }

  std::string path_;
  Pin& pin_;
  int fd_ = -1;
  dev_t device_ = 0;
  ino_t inode_ = 0;
};

class Inputs final : public InputRequest {
 public:
  Inputs(std::span<const WantedInput> lines, std::string_view consumer)
      : bell_(eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC)) {
    if (bell_ < 0)
      throw std::runtime_error("simulated GPIO chip: no eventfd: " + std::generic_category().message(errno));
    const std::scoped_lock lock(chip().names);
    try {
      descriptors_.push_back(bell_);
      for (const WantedInput& line : lines) {
        const InputSpec& spec = line.spec;
        Pin& pin = hold_.take(spec.name, consumer, spec.bias == Bias::kPullUp);
        pin.input = {.bell = bell_, .active_low = spec.active_low, .edges = spec.edges};
        if (spec.name.line.find('/') == std::string::npos) continue;
        fifos_.push_back(std::make_unique<Fifo>(spec.name, pin));
        descriptors_.push_back(fifos_.back()->descriptor());
      }
    } catch (...) {
      hold_.let_go();
      (void)close(bell_);
      throw;
    }
  }
  Inputs(const Inputs&) = delete;
  Inputs& operator=(const Inputs&) = delete;
  ~Inputs() override {
    const std::scoped_lock lock(chip().names);
    hold_.let_go();
    (void)close(bell_);
  }

  [[nodiscard]] std::span<const int> descriptors() const noexcept override { return descriptors_; }

  [[nodiscard]] ReadResult read(std::span<EdgeEvent> events) noexcept override {
    ReadResult result;
    const std::scoped_lock lock(chip().names);
    result.error = hold_.refusal();
    if (result.error != 0) return result;
    eventfd_t rings = 0;
    (void)eventfd_read(bell_, &rings);
    for (const auto& fifo : fifos_) fifo->read_levels();
    for (std::size_t i = 0; i < hold_.count(); ++i) {
      Input& input = hold_.pin(i).input;
      for (; input.taken != input.told && result.events < events.size(); ++input.taken) {
        events[result.events] = input.kept[input.taken % kKeptEdges];
        events[result.events++].line = i;
      }
      if (input.taken != input.told) input.ring();  // there is more
    }
    return result;
  }

  [[nodiscard]] int probe() noexcept override {
    const bool all = std::all_of(fifos_.begin(), fifos_.end(), [](const auto& fifo) { return fifo->is_there(); });
    return all ? hold_.refusal() : ENODEV;
  }

 private:
  int bell_;
  Hold hold_;
  std::vector<std::unique_ptr<Fifo>> fifos_;
  std::vector<int> descriptors_;
};

}  // namespace

std::optional<bool> level(std::string_view line) {
  const std::scoped_lock lock(chip().names);
  const Pin* const pin = chip().find(line);
  if (pin == nullptr) return std::nullopt;
  return pin->high.load(std::memory_order_relaxed);
}

std::uint64_t edges(std::string_view line) {
  const std::scoped_lock lock(chip().names);
  const Pin* const pin = chip().find(line);
  return pin == nullptr ? 0 : pin->edges.load(std::memory_order_relaxed);
}

bool drive(std::string_view line, bool high, MonotonicTime at) {
  const std::scoped_lock lock(chip().names);
  Pin* const pin = chip().find(line);
  if (pin == nullptr) return false;
  chip().drive(*pin, high, at);
  return true;
}

void set_gone(std::string_view line, bool gone) {
  const std::scoped_lock lock(chip().names);
  Pin* const pin = chip().find(line);
  if (pin == nullptr || pin->gone.exchange(gone, std::memory_order_relaxed) == gone || !gone) return;
  pin->input.ring();  // so that who waits for edges is told
  for (Pin& each : chip().pins) {
    if (&each != pin && (each.consumer.empty() || each.holder != pin->holder)) continue;
    each.life.fetch_add(1, std::memory_order_relaxed);
    each.input = {};
    each.consumer.clear();
  }
}

void set_refusing(std::string_view line, int error) {
  const std::scoped_lock lock(chip().names);
  if (Pin* const pin = chip().find(line)) pin->refusal.store(error, std::memory_order_relaxed);
}

std::unique_ptr<LineRequest> request(std::span<const WantedLine> lines, std::string_view consumer) {
  return std::make_unique<Request>(lines, consumer);
}

std::unique_ptr<InputRequest> request_inputs(std::span<const WantedInput> lines, std::string_view consumer) {
  return std::make_unique<Inputs>(lines, consumer);
}

}  // namespace stereotrack::gpio::simulated_chip
