#pragma once

#include <sys/types.h>

#include <vector>

namespace stereotrack::libcamera_module {

/// A video device as it was plugged in: one that was unplugged and comes back with the same number is another.
struct Node {
  dev_t number = 0;
  ino_t identity = 0;  ///< of its folder in sysfs, which is made anew each time
  friend bool operator==(const Node&, const Node&) = default;
};

/// Those that there are now. Throws std::bad_alloc alone.
[[nodiscard]] std::vector<Node> list_nodes();

/// All of them are still there.
[[nodiscard]] bool are_there(const std::vector<Node>& nodes);

/// There are some that are not among these.
[[nodiscard]] bool are_there_others(const std::vector<Node>& than);

}  // namespace stereotrack::libcamera_module
