#include "drivers/gpio/gpiod.hpp"

#include <grp.h>
#include <sys/stat.h>

#include <algorithm>
#include <cerrno>
#include <filesystem>
#include <stdexcept>
#include <system_error>
#include <vector>

#include "drivers/gpio/choice.hpp"
#include "drivers/gpio/gpiod_chip.hpp"

namespace stereotrack::gpio::gpiod {
namespace {

namespace fs = std::filesystem;

[[noreturn]] void refuse(const LineName& name, const std::string& what) {
  throw std::runtime_error("GPIO line " + to_string(name) + ": " + what);
}

/// The group that may use a chip; empty: only root may, no udev rule has been written.
std::string group_of(const std::string& path) {
  struct stat facts {};
  if (::stat(path.c_str(), &facts) != 0 || facts.st_gid == 0) return {};
  const group* const entry = ::getgrgid(facts.st_gid);
  return entry == nullptr ? std::to_string(facts.st_gid) : entry->gr_name;
}

std::string no_permission(const std::string& path) {
  const std::string group = group_of(path);
  if (!group.empty()) return "no permission for " + path + ": add the program's user to the group " + group;
  return "no permission for " + path +
         R"(: give it a group by a udev rule, SUBSYSTEM=="gpio", GROUP="gpio", MODE="0660", and put the program's user )"
         "into it";
}

/// Why the chip at `path` did not open.
std::string open_refusal(const std::string& path, int error) {
  if (error == EACCES || error == EPERM) return no_permission(path);
  if (error == ENOTTY || error == ENODEV || error == EISDIR || error == ENXIO || error == EINVAL) {
    return path + " is not a GPIO chip: gpiodetect lists them";
  }
  return path + " cannot be opened: " + std::generic_category().message(error);
}

/// Chips in /dev that can be asked, and why the others could not. Links are other names of chips, not chips.
struct Chips {
  std::vector<ChipFacts> facts;
  std::string closed;  ///< why the first that did not open did not; empty: all did
};

/// By number: /dev/gpiochip2 before /dev/gpiochip10.
std::vector<std::string> chip_paths() {
  std::vector<std::string> paths;
  std::error_code ignored;
  for (const fs::directory_entry& entry : fs::directory_iterator("/dev", ignored)) {
    if (!entry.path().filename().string().starts_with("gpiochip") || entry.is_symlink(ignored)) continue;
    paths.push_back(entry.path().string());
  }
  std::sort(paths.begin(), paths.end(), [](const std::string& a, const std::string& b) {
    return a.size() != b.size() ? a.size() < b.size() : a < b;
  });
  return paths;
}

Chips chips_in_dev() {
  Chips chips;
  for (const std::string& path : chip_paths()) {
    if (const auto chip = Chip::open(path)) {
      chips.facts.push_back(chip->facts());
    } else if (chips.closed.empty()) {
      chips.closed = open_refusal(path, errno);
    }
  }
  return chips;
}

/// The chip's path without links, where the user gave a path or the name of an entry in /dev (which may be a link).
std::string path_meant(const LineName& name) {
  std::error_code error;
  const bool is_path = name.chip.find('/') != std::string::npos;
  const fs::path path = is_path ? fs::path(name.chip) : fs::path("/dev") / name.chip;
  if (!is_path && !name.chip.starts_with("gpiochip")) return {};
  const fs::path plain = fs::canonical(path, error);
  return error ? std::string() : plain.string();
}

std::vector<LineFacts> lines_of(const Chip& chip) {
  std::vector<LineFacts> lines;
  for (unsigned offset = 0; offset < chip.facts().lines; ++offset) lines.push_back(chip.line(offset));
  return lines;
}

/// Why a request was refused, as far as the chip can tell; `unfit`: why the kernel may find that it cannot be so.
std::string request_refusal(const std::string& path, unsigned offset, int error, const std::string& unfit) {
  if (error == EACCES || error == EPERM) return no_permission(path);
  if (error == EBUSY) {
    const auto chip = Chip::open(path);
    const std::string consumer = chip ? chip->line(offset).consumer : std::string();
    return "busy: held by " + (consumer.empty() ? "another program or a driver" : "\"" + consumer + "\"") +
           ": stop that, or take another line (gpioinfo lists them)";
  }
  if (error == EINVAL || error == EIO || error == ENXIO || error == ENOTSUP) return unfit;
  return "cannot be requested: " + std::generic_category().message(error);
}

}  // namespace

Found find(const LineName& name) {
  std::string path = path_meant(name);
  if (path.empty()) {
    const Chips chips = chips_in_dev();
    try {
      path = choose_chip(name, chips.facts).path;
    } catch (const std::runtime_error&) {
      // The label may be that of a chip which may not be asked.
      if (!chips.closed.empty()) refuse(name, chips.closed);
      throw;
    }
  }
  const auto chip = Chip::open(path);
  if (!chip) refuse(name, open_refusal(path, errno));
  return {path, choose_line(name, chip->facts(), lines_of(*chip))};
}

std::unique_ptr<LineRequest> request(const std::string& path, std::span<const WantedLine> lines,
                                     std::string_view consumer) {
  const std::string user(consumer);
  auto chip = Chip::open(path);
  if (!chip) refuse(lines.front().name, open_refusal(path, errno));
  if (auto made = Chip::request(std::move(chip), lines, user)) return made;
  const int error = errno;
  const std::string unfit = "the kernel does not make it an output: is it an input by design?";
  // Which of the lines it was: the one that is refused by itself, too. The others show their safe states meanwhile, as
  // they would have with the request.
  for (const WantedLine& line : lines) {
    auto again = Chip::open(path);
    if (again && !Chip::request(std::move(again), {&line, 1}, user)) {
      refuse(line.name, request_refusal(path, line.offset, errno, unfit));
    }
  }
  refuse(lines.front().name, request_refusal(path, lines.front().offset, error, unfit));
}

std::unique_ptr<InputRequest> request_inputs(const std::string& path, std::span<const WantedInput> lines,
                                             std::string_view consumer) {
  const std::string user(consumer);
  auto chip = Chip::open(path);
  if (!chip) refuse(lines.front().spec.name, open_refusal(path, errno));
  if (auto made = Chip::request_inputs(std::move(chip), lines, user)) return made;
  const int error = errno;
  const std::string unfit =
      "the kernel does not tell its edges: has the chip interrupts, and a bias of this kind? Leave the bias out, or "
      "take "
      "another line";
  for (const WantedInput& line : lines) {
    auto again = Chip::open(path);
    if (again && !Chip::request_inputs(std::move(again), {&line, 1}, user)) {
      refuse(line.spec.name, request_refusal(path, line.offset, errno, unfit));
    }
  }
  refuse(lines.front().spec.name, request_refusal(path, lines.front().offset, error, unfit));
}

std::vector<ChipListing> list_chips() {
  std::vector<ChipListing> listings;
  for (const std::string& path : chip_paths()) {
    ChipListing& listing = listings.emplace_back();
    listing.chip.path = path;
    if (const auto chip = Chip::open(path)) {
      listing.chip = chip->facts();
      listing.lines = lines_of(*chip);
    } else {
      listing.problem = open_refusal(path, errno);
    }
  }
  return listings;
}

}  // namespace stereotrack::gpio::gpiod
