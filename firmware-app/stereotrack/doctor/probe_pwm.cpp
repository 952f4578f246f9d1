#include <charconv>
#include <system_error>

#include "firmware-app/stereotrack/doctor/probe.hpp"
#include "firmware-app/stereotrack/doctor/tree.hpp"

namespace stereotrack::doctor {

namespace fs = std::filesystem;

std::vector<PwmChip> probe_pwm(const fs::path& root) {
  std::vector<PwmChip> chips;
  const fs::path all = root / "sys/class/pwm";
  for (const std::string& name : names_in(all, "pwmchip")) {
    PwmChip& chip = chips.emplace_back();
    chip.name = name;
    chip.channels = static_cast<int>(number_of(all / name / "npwm").value_or(0));
    std::error_code ignored;
    chip.device = fs::read_symlink(all / name / "device", ignored).filename().string();
    for (const std::string& channel : names_in(all / name, "pwm")) {
      int number = 0;
      const char* const end = channel.data() + channel.size();
      const auto parsed = std::from_chars(channel.data() + 3, end, number);
      if (parsed.ec == std::errc() && parsed.ptr == end) chip.exported.push_back(number);
    }
  }
  return chips;
}

}  // namespace stereotrack::doctor
