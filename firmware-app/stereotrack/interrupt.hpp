#pragma once

namespace stereotrack {

/// Ctrl-C and SIGTERM ask for an end instead of ending the program: loops look at interrupted() and leave in
/// order. A second one ends at once, as usual.
void catch_interrupts();
[[nodiscard]] bool interrupted() noexcept;

}  // namespace stereotrack
