// libgpiod 1.x: Debian 12.
#include <gpiod.h>

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

std::string_view interface() noexcept { return "1"; }

}  // namespace stereotrack::gpio::gpiod
