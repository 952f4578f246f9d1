#pragma once

#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "drivers/gpio/choice.hpp"
#include "drivers/gpio/input_lines.hpp"
#include "drivers/gpio/line.hpp"

struct gpiod_chip;

namespace stereotrack::gpio::gpiod {

/// A chip opened by libgpiod. What differs between its versions 1 and 2 is behind this class and nowhere else:
/// gpiod_chip_1.cpp and gpiod_chip_2.cpp, one of which is built. Set-up only.
class Chip {
 public:
  /// Null: it cannot be opened, errno says why.
  [[nodiscard]] static std::unique_ptr<Chip> open(const std::string& path);
  Chip(const Chip&) = delete;
  Chip& operator=(const Chip&) = delete;
  ~Chip();

  [[nodiscard]] ChipFacts facts() const;
  [[nodiscard]] LineFacts line(unsigned offset) const;

  /// Requests outputs, each with its level. Null: refused, errno says why. The chip goes into the request.
  [[nodiscard]] static std::unique_ptr<LineRequest> request(std::unique_ptr<Chip> chip,
                                                            std::span<const WantedLine> lines,
                                                            const std::string& consumer);

  /// The same for inputs, each with its edges.
  [[nodiscard]] static std::unique_ptr<InputRequest> request_inputs(std::unique_ptr<Chip> chip,
                                                                    std::span<const WantedInput> lines,
                                                                    const std::string& consumer);

 private:
  Chip(gpiod_chip* handle, const std::string& path) : handle_(handle), path_(path) {}

  gpiod_chip* handle_;
  std::string path_;
};

}  // namespace stereotrack::gpio::gpiod
