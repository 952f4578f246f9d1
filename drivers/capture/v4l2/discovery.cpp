#include "drivers/capture/v4l2/discovery.hpp"

#include <linux/videodev2.h>

#include <algorithm>
#include <charconv>
#include <filesystem>
#include <string_view>
#include <system_error>

namespace stereotrack::capture::v4l2 {
namespace {

namespace fs = std::filesystem;

template <std::size_t N>
std::string text_of(const unsigned char (&text)[N]) {
  const auto* end = std::find(text, text + N, '\0');
  return {text, end};
}

/// N of /dev/videoN; -1: another name.
int number_of(const std::string& name) {
  constexpr std::string_view kStem = "video";
  int number = -1;
  if (!name.starts_with(kStem)) return -1;
  const char* const end = name.data() + name.size();
  const auto parsed = std::from_chars(name.data() + kStem.size(), end, number);
  return parsed.ec == std::errc() && parsed.ptr == end ? number : -1;
}

}  // namespace

bool can_capture(const Node& node) noexcept {
  constexpr std::uint32_t kCapture = V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_VIDEO_CAPTURE_MPLANE;
  return (node.capabilities & kCapture) != 0 && (node.capabilities & V4L2_CAP_STREAMING) != 0;
}

bool has_planes(const Node& node) noexcept {
  return (node.capabilities & V4L2_CAP_VIDEO_CAPTURE) == 0 && (node.capabilities & V4L2_CAP_VIDEO_CAPTURE_MPLANE) != 0;
}

Node describe(const Device& device, const std::string& path) {
  Node node;
  node.path = path;
  v4l2_capability facts{};
  if (const int error = device.ask(VIDIOC_QUERYCAP, facts); error != 0) {
    node.problem = path + " is not a camera: " + error_text(error);
    return node;
  }
  node.card = text_of(facts.card);
  node.bus = text_of(facts.bus_info);
  node.driver = text_of(facts.driver);
  node.capabilities = (facts.capabilities & V4L2_CAP_DEVICE_CAPS) != 0 ? facts.device_caps : facts.capabilities;
  return node;
}

std::vector<Node> list_nodes() {
  std::vector<std::pair<int, std::string>> paths;
  std::error_code ignored;
  for (const fs::directory_entry& entry : fs::directory_iterator("/dev", ignored)) {
    const int number = number_of(entry.path().filename().string());
    if (number >= 0 && !entry.is_symlink(ignored)) paths.emplace_back(number, entry.path().string());
  }
  std::sort(paths.begin(), paths.end());
  std::vector<Node> nodes;
  for (const auto& [number, path] : paths) {
    Device device;
    if (const int error = device.open(path); error != 0) {
      Node& node = nodes.emplace_back();
      node.path = path;
      node.problem = open_refusal(path, error);
    } else {
      nodes.push_back(describe(device, path));
    }
  }
  return nodes;
}

std::string cameras_text(std::span<const Node> nodes) {
  std::string list;
  for (const Node& node : nodes) {
    if (!node.problem.empty() || !can_capture(node)) continue;
    list += (list.empty() ? "" : ", ") + node.path + " (bus:" + node.bus + ", name:" + node.card + ")";
  }
  return list.empty() ? "there is no camera at all" : "there is " + list;
}

std::string choose_node(const std::string& name, std::span<const Node> nodes) {
  const bool by_bus = name.starts_with("bus:");
  if (!by_bus && !name.starts_with("name:")) {
    refuse(name, "want /dev/videoN, a link to it, bus:BUS or name:CARD; " + cameras_text(nodes));
  }
  const std::string wanted = name.substr(name.find(':') + 1);
  const Node* found = nullptr;
  for (const Node& node : nodes) {
    if (!node.problem.empty() || !can_capture(node) || (by_bus ? node.bus : node.card) != wanted) continue;
    if (found != nullptr) {
      refuse(name, std::string("several are ") + (by_bus ? "on that bus" : "called that") + ": name one by its path" +
                       (by_bus ? "" : " or bus") + "; " + cameras_text(nodes));
    }
    found = &node;
  }
  if (found != nullptr) return found->path;
  const auto closed = std::find_if(nodes.begin(), nodes.end(), [](const Node& n) { return !n.problem.empty(); });
  refuse(name, std::string("none is ") + (by_bus ? "on that bus" : "called that") + "; " + cameras_text(nodes) +
                   (closed == nodes.end() ? std::string() : "; " + closed->problem));
}

std::string find_node(const std::string& name) {
  if (name.find('/') == std::string::npos || name.starts_with("bus:") || name.starts_with("name:")) {
    return choose_node(name, list_nodes());
  }
  std::error_code error;
  const fs::path path = fs::canonical(name, error);
  if (error) refuse(name, "is not there: plug it in, or load its driver; " + cameras_text(list_nodes()));
  return path.string();
}

}  // namespace stereotrack::capture::v4l2
