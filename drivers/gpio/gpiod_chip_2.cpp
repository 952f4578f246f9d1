// libgpiod 2.x: Debian 13.
#include <gpiod.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <new>

#include "drivers/gpio/gpiod.hpp"
#include "drivers/gpio/gpiod_chip.hpp"

namespace stereotrack::gpio::gpiod {
namespace {

std::string text_of(const char* text) { return text == nullptr ? "" : text; }

/// One of the library's objects, freed by its own function.
template <auto kFree>
struct Free {
  template <class T>
  void operator()(T* object) const noexcept {
    kFree(object);
  }
};
template <class T, auto kFree>
using Owned = std::unique_ptr<T, Free<kFree>>;
using ChipInfo = Owned<gpiod_chip_info, gpiod_chip_info_free>;
using LineInfo = Owned<gpiod_line_info, gpiod_line_info_free>;
using LineSettings = Owned<gpiod_line_settings, gpiod_line_settings_free>;
using LineConfig = Owned<gpiod_line_config, gpiod_line_config_free>;
using RequestConfig = Owned<gpiod_request_config, gpiod_request_config_free>;
using Lines = Owned<gpiod_line_request, gpiod_line_request_release>;
using EventBuffer = Owned<gpiod_edge_event_buffer, gpiod_edge_event_buffer_free>;

constexpr std::size_t kEventsAtOnce = 64;     ///< that are read in one system call
constexpr std::size_t kKeptEventsALine = 64;  ///< by the kernel until they are read

gpiod_line_value level(bool high) noexcept { return high ? GPIOD_LINE_VALUE_ACTIVE : GPIOD_LINE_VALUE_INACTIVE; }

class Request final : public LineRequest {
 public:
  Request(Lines lines, std::span<const WantedLine> wanted) : lines_(std::move(lines)), count_(wanted.size()) {
    for (std::size_t i = 0; i < count_; ++i) offsets_[i] = wanted[i].offset;
  }

  int set(LineBits high) noexcept override {
    std::array<gpiod_line_value, kMaxLines> values{};
    for (std::size_t i = 0; i < count_; ++i) values[i] = level((high >> i & 1U) != 0);
    return gpiod_line_request_set_values_subset(lines_.get(), count_, offsets_.data(), values.data()) == 0 ? 0 : errno;
  }

 private:
  Lines lines_;
  std::size_t count_;
  std::array<unsigned, kMaxLines> offsets_{};
};

/// The library's constructors fail for want of memory alone.
template <class T>
T made(T object) {
  if (!object) throw std::bad_alloc();
  return object;
}

gpiod_line_edge edges_of(Edges edges) noexcept {
  switch (edges) {
    case Edges::kRising: return GPIOD_LINE_EDGE_RISING;
    case Edges::kFalling: return GPIOD_LINE_EDGE_FALLING;
    case Edges::kBoth: break;
  }
  return GPIOD_LINE_EDGE_BOTH;
}

gpiod_line_bias bias_of(Bias bias) noexcept {
  switch (bias) {
    case Bias::kAsIs: break;
    case Bias::kNone: return GPIOD_LINE_BIAS_DISABLED;
    case Bias::kPullUp: return GPIOD_LINE_BIAS_PULL_UP;
    case Bias::kPullDown: return GPIOD_LINE_BIAS_PULL_DOWN;
  }
  return GPIOD_LINE_BIAS_AS_IS;
}

/// One descriptor for all lines.
class Inputs final : public InputRequest {
 public:
  Inputs(Lines lines, std::span<const WantedInput> wanted)
      : lines_(std::move(lines)),
        buffer_(made(EventBuffer(gpiod_edge_event_buffer_new(kEventsAtOnce)))),
        count_(wanted.size()),
        descriptor_{gpiod_line_request_get_fd(lines_.get())} {
    for (std::size_t i = 0; i < count_; ++i) offsets_[i] = wanted[i].offset;
  }

  [[nodiscard]] std::span<const int> descriptors() const noexcept override { return descriptor_; }

  [[nodiscard]] ReadResult read(std::span<EdgeEvent> events) noexcept override {
    ReadResult result;
    while (result.events < events.size()) {
      // Reading without an edge would wait for one.
      const int ready = gpiod_line_request_wait_edge_events(lines_.get(), 0);
      if (ready == 0) break;
      const std::size_t room = std::min(kEventsAtOnce, events.size() - result.events);
      const int count = ready < 0 ? -1 : gpiod_line_request_read_edge_events(lines_.get(), buffer_.get(), room);
      if (count < 0) {
        result.error = errno == 0 ? EIO : errno;
        break;
      }
      for (int k = 0; k < count; ++k) {
        gpiod_edge_event* const event = gpiod_edge_event_buffer_get_event(buffer_.get(), static_cast<unsigned long>(k));
        const auto end = offsets_.begin() + static_cast<std::ptrdiff_t>(count_);
        const auto line = std::find(offsets_.begin(), end, gpiod_edge_event_get_line_offset(event));
        if (line == end) continue;
        const bool rising = gpiod_edge_event_get_event_type(event) == GPIOD_EDGE_EVENT_RISING_EDGE;
        events[result.events++] = {.line = static_cast<std::size_t>(line - offsets_.begin()),
                                   .edge = rising ? Edge::kRising : Edge::kFalling,
                                   .time = MonotonicTime(std::chrono::nanoseconds(
                                       static_cast<std::int64_t>(gpiod_edge_event_get_timestamp_ns(event)))),
                                   .sequence = static_cast<std::uint32_t>(gpiod_edge_event_get_line_seqno(event))};
      }
    }
    return result;
  }

  [[nodiscard]] int probe() noexcept override {
    std::array<gpiod_line_value, kMaxLines> values{};
    const int done = gpiod_line_request_get_values_subset(lines_.get(), count_, offsets_.data(), values.data());
    return done == 0 ? 0 : (errno == 0 ? EIO : errno);
  }

 private:
  Lines lines_;
  EventBuffer buffer_;
  std::size_t count_;
  std::array<int, 1> descriptor_;
  std::array<unsigned, kMaxLines> offsets_{};
};

}  // namespace

std::unique_ptr<Chip> Chip::open(const std::string& path) {
  gpiod_chip* const handle = gpiod_chip_open(path.c_str());
  return handle == nullptr ? nullptr : std::unique_ptr<Chip>(new Chip(handle, path));
}

Chip::~Chip() { gpiod_chip_close(handle_); }

ChipFacts Chip::facts() const {
  const ChipInfo info(gpiod_chip_get_info(handle_));
  if (!info) return {};
  return {.path = path_,
          .name = text_of(gpiod_chip_info_get_name(info.get())),
          .label = text_of(gpiod_chip_info_get_label(info.get())),
          .lines = static_cast<unsigned>(gpiod_chip_info_get_num_lines(info.get()))};
}

LineFacts Chip::line(unsigned offset) const {
  const LineInfo info(gpiod_chip_get_line_info(handle_, offset));
  if (!info) return {};
  return {.name = text_of(gpiod_line_info_get_name(info.get())),
          .used = gpiod_line_info_is_used(info.get()),
          .consumer = text_of(gpiod_line_info_get_consumer(info.get()))};
}

std::unique_ptr<LineRequest> Chip::request(std::unique_ptr<Chip> chip, std::span<const WantedLine> lines,
                                           const std::string& consumer) {
  const auto settings = made(LineSettings(gpiod_line_settings_new()));
  const auto line_config = made(LineConfig(gpiod_line_config_new()));
  const auto request_config = made(RequestConfig(gpiod_request_config_new()));
  if (gpiod_line_settings_set_direction(settings.get(), GPIOD_LINE_DIRECTION_OUTPUT) != 0) return nullptr;
  for (const WantedLine& line : lines) {
    if (gpiod_line_settings_set_output_value(settings.get(), level(line.high)) != 0 ||
        gpiod_line_config_add_line_settings(line_config.get(), &line.offset, 1, settings.get()) != 0) {
      return nullptr;
    }
  }
  gpiod_request_config_set_consumer(request_config.get(), consumer.c_str());
  Lines request(gpiod_chip_request_lines(chip->handle_, request_config.get(), line_config.get()));
  if (!request) return nullptr;
  return std::make_unique<Request>(std::move(request), lines);
}

std::unique_ptr<InputRequest> Chip::request_inputs(std::unique_ptr<Chip> chip, std::span<const WantedInput> lines,
                                                   const std::string& consumer) {
  const auto line_config = made(LineConfig(gpiod_line_config_new()));
  const auto request_config = made(RequestConfig(gpiod_request_config_new()));
  for (const WantedInput& line : lines) {
    const InputSpec& spec = line.spec;
    const auto settings = made(LineSettings(gpiod_line_settings_new()));
    gpiod_line_settings_set_active_low(settings.get(), spec.active_low);
    gpiod_line_settings_set_debounce_period_us(settings.get(), static_cast<unsigned long>(spec.debounce.count()));
    if (gpiod_line_settings_set_direction(settings.get(), GPIOD_LINE_DIRECTION_INPUT) != 0 ||
        gpiod_line_settings_set_edge_detection(settings.get(), edges_of(spec.edges)) != 0 ||
        gpiod_line_settings_set_bias(settings.get(), bias_of(spec.bias)) != 0 ||
        gpiod_line_settings_set_event_clock(settings.get(), GPIOD_LINE_CLOCK_MONOTONIC) != 0 ||
        gpiod_line_config_add_line_settings(line_config.get(), &line.offset, 1, settings.get()) != 0) {
      return nullptr;
    }
  }
  gpiod_request_config_set_consumer(request_config.get(), consumer.c_str());
  gpiod_request_config_set_event_buffer_size(request_config.get(), kKeptEventsALine * lines.size());
  Lines request(gpiod_chip_request_lines(chip->handle_, request_config.get(), line_config.get()));
  if (!request) return nullptr;
  return std::make_unique<Inputs>(std::move(request), lines);
}

std::string_view interface() noexcept { return "2"; }

}  // namespace stereotrack::gpio::gpiod
