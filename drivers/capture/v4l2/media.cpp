#include "drivers/capture/v4l2/media.hpp"

#include <linux/media.h>
#include <linux/v4l2-subdev.h>
#include <linux/videodev2.h>
#include <sys/stat.h>
#include <sys/sysmacros.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <deque>
#include <filesystem>
#include <fstream>
#include <map>
#include <system_error>

#include "drivers/capture/v4l2/formats.hpp"

namespace stereotrack::capture::v4l2 {
namespace {

namespace fs = std::filesystem;

template <class Items>
auto* find_by_id(Items& items, std::uint32_t id) {
  const auto found = std::find_if(items.begin(), items.end(), [&](const auto& item) { return item.id == id; });
  return found == items.end() ? nullptr : &*found;
}

std::uint64_t address_of(auto& values) { return reinterpret_cast<std::uintptr_t>(values.data()); }

bool read_graph(const Device& media, MediaGraph& graph) {
  media_v2_topology counts{};
  if (media.ask(MEDIA_IOC_G_TOPOLOGY, counts) != 0) return false;
  std::vector<media_v2_entity> entities(counts.num_entities);
  std::vector<media_v2_interface> interfaces(counts.num_interfaces);
  std::vector<media_v2_pad> pads(counts.num_pads);
  std::vector<media_v2_link> links(counts.num_links);
  counts.ptr_entities = address_of(entities);
  counts.ptr_interfaces = address_of(interfaces);
  counts.ptr_pads = address_of(pads);
  counts.ptr_links = address_of(links);
  // ENOSPC, where it has grown meanwhile: then it is the next camera's that is just being plugged in.
  if (media.ask(MEDIA_IOC_G_TOPOLOGY, counts) != 0) return false;
  for (const auto& entity : entities) {
    graph.entities.push_back({entity.id, entity.name, entity.function == MEDIA_ENT_F_CAM_SENSOR});
  }
  for (const auto& pad : pads) {
    graph.pads.push_back({pad.id, pad.entity_id, pad.index, (pad.flags & MEDIA_PAD_FL_SOURCE) != 0});
  }
  for (const auto& link : links) {
    if ((link.flags & MEDIA_LNK_FL_LINK_TYPE) == MEDIA_LNK_FL_DATA_LINK) {
      graph.links.push_back({link.source_id, link.sink_id, (link.flags & MEDIA_LNK_FL_ENABLED) != 0,
                             (link.flags & MEDIA_LNK_FL_IMMUTABLE) != 0});
    } else if (const auto* const node = find_by_id(interfaces, link.source_id)) {
      graph.interfaces.push_back({link.sink_id, node->devnode.major, node->devnode.minor});
    }
  }
  return true;
}

/// The camera that a video node belongs to.
struct Found {
  Device media;
  MediaGraph graph;
  std::uint32_t entity = 0;  ///< the node's
};

std::optional<Found> find_media(const std::string& path) {
  struct stat node {};
  if (::stat(path.c_str(), &node) != 0) return std::nullopt;
  std::error_code ignored;
  for (const fs::directory_entry& entry : fs::directory_iterator("/dev", ignored)) {
    if (!entry.path().filename().string().starts_with("media")) continue;
    Found found;
    if (found.media.open(entry.path().string()) != 0 || !read_graph(found.media, found.graph)) continue;
    for (const MediaGraph::Interface& interface : found.graph.interfaces) {
      if (interface.major != major(node.st_rdev) || interface.minor != minor(node.st_rdev)) continue;
      found.entity = interface.entity;
      return found;
    }
  }
  return std::nullopt;
}

/// /dev/v4l-subdevN, by its number.
std::string node_of(const MediaGraph& graph, std::uint32_t entity) {
  for (const MediaGraph::Interface& interface : graph.interfaces) {
    if (interface.entity != entity) continue;
    std::ifstream facts("/sys/dev/char/" + std::to_string(interface.major) + ":" + std::to_string(interface.minor) +
                        "/uevent");
    constexpr std::string_view kKey = "DEVNAME=";
    for (std::string line; std::getline(facts, line);) {
      if (line.starts_with(kKey)) return "/dev/" + line.substr(kKey.size());
    }
  }
  return {};
}

/// One sub-device on the way, and the pads by which pictures enter and leave it.
struct Step {
  Device device;
  std::uint32_t sink = 0;  ///< of no meaning for the sensor
  std::uint32_t source = 0;
};

std::vector<std::uint32_t> codes_of(const Step& step) {
  std::vector<std::uint32_t> codes;
  v4l2_subdev_mbus_code_enum query{};
  for (std::uint32_t index = 0;; ++index) {
    query = {};
    query.pad = step.source;
    query.index = index;
    query.which = V4L2_SUBDEV_FORMAT_ACTIVE;
    if (step.device.ask(VIDIOC_SUBDEV_ENUM_MBUS_CODE, query) != 0) return codes;
    codes.push_back(query.code);
  }
}

std::optional<v4l2_mbus_framefmt> set_pad(const Device& device, std::uint32_t pad, const v4l2_mbus_framefmt& wanted) {
  v4l2_subdev_format format{};
  format.which = V4L2_SUBDEV_FORMAT_ACTIVE;
  format.pad = pad;
  format.format = wanted;
  if (device.ask(VIDIOC_SUBDEV_S_FMT, format) != 0) return std::nullopt;
  return format.format;
}

std::optional<v4l2_mbus_framefmt> get_pad(const Device& device, std::uint32_t pad) {
  v4l2_subdev_format format{};
  format.which = V4L2_SUBDEV_FORMAT_ACTIVE;
  format.pad = pad;
  if (device.ask(VIDIOC_SUBDEV_G_FMT, format) != 0) return std::nullopt;
  return format.format;
}

/// The way set to `first` at the sensor, and to `last` where it leaves the last sub-device. What leaves it; empty: a
/// part refuses.
std::optional<v4l2_mbus_framefmt> set_way(const std::vector<Step>& way, v4l2_mbus_framefmt first,
                                          std::optional<std::uint32_t> last) {
  auto format = set_pad(way.front().device, way.front().source, first);
  if (!format || format->code != first.code) return std::nullopt;
  for (std::size_t i = 1; i < way.size(); ++i) {
    const auto entered = set_pad(way[i].device, way[i].sink, *format);
    if (!entered || entered->code != format->code) return std::nullopt;
    auto leaving = get_pad(way[i].device, way[i].source);
    if (!leaving) return std::nullopt;
    leaving->width = first.width;
    leaving->height = first.height;
    if (i + 1 == way.size() && last) leaving->code = *last;
    format = set_pad(way[i].device, way[i].source, *leaving);
    if (!format) return std::nullopt;
  }
  return format;
}

/// Formats into which a node can put what arrives as `code`.
std::vector<std::uint32_t> formats_of_code(const Device& node, bool planes, std::uint32_t code) {
  std::vector<std::uint32_t> formats;
  v4l2_fmtdesc query{};
  for (std::uint32_t index = 0;; ++index) {
    query = {};
    query.index = index;
    query.type = planes ? V4L2_BUF_TYPE_VIDEO_CAPTURE_MPLANE : V4L2_BUF_TYPE_VIDEO_CAPTURE;
    query.mbus_code = code;
    if (node.ask(VIDIOC_ENUM_FMT, query) != 0) return formats;
    formats.push_back(query.pixelformat);
  }
}

int set_link(const Found& found, const MediaGraph::Link& link, bool enabled) {
  const MediaGraph::Pad* const source = find_by_id(found.graph.pads, link.source);
  const MediaGraph::Pad* const sink = find_by_id(found.graph.pads, link.sink);
  if (source == nullptr || sink == nullptr) return EINVAL;
  media_link_desc wish{};
  wish.source.entity = source->entity;
  wish.source.index = static_cast<std::uint16_t>(source->index);
  wish.source.flags = MEDIA_PAD_FL_SOURCE;
  wish.sink.entity = sink->entity;
  wish.sink.index = static_cast<std::uint16_t>(sink->index);
  wish.sink.flags = MEDIA_PAD_FL_SINK;
  wish.flags = enabled ? MEDIA_LNK_FL_ENABLED : 0;
  return found.media.ask(MEDIA_IOC_SETUP_LINK, wish);
}

void enable_way(Found& found, const std::vector<std::size_t>& way, const std::string& name) {
  for (const std::size_t index : way) {
    MediaGraph::Link& link = found.graph.links[index];
    if (link.enabled) continue;
    // A pad takes one picture at a time.
    for (MediaGraph::Link& other : found.graph.links) {
      if (other.sink != link.sink || !other.enabled || other.immutable) continue;
      if (set_link(found, other, false) == 0) other.enabled = false;
    }
    if (const int error = set_link(found, link, true); error != 0) {
      refuse(name, std::string("its parts cannot be connected (") + error_text(error) +
                       "): stop the program that uses them, media-ctl -p shows them");
    }
    link.enabled = true;
  }
}

/// Puts a video node of a side way into what reaches it there.
void set_side_node(const Device& node, const std::string& path, const v4l2_mbus_framefmt& format) {
  const bool planes = has_planes(describe(node, path));
  const std::vector<std::uint32_t> fourccs = formats_of_code(node, planes, format.code);
  v4l2_format wish{};
  wish.type = planes ? V4L2_BUF_TYPE_VIDEO_CAPTURE_MPLANE : V4L2_BUF_TYPE_VIDEO_CAPTURE;
  if (fourccs.empty() || node.ask(VIDIOC_G_FMT, wish) != 0) return;
  if (planes) {
    wish.fmt.pix_mp.pixelformat = fourccs.front();
    wish.fmt.pix_mp.width = format.width;
    wish.fmt.pix_mp.height = format.height;
  } else {
    wish.fmt.pix.pixelformat = fourccs.front();
    wish.fmt.pix.width = format.width;
    wish.fmt.pix.height = format.height;
    wish.fmt.pix.bytesperline = 0;
  }
  (void)node.ask(VIDIOC_S_FMT, wish);
}

/// What else hangs on the entity: the kernel does not start a stream while any link that is enabled, on the way or
/// beside it, has two formats. Links that can be are disabled; what hangs on the others gets the format that comes.
/// What refuses is told by STREAMON.
void settle_sides(Found& found, const std::vector<std::size_t>& way, std::uint32_t entity, std::size_t depth) {
  constexpr std::size_t kDeepest = 16;
  if (depth == kDeepest) return;
  Device device;
  if (device.open(node_of(found.graph, entity)) != 0) return;
  for (std::size_t i = 0; i < found.graph.links.size(); ++i) {
    MediaGraph::Link& link = found.graph.links[i];
    const MediaGraph::Pad* const source = find_by_id(found.graph.pads, link.source);
    const MediaGraph::Pad* const sink = find_by_id(found.graph.pads, link.sink);
    if (source == nullptr || sink == nullptr || source->entity != entity || !link.enabled) continue;
    if (std::find(way.begin(), way.end(), i) != way.end()) continue;
    if (!link.immutable && set_link(found, link, false) == 0) {
      link.enabled = false;
      continue;
    }
    const auto format = get_pad(device, source->index);
    const std::string path = node_of(found.graph, sink->entity);
    Device side;
    if (!format || side.open(path) != 0) continue;
    if (set_pad(side, sink->index, *format)) {
      settle_sides(found, way, sink->entity, depth + 1);
    } else {
      set_side_node(side, path, *format);
    }
  }
}

}  // namespace

std::vector<std::size_t> way_from_sensor(const MediaGraph& graph, std::uint32_t entity, const std::string& sensor) {
  // Backwards from the node; a link that has to be enabled costs more than any way of enabled ones.
  struct Reached {
    std::size_t cost = 0;
    std::vector<std::size_t> way;
  };
  std::map<std::uint32_t, Reached> reached{{entity, {}}};
  std::deque<std::uint32_t> open{entity};
  while (!open.empty()) {
    const std::uint32_t at = open.front();
    open.pop_front();
    const Reached here = reached[at];
    for (std::size_t i = 0; i < graph.links.size(); ++i) {
      const MediaGraph::Pad* const sink = find_by_id(graph.pads, graph.links[i].sink);
      const MediaGraph::Pad* const source = find_by_id(graph.pads, graph.links[i].source);
      if (sink == nullptr || source == nullptr || sink->entity != at) continue;
      const std::size_t cost = here.cost + 1 + (graph.links[i].enabled ? 0 : graph.links.size());
      const auto known = reached.find(source->entity);
      if (known != reached.end() && known->second.cost <= cost) continue;
      Reached next{cost, here.way};
      next.way.insert(next.way.begin(), i);
      reached[source->entity] = std::move(next);
      open.push_back(source->entity);
    }
  }
  const Reached* best = nullptr;
  for (const MediaGraph::Entity& candidate : graph.entities) {
    const auto found = reached.find(candidate.id);
    if (!candidate.is_sensor || !candidate.name.starts_with(sensor) || found == reached.end()) continue;
    if (best == nullptr || found->second.cost < best->cost) best = &found->second;
  }
  return best == nullptr ? std::vector<std::size_t>() : best->way;
}

std::optional<SensorPart> connect_sensor(const Device& node, const Node& facts, Settings& wanted,
                                         const std::string& name) {
  if ((facts.capabilities & V4L2_CAP_IO_MC) == 0) return std::nullopt;
  std::optional<Found> found = find_media(facts.path);
  if (!found) refuse(name, "its media device cannot be read: add the program's user to the group video");
  const MediaGraph& graph = found->graph;
  const std::vector<std::size_t> links = way_from_sensor(graph, found->entity, wanted.sensor);
  if (links.empty()) {
    std::string sensors;
    for (const MediaGraph::Entity& entity : graph.entities) {
      if (entity.is_sensor) sensors += (sensors.empty() ? "" : ", ") + entity.name;
    }
    refuse(name, "no sensor" + (wanted.sensor.empty() ? std::string() : " " + wanted.sensor) +
                     " leads to it; there is " + (sensors.empty() ? "none" : sensors) +
                     ": choose another node or sensor");
  }
  enable_way(*found, links, name);

  std::vector<Step> way;
  SensorPart part;
  std::uint32_t sink = 0;
  for (const std::size_t index : links) {
    const MediaGraph::Pad* const source = find_by_id(graph.pads, graph.links[index].source);
    const MediaGraph::Entity* const entity = find_by_id(graph.entities, source->entity);
    const std::string path = node_of(graph, source->entity);
    Step& step = way.emplace_back();
    step.sink = sink;
    step.source = source->index;
    const int error = path.empty() ? ENOENT : step.device.open(path);
    if (error != 0) refuse(name, "its part " + entity->name + ": " + open_refusal(path, error));
    if (way.size() == 1) part.name = entity->name;
    sink = find_by_id(graph.pads, graph.links[index].sink)->index;
  }

  auto first = get_pad(way.front().device, way.front().source);
  if (!first) refuse(name, "its sensor " + part.name + " does not tell its format");
  if (wanted.width > 0) first->width = static_cast<std::uint32_t>(wanted.width);
  if (wanted.height > 0) first->height = static_cast<std::uint32_t>(wanted.height);

  // The best of all ways through: what the node can make of what each code of the sensor becomes on the way.
  struct Choice {
    const KnownFormat* format = nullptr;
    std::uint32_t first = 0;
    std::uint32_t last = 0;
  };
  Choice best;
  std::string offered;
  for (const std::uint32_t code : codes_of(way.front())) {
    std::vector<std::uint32_t> last = {code};
    if (way.size() > 1) {
      first->code = code;
      if (!set_way(way, *first, std::nullopt)) continue;
      last = codes_of(way.back());
    }
    for (const std::uint32_t leaving : last) {
      for (const std::uint32_t fourcc : formats_of_code(node, has_planes(facts), leaving)) {
        const KnownFormat* const known = find_format(fourcc);
        if (known == nullptr) continue;
        const std::string mark = std::string(known->name) + " ";
        if (offered.find(mark) == std::string::npos) offered += mark;
        if (wanted.format != "auto" && wanted.format != known->name) continue;
        if (best.format == nullptr || known < best.format) best = {known, code, leaving};
      }
    }
  }
  if (best.format == nullptr) {
    refuse(name, "has no format " + wanted.format + "; its sensor " + part.name + " offers " +
                     (offered.empty() ? "none that can be used" : offered.substr(0, offered.size() - 1)));
  }
  first->code = best.first;
  const auto arrives = set_way(way, *first, best.last);
  const auto sent = get_pad(way.front().device, way.front().source);
  if (!arrives || !sent || arrives->code != best.last) {
    refuse(name, "its parts refuse the format " + std::string(best.format->name) + ": choose another");
  }
  const int width = static_cast<int>(arrives->width);
  const int height = static_cast<int>(arrives->height);
  if ((wanted.width > 0 && wanted.width != width) || (wanted.height > 0 && wanted.height != height)) {
    refuse(name, std::to_string(wanted.width) + "x" + std::to_string(wanted.height) + " cannot be had, its sensor " +
                     part.name + " makes it " + std::to_string(width) + "x" + std::to_string(height));
  }
  for (const std::size_t index : links) {
    settle_sides(*found, links, find_by_id(graph.pads, graph.links[index].source)->entity, 0);
  }
  wanted.width = width;
  wanted.height = height;
  wanted.format = best.format->name;
  part.width = static_cast<int>(sent->width);
  part.height = static_cast<int>(sent->height);
  part.device = std::move(way.front().device);
  return part;
}

std::optional<std::chrono::nanoseconds> set_sensor_period(const Device& sensor, const LineTiming& timing, double fps,
                                                          std::vector<std::string>& notes) {
  std::optional<double> made;
  if (const auto blank = find_control(sensor, V4L2_CID_VBLANK); blank && timing.known()) {
    const double line_us = timing.line.count();
    if (fps > 0) (void)write_control(sensor, *blank, nearest_value(*blank, 1e6 / (fps * line_us) - timing.rows));
    const auto rows = read_control(sensor, V4L2_CID_VBLANK);
    if (rows) made = 1e6 / (line_us * static_cast<double>(timing.rows + *rows));
  } else {
    v4l2_subdev_frame_interval interval{};
    if (sensor.ask(VIDIOC_SUBDEV_G_FRAME_INTERVAL, interval) != 0) return std::nullopt;
    if (fps > 0) {
      interval.interval = {1000, static_cast<std::uint32_t>(std::lround(fps * 1000))};
      (void)sensor.ask(VIDIOC_SUBDEV_S_FRAME_INTERVAL, interval);
      (void)sensor.ask(VIDIOC_SUBDEV_G_FRAME_INTERVAL, interval);
    }
    if (interval.interval.numerator == 0 || interval.interval.denominator == 0) return std::nullopt;
    made = static_cast<double>(interval.interval.denominator) / static_cast<double>(interval.interval.numerator);
  }
  if (!made) return std::nullopt;
  if (fps > 0 && std::abs(*made - fps) > 0.01 * fps) {
    char text[96];
    std::snprintf(text, sizeof text, "%.3g frames a second: its sensor makes it %.4g", fps, *made);
    notes.emplace_back(text);
  }
  return std::chrono::nanoseconds(std::llround(1e9 / *made));
}

}  // namespace stereotrack::capture::v4l2
