#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "drivers/capture/v4l2/controls.hpp"
#include "drivers/capture/v4l2/device.hpp"
#include "drivers/capture/v4l2/discovery.hpp"
#include "drivers/capture/v4l2/v4l2.hpp"

namespace stereotrack::capture::v4l2 {

/// The parts of a camera whose driver leaves it to the program to put them together (media controller).
struct MediaGraph {
  struct Entity {
    std::uint32_t id = 0;
    std::string name;
    bool is_sensor = false;
  };
  struct Pad {
    std::uint32_t id = 0;
    std::uint32_t entity = 0;
    std::uint32_t index = 0;
    bool is_source = false;
  };
  struct Link {
    std::uint32_t source = 0;  ///< a pad
    std::uint32_t sink = 0;
    bool enabled = false;
    bool immutable = false;
  };
  /// A device node of an entity.
  struct Interface {
    std::uint32_t entity = 0;
    std::uint32_t major = 0;
    std::uint32_t minor = 0;
  };
  std::vector<Entity> entities;
  std::vector<Pad> pads;
  std::vector<Link> links;
  std::vector<Interface> interfaces;
};

/// Links from a sensor to the entity, sensor first: the way on which the fewest have to be enabled. `sensor`: its name
/// or the beginning of it; empty: any. Empty: there is none.
[[nodiscard]] std::vector<std::size_t> way_from_sensor(const MediaGraph& graph, std::uint32_t entity,
                                                       const std::string& sensor);

/// A sensor that a video node was connected with.
struct SensorPart {
  Device device;
  std::string name;
  int width = 0;  ///< that it sends [px]
  int height = 0;
};
/// Where the node belongs to such a camera: enables the links from its sensor, sets the same format and size on all
/// pads of the way, disables or fits what hangs on its parts besides, and narrows `wanted` down to what the node then
/// has to be set to. Empty: it belongs to none. Throws std::runtime_error, one line: no sensor leads there, or none of
/// the formats passes.
[[nodiscard]] std::optional<SensorPart> connect_sensor(const Device& node, const Node& facts, Settings& wanted,
                                                       const std::string& name);

/// The frame rate of a sensor: by its blank rows, or by its interval. Empty: it has no control of it.
[[nodiscard]] std::optional<std::chrono::nanoseconds> set_sensor_period(const Device& sensor, const LineTiming& timing,
                                                                        double fps, std::vector<std::string>& notes);

}  // namespace stereotrack::capture::v4l2
