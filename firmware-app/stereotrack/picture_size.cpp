#include "firmware-app/stereotrack/picture_size.hpp"

#include <charconv>
#include <optional>
#include <string_view>

#include "config/error.hpp"

namespace stereotrack {
namespace {

std::optional<int> positive_number(std::string_view text) {
  int value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size() || value < 1) return std::nullopt;
  return value;
}

}  // namespace

PictureSize parse_picture_size(const std::string& text) {
  const std::size_t by = text.find('x');
  if (by != std::string::npos) {
    const std::optional<int> width = positive_number(std::string_view(text).substr(0, by));
    const std::optional<int> height = positive_number(std::string_view(text).substr(by + 1));
    if (width && height) return {*width, *height};
  }
  throw config::Error("--size " + text + ": is not WIDTHxHEIGHT, like 640x480");
}

}  // namespace stereotrack
