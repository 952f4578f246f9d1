#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "drivers/capture/v4l2/device.hpp"

namespace stereotrack::capture::v4l2 {

/// A video node, as its driver describes it.
struct Node {
  std::string path;  ///< /dev/video0
  std::string card;
  std::string bus;
  std::string driver;
  std::uint32_t capabilities = 0;  ///< V4L2_CAP_*, of this node
  std::string problem;             ///< why it could not be asked; empty: it could
};

/// Whether frames can be had from it, in buffers.
[[nodiscard]] bool can_capture(const Node& node) noexcept;
[[nodiscard]] bool has_planes(const Node& node) noexcept;  ///< it speaks the multi-planar interface

/// Asks an open one.
[[nodiscard]] Node describe(const Device& device, const std::string& path);

/// All /dev/videoN, by number.
[[nodiscard]] std::vector<Node> list_nodes();

/// For messages: "there is /dev/video0 (bus:..., name:...), ...", or that there is none.
[[nodiscard]] std::string cameras_text(std::span<const Node> nodes);

/// The path of the one that is meant by bus:BUS or name:CARD. Throws std::runtime_error with one line that lists what
/// there is: none or several of that name, or one that may not be asked.
[[nodiscard]] std::string choose_node(const std::string& name, std::span<const Node> nodes);

/// What is meant by Settings::device: a path without links. Throws std::runtime_error as choose_node() does.
[[nodiscard]] std::string find_node(const std::string& name);

}  // namespace stereotrack::capture::v4l2
