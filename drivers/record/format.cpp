#include "drivers/record/format.hpp"

#include <algorithm>

#include "drivers/capture/pixel_format_names.hpp"
#include "drivers/record/text_lines.hpp"

namespace stereotrack::record {

namespace {

std::string one_line(std::string text) {
  std::replace(text.begin(), text.end(), '\n', ' ');
  return text;
}

}  // namespace

std::string cause_text(std::uint32_t causes) {
  constexpr std::array<const char*, 5> kNames{"deadline", "zone", "signal", "gpio", "demand"};
  std::string text;
  for (std::size_t i = 0; i < kNames.size(); ++i) {
    if ((causes & (1U << i)) == 0) continue;
    text += (text.empty() ? "" : "-");
    text += kNames[i];
  }
  return text.empty() ? "none" : text;
}

std::string to_text(const About& about) {
  TextWriter out;
  out.key("source").word(one_line(about.source));
  out.key("program").word(one_line(about.program));
  out.key("cause").word(one_line(about.cause));
  out.key("size").number(about.width).number(about.height);
  out.key("format").word(std::string(capture::name_of(about.format)));
  out.key("views").number(about.stereo ? 2 : 1);
  out.key("period_ns").number(about.period_ns);
  out.key("rig").number(about.rig);
  out.key("session").number(about.session);
  out.key("unit_m").number(about.unit_m);
  out.key("reduce").number(about.reduce);
  out.key("every").number(about.every);
  out.key("exact").number(about.exact ? 1 : 0);
  return out.text();
}

About about_from_text(const std::string& text, const std::string& name) {
  const TextReader in(text, name);
  About about;
  about.source = in.word("source");
  about.program = in.word("program");
  about.cause = in.word("cause");
  std::array<int, 2> size{};
  in.numbers("size", std::span<int>(size));
  about.width = size[0];
  about.height = size[1];
  const std::string format = in.word("format");
  const std::optional<PixelFormat> known = capture::pixel_format_of(format);
  if (!known.has_value()) in.fail("format", "is none that is known: " + format);
  about.format = *known;
  about.stereo = in.number<int>("views") == 2;
  about.period_ns = in.number<std::int64_t>("period_ns");
  about.rig = in.number<std::uint32_t>("rig");
  about.session = in.number<std::uint64_t>("session");
  about.unit_m = in.number<double>("unit_m");
  about.reduce = in.number<int>("reduce");
  about.every = in.number<int>("every");
  about.exact = in.number<int>("exact") != 0;
  if (about.width < 1 || about.height < 1 || about.width > 8192 || about.height > 8192 ||
      !fits_format(about.format, about.width, about.height)) {
    in.fail("size", "is none of a picture");
  }
  return about;
}

}  // namespace stereotrack::record
