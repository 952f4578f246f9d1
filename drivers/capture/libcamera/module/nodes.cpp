#include "drivers/capture/libcamera/module/nodes.hpp"

#include <sys/stat.h>
#include <sys/sysmacros.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <system_error>

namespace stereotrack::libcamera_module {
namespace {

bool is_among(const Node& node, const std::vector<Node>& nodes) {
  return std::find(nodes.begin(), nodes.end(), node) != nodes.end();
}

}  // namespace

std::vector<Node> list_nodes() {
  std::vector<Node> nodes;
  std::error_code none;
  for (const auto& entry : std::filesystem::directory_iterator("/sys/class/video4linux", none)) {
    std::ifstream file(entry.path() / "dev");
    unsigned int major = 0;
    unsigned int minor = 0;
    char colon = 0;
    struct stat folder {};
    if (file >> major >> colon >> minor && ::stat(entry.path().c_str(), &folder) == 0) {
      nodes.push_back({makedev(major, minor), folder.st_ino});
    }
  }
  return nodes;
}

bool are_there(const std::vector<Node>& nodes) {
  const std::vector<Node> now = list_nodes();
  return std::all_of(nodes.begin(), nodes.end(), [&](const Node& node) { return is_among(node, now); });
}

bool are_there_others(const std::vector<Node>& than) {
  const std::vector<Node> now = list_nodes();
  return std::any_of(now.begin(), now.end(), [&](const Node& node) { return !is_among(node, than); });
}

}  // namespace stereotrack::libcamera_module
