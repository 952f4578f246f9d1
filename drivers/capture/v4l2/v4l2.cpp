#include "drivers/capture/v4l2/v4l2.hpp"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <system_error>
#include <utility>

#include "drivers/capture/v4l2/controls.hpp"
#include "drivers/capture/v4l2/discovery.hpp"
#include "drivers/capture/v4l2/layout.hpp"
#include "drivers/capture/v4l2/media.hpp"
#include "drivers/capture/v4l2/stream.hpp"

namespace stereotrack::capture::v4l2 {
namespace {

namespace fs = std::filesystem;

/// Names of udev's making for the node.
std::vector<std::string> links_to(const std::string& path) {
  std::vector<std::string> links;
  for (const char* const folder : {"/dev/v4l/by-id", "/dev/v4l/by-path"}) {
    std::error_code error;
    for (const fs::directory_entry& entry : fs::directory_iterator(folder, error)) {
      if (fs::canonical(entry.path(), error) == path) links.push_back(entry.path().string());
    }
  }
  std::sort(links.begin(), links.end());
  return links;
}

CameraFacts facts_of(const Node& node) {
  CameraFacts facts;
  facts.path = node.path;
  facts.card = node.card;
  facts.bus = node.bus;
  facts.driver = node.driver;
  facts.problem = node.problem;
  Device device;
  if (!node.problem.empty() || device.open(node.path) != 0) return facts;
  facts.links = links_to(node.path);
  for (const auto& [fourcc, range_choice] : list_formats(device, has_planes(node))) {
    CameraFacts::Format& format = facts.formats.emplace_back();
    format.fourcc = fourcc_text(fourcc);
    if (const KnownFormat* const known = find_format(fourcc)) format.name = known->name;
    for (const OfferedSize& size : list_sizes(device, fourcc)) {
      format.sizes.push_back({size.width, size.height, size.max_width, size.max_height,
                              list_rates(device, fourcc, size.max_width, size.max_height)});
    }
  }
  for (const Control& control : list_controls(device)) {
    facts.controls.push_back({control.name, control.minimum, control.maximum, control.step, control.standard,
                              read_control(device, control.id)});
  }
  return facts;
}

}  // namespace

std::unique_ptr<Camera> open(const Settings& settings, std::vector<std::string>* notes) {
  const std::string path = find_node(settings.device);
  const std::string name = settings.device == path ? path : settings.device + " (" + path + ")";

  Stream::Parts parts;
  if (const int error = parts.node.open(path); error != 0) refuse(settings.device, open_refusal(path, error));
  const Node node = describe(parts.node, path);
  if (!node.problem.empty() || !can_capture(node)) {
    refuse(name, "is no camera: nothing can be captured from it; " + cameras_text(list_nodes()));
  }

  std::vector<std::string> told;
  Settings wanted = settings;
  std::optional<SensorPart> sensor = connect_sensor(parts.node, node, wanted, name);
  parts.layout = set_layout(parts.node, has_planes(node), wanted, name);
  const Layout& layout = parts.layout;
  const std::uint32_t fourcc = layout.format->fourcc;
  const Device& exposes = sensor ? sensor->device : parts.node;
  const LineTiming timing = sensor ? line_timing(exposes, sensor->width, sensor->height)
                                   : line_timing(exposes, layout.frame_width, layout.frame_height);
  auto period = sensor ? set_sensor_period(exposes, timing, settings.fps, told) : std::nullopt;
  if (!period) period = set_period(parts.node, layout, settings.fps, told);
  if (!period && settings.fps > 0) period = from_us(1e6 / settings.fps);
  if (!period) refuse(name, "the driver does not tell its frame rate: set it (fps)");

  std::vector<const Device*> devices;
  if (sensor) devices.push_back(&exposes);
  devices.push_back(&parts.node);
  parts.controls = set_controls(settings, devices, sensor ? sensor->name : node.card, timing, told);
  parts.controls_on_sensor = sensor && parts.controls.device() == 0;
  parts.control_delay_frames = settings.control_delay_frames;

  if (settings.readout_us) {
    parts.readout = from_us(*settings.readout_us);
  } else if (timing.known()) {
    parts.readout = from_us(timing.line.count() * timing.rows);
  }
  const auto shortest = shortest_period(parts.node, fourcc, layout.frame_width, layout.frame_height);
  parts.most_readout = std::min(*period, shortest ? *shortest : *period);
  parts.guesses_readout = settings.guesses_readout;

  parts.info.name = name;
  parts.info.model = (sensor ? sensor->name : node.card) + ", " + node.bus;
  if (sensor && parts.pacer.open_beside(exposes) == 0) parts.paces = row_period(parts.pacer, timing);
  if (sensor) parts.sensor = std::move(sensor->device);
  parts.info.width = layout.width;
  parts.info.height = layout.height;
  parts.info.format = layout.format->format;
  parts.info.period = *period;
  parts.info.counts_lost = true;
  parts.buffers = settings.buffers < 0 ? 0 : static_cast<std::size_t>(settings.buffers);
  parts.memory = settings.memory;
  parts.heap = settings.heap;
  auto stream = std::make_unique<Stream>(std::move(parts), told);
  if (notes != nullptr) {
    for (const std::string& note : told) notes->push_back("camera " + name + ": " + note);
  }
  return stream;
}

std::vector<CameraFacts> list_cameras() {
  std::vector<CameraFacts> cameras;
  for (const Node& node : list_nodes()) {
    if (!node.problem.empty() || can_capture(node)) cameras.push_back(facts_of(node));
  }
  return cameras;
}

}  // namespace stereotrack::capture::v4l2
