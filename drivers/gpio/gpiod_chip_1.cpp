// libgpiod 1.x: Debian 12.
#include <gpiod.h>
#include <poll.h>

#include <algorithm>
#include <array>
#include <cerrno>

#include "drivers/gpio/gpiod.hpp"
#include "drivers/gpio/gpiod_chip.hpp"

namespace stereotrack::gpio::gpiod {
namespace {

std::string text_of(const char* text) { return text == nullptr ? "" : text; }

/// The lines live in the chip's memory and close with it.
class Request final : public LineRequest {
 public:
  Request(std::unique_ptr<Chip> chip, const gpiod_line_bulk& lines) : chip_(std::move(chip)), lines_(lines) {}

  int set(LineBits high) noexcept override {
    std::array<int, kMaxLines> values{};
    for (unsigned i = 0; i < gpiod_line_bulk_num_lines(&lines_); ++i) values[i] = static_cast<int>(high >> i & 1U);
    return gpiod_line_set_value_bulk(&lines_, values.data()) == 0 ? 0 : errno;
  }

 private:
  std::unique_ptr<Chip> chip_;
  gpiod_line_bulk lines_;
};

/// What the library calls the edges.
int request_type(Edges edges) noexcept {
  switch (edges) {
    case Edges::kRising: return GPIOD_LINE_REQUEST_EVENT_RISING_EDGE;
    case Edges::kFalling: return GPIOD_LINE_REQUEST_EVENT_FALLING_EDGE;
    case Edges::kBoth: break;
  }
  return GPIOD_LINE_REQUEST_EVENT_BOTH_EDGES;
}

int request_flags(const InputSpec& spec) noexcept {
  int flags = spec.active_low ? GPIOD_LINE_REQUEST_FLAG_ACTIVE_LOW : 0;
  switch (spec.bias) {
    case Bias::kAsIs: break;
    case Bias::kNone: flags |= GPIOD_LINE_REQUEST_FLAG_BIAS_DISABLE; break;
    case Bias::kPullUp: flags |= GPIOD_LINE_REQUEST_FLAG_BIAS_PULL_UP; break;
    case Bias::kPullDown: flags |= GPIOD_LINE_REQUEST_FLAG_BIAS_PULL_DOWN; break;
  }
  return flags;
}

/// A descriptor a line: so the kernel's first interface has it.
class Inputs final : public InputRequest {
 public:
  explicit Inputs(std::unique_ptr<Chip> chip) : chip_(std::move(chip)) {}

  /// Of a line that was requested.
  void add(gpiod_line* line) noexcept {
    lines_[count_] = line;
    descriptors_[count_++] = gpiod_line_event_get_fd(line);
  }

  [[nodiscard]] std::span<const int> descriptors() const noexcept override {
    return std::span(descriptors_).first(count_);
  }

  [[nodiscard]] ReadResult read(std::span<EdgeEvent> events) noexcept override {
    ReadResult result;
    std::array<pollfd, kMaxLines> waited{};
    for (std::size_t i = 0; i < count_; ++i) waited[i] = {descriptors_[i], POLLIN, 0};
    // Readings of a line without an edge wait for one.
    if (::poll(waited.data(), count_, 0) <= 0) return result;
    for (std::size_t i = 0; i < count_ && result.events < events.size(); ++i) {
      if (waited[i].revents == 0) continue;
      const std::size_t room = std::min(came_.size(), events.size() - result.events);
      const int count = gpiod_line_event_read_multiple(lines_[i], came_.data(), static_cast<unsigned>(room));
      if (count < 0) {
        result.error = errno == 0 ? EIO : errno;
        return result;
      }
      for (int k = 0; k < count; ++k) {
        const gpiod_line_event& event = came_[static_cast<std::size_t>(k)];
        events[result.events++] = {
            .line = i,
            .edge = event.event_type == GPIOD_LINE_EVENT_RISING_EDGE ? Edge::kRising : Edge::kFalling,
            .time = MonotonicTime(std::chrono::seconds(event.ts.tv_sec) + std::chrono::nanoseconds(event.ts.tv_nsec))};
      }
    }
    return result;
  }

  [[nodiscard]] int probe() noexcept override {
    for (std::size_t i = 0; i < count_; ++i) {
      if (gpiod_line_get_value(lines_[i]) < 0) return errno == 0 ? EIO : errno;
    }
    return 0;
  }

 private:
  std::unique_ptr<Chip> chip_;
  std::array<gpiod_line*, kMaxLines> lines_{};
  std::array<int, kMaxLines> descriptors_{};
  std::size_t count_ = 0;
  std::array<gpiod_line_event, 16> came_{};  ///< as many as the kernel keeps
};

}  // namespace

std::unique_ptr<Chip> Chip::open(const std::string& path) {
  gpiod_chip* const handle = gpiod_chip_open(path.c_str());
  return handle == nullptr ? nullptr : std::unique_ptr<Chip>(new Chip(handle, path));
}

Chip::~Chip() { gpiod_chip_close(handle_); }

ChipFacts Chip::facts() const {
  return {.path = path_,
          .name = text_of(gpiod_chip_name(handle_)),
          .label = text_of(gpiod_chip_label(handle_)),
          .lines = gpiod_chip_num_lines(handle_)};
}

LineFacts Chip::line(unsigned offset) const {
  gpiod_line* const line = gpiod_chip_get_line(handle_, offset);
  if (line == nullptr) return {};
  return {.name = text_of(gpiod_line_name(line)),
          .used = gpiod_line_is_used(line),
          .consumer = text_of(gpiod_line_consumer(line))};
}

std::unique_ptr<LineRequest> Chip::request(std::unique_ptr<Chip> chip, std::span<const WantedLine> lines,
                                           const std::string& consumer) {
  gpiod_line_bulk bulk = GPIOD_LINE_BULK_INITIALIZER;
  std::array<int, kMaxLines> levels{};
  for (std::size_t i = 0; i < lines.size(); ++i) {
    gpiod_line* const line = gpiod_chip_get_line(chip->handle_, lines[i].offset);
    if (line == nullptr) return nullptr;
    gpiod_line_bulk_add(&bulk, line);
    levels[i] = lines[i].high ? 1 : 0;
  }
  if (gpiod_line_request_bulk_output(&bulk, consumer.c_str(), levels.data()) != 0) return nullptr;
  return std::make_unique<Request>(std::move(chip), bulk);
}

std::unique_ptr<InputRequest> Chip::request_inputs(std::unique_ptr<Chip> chip, std::span<const WantedInput> lines,
                                                   const std::string& consumer) {
  gpiod_chip* const handle = chip->handle_;
  auto made = std::make_unique<Inputs>(std::move(chip));
  for (const WantedInput& wanted : lines) {
    gpiod_line* const line = gpiod_chip_get_line(handle, wanted.offset);
    if (line == nullptr) return nullptr;
    const gpiod_line_request_config config{consumer.c_str(), request_type(wanted.spec.edges),
                                           request_flags(wanted.spec)};
    if (gpiod_line_request(line, &config, 0) != 0) return nullptr;
    made->add(line);
  }
  return made;
}

std::string_view interface() noexcept { return "1"; }

}  // namespace stereotrack::gpio::gpiod
