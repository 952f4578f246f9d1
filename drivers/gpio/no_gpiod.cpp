#include <stdexcept>

#include "drivers/gpio/gpiod.hpp"

namespace stereotrack::gpio::gpiod {
namespace {

[[noreturn]] void refuse(const LineName& name) {
  throw std::runtime_error("GPIO line " + to_string(name) +
                           ": this build has no libgpiod: install libgpiod-dev and build anew, or write sim:NAME for a "
                           "simulated line");
}

}  // namespace

Found find(const LineName& name) { refuse(name); }

std::unique_ptr<LineRequest> request(const std::string& /*path*/, std::span<const WantedLine> lines,
                                     std::string_view /*consumer*/) {
  refuse(lines.empty() ? LineName{} : lines.front().name);
}

std::unique_ptr<InputRequest> request_inputs(const std::string& /*path*/, std::span<const WantedInput> lines,
                                             std::string_view /*consumer*/) {
  refuse(lines.empty() ? LineName{} : lines.front().spec.name);
}

std::vector<ChipListing> list_chips() { return {}; }

std::string_view interface() noexcept { return "none"; }

}  // namespace stereotrack::gpio::gpiod
