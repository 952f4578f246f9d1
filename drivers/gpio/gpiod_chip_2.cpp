// libgpiod 2.x: Debian 13.
#include <gpiod.h>

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

std::string_view interface() noexcept { return "2"; }

}  // namespace stereotrack::gpio::gpiod
