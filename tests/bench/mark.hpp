#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace stereotrack::bench {

/// Tells whoever counts this program's instructions which of its work is whose. On x86-64 that is callgrind (start it
/// with --instr-atstart=no): each mark dumps what was counted since the last one under its name. On 64-bit ARM it is
/// the plugin qemu_count.c, which a mark reaches as a system call that no kernel has, with a number instead of the
/// name. Where nobody counts, nothing happens. Marks cost a few dozen instructions. One thread.
class Marks {
 public:
  /// The number of a name, from 1.
  [[nodiscard]] std::size_t number_of(std::string name);

  /// What was done since the last mark is nobody's; from here on it counts.
  void begin() noexcept;
  /// What was done since the last mark is `number`'s.
  void was(std::size_t number) const noexcept;
  /// What is done until the next begin() is nobody's.
  void end() noexcept;

  /// In the order of their numbers.
  [[nodiscard]] const std::vector<std::string>& names() const noexcept { return names_; }

 private:
  std::vector<std::string> names_;
};

}  // namespace stereotrack::bench
