#include "drivers/gpio/simulated_chip.hpp"

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <mutex>
#include <stdexcept>

namespace stereotrack::gpio::simulated_chip {
namespace {

struct Pin {
  std::string name;      ///< empty: never asked for
  std::string consumer;  ///< empty: nobody holds it
  std::atomic<bool> high{false};
  std::atomic<std::uint64_t> edges{0};
  std::atomic<bool> gone{false};

  void drive(bool level) noexcept {
    if (high.exchange(level, std::memory_order_relaxed) != level) edges.fetch_add(1, std::memory_order_relaxed);
  }
};

/// Pins stay where they are, so that a request drives them without the lock.
struct Chip {
  std::mutex names;  ///< guards Pin::name and Pin::consumer
  std::array<Pin, kLines> pins;

  /// The pin of this name; null: none has it.
  Pin* find(std::string_view name) noexcept {
    const auto found = std::find_if(pins.begin(), pins.end(), [&](const Pin& pin) { return pin.name == name; });
    return found == pins.end() || name.empty() ? nullptr : &*found;
  }
};

Chip& chip() {
  static Chip the_one;
  return the_one;
}

class Request final : public LineRequest {
 public:
  Request(std::span<const WantedLine> lines, std::string_view consumer) {
    const std::scoped_lock lock(chip().names);
    for (const WantedLine& line : lines) {
      Pin* pin = chip().find(line.name.line);
      if (pin != nullptr && !pin->consumer.empty()) {
        const std::string holder = pin->consumer;
        let_go();
        throw std::runtime_error("GPIO line " + to_string(line.name) + ": busy: held by \"" + holder + "\"");
      }
      if (pin == nullptr) {
        const auto unnamed =
            std::find_if(chip().pins.begin(), chip().pins.end(), [](const Pin& free) { return free.name.empty(); });
        if (unnamed == chip().pins.end()) {
          let_go();
          throw std::runtime_error("GPIO line " + to_string(line.name) + ": the simulated chip has but " +
                                   std::to_string(kLines) + " lines: take fewer names");
        }
        pin = &*unnamed;
        pin->name = line.name.line;
        pin->high.store(line.high, std::memory_order_relaxed);
      }
      pin->consumer = consumer.empty() ? "?" : consumer;
      pins_[count_++] = pin;
    }
    for (std::size_t i = 0; i < count_; ++i) pins_[i]->drive(lines[i].high);
  }
  Request(const Request&) = delete;
  Request& operator=(const Request&) = delete;
  ~Request() override {
    const std::scoped_lock lock(chip().names);
    let_go();
  }

  int set(LineBits high) noexcept override {
    for (std::size_t i = 0; i < count_; ++i) {
      if (pins_[i]->gone.load(std::memory_order_relaxed)) return ENODEV;
    }
    for (std::size_t i = 0; i < count_; ++i) pins_[i]->drive((high >> i & 1U) != 0);
    return 0;
  }

 private:
  void let_go() noexcept {
    for (std::size_t i = 0; i < count_; ++i) pins_[i]->consumer.clear();
  }

  std::array<Pin*, kMaxLines> pins_{};
  std::size_t count_ = 0;
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

void set_gone(std::string_view line, bool gone) {
  const std::scoped_lock lock(chip().names);
  if (Pin* const pin = chip().find(line)) pin->gone.store(gone, std::memory_order_relaxed);
}

std::unique_ptr<LineRequest> request(std::span<const WantedLine> lines, std::string_view consumer) {
  return std::make_unique<Request>(lines, consumer);
}

}  // namespace stereotrack::gpio::simulated_chip
