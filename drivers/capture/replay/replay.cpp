#include "drivers/capture/replay/replay.hpp"

#include <algorithm>
#include <array>
#include <filesystem>
#include <stdexcept>
#include <utility>
#include <vector>

#include "drivers/capture/replay/folder_source.hpp"
#include "drivers/capture/replay/silence.hpp"
#include "drivers/capture/replay/video_source.hpp"

namespace stereotrack::capture {
namespace {

namespace fs = std::filesystem;

constexpr const char* kForms =
    "a EuRoC folder (mav0), a KITTI folder (image_0 image_1), a folder with left/ and right/, sbs:VIDEO, LEFT,RIGHT "
    "or mono:PATH";
constexpr const char* kPictureKinds = "png, jpg, bmp, pgm, ppm or tif";
constexpr int kLevelsDown = 3;

/// Two views of one recording, by the folders that hold them.
struct Recording {
  enum class Kind : std::uint8_t { kFolders, kKitti, kEuroc };
  Kind kind = Kind::kFolders;
  fs::path left;
  fs::path right;
};

struct Layout {
  Recording::Kind kind;
  const char* left;
  const char* right;
};
/// In this order: KITTI's grey views stand before its colour ones, as P0 and P1 do in its calib.txt.
constexpr std::array<Layout, 4> kLayouts{{{Recording::Kind::kEuroc, "cam0", "cam1"},
                                          {Recording::Kind::kKitti, "image_0", "image_1"},
                                          {Recording::Kind::kKitti, "image_2", "image_3"},
                                          {Recording::Kind::kFolders, "left", "right"}}};

[[noreturn]] void fail(const std::string& what, const std::string& why) { throw std::runtime_error(what + ": " + why); }

bool is_folder(const fs::path& path) {
  std::error_code error;
  return fs::is_directory(path, error);
}

bool is_video_name(const fs::path& path) {
  static constexpr std::array<const char*, 8> kExtensions{".avi", ".mp4", ".mkv", ".mov",
                                                          ".AVI", ".MP4", ".MKV", ".MOV"};
  const std::string extension = path.extension().string();
  return std::find(kExtensions.begin(), kExtensions.end(), extension) != kExtensions.end();
}

/// The views directly in `folder`. Throws if it has one of them alone.
std::vector<Recording> views_in(const fs::path& folder) {
  std::string alone;
  for (const Layout& layout : kLayouts) {
    const fs::path left = folder / layout.left;
    const fs::path right = folder / layout.right;
    if (is_folder(left) && is_folder(right)) return {{layout.kind, left, right}};
    if (is_folder(left) != is_folder(right) && alone.empty()) {
      const fs::path& there = is_folder(left) ? left : right;
      const fs::path& missing = is_folder(left) ? right : left;
      alone = there.string() + ": has no " + missing.string() + " beside it: add it, or give mono:" + there.string();
    }
  }
  if (!alone.empty()) throw std::runtime_error(alone);
  return {};
}

void search(const fs::path& folder, int levels, std::vector<Recording>& found, std::vector<std::string>& names) {
  for (Recording& recording : views_in(folder)) {
    found.push_back(std::move(recording));
    names.push_back(folder.string());
  }
  if (!found.empty() && names.back() == folder.string()) return;
  std::vector<fs::path> below;
  std::error_code error;
  for (fs::directory_iterator entry(folder, error); !error && entry != fs::directory_iterator();
       entry.increment(error)) {
    if (entry->is_directory(error) && !entry->is_symlink(error)) {
      below.push_back(entry->path());
    } else if (is_video_name(entry->path())) {
      names.push_back("sbs:" + entry->path().string());
    }
  }
  if (error) fail(folder.string(), "cannot list the folder: " + error.message());
  std::sort(below.begin(), below.end());
  if (levels == 0) return;
  for (const fs::path& sub : below) search(sub, levels - 1, found, names);
}

Recording find_recording(const fs::path& folder) {
  std::vector<Recording> found;
  std::vector<std::string> names;
  search(folder, kLevelsDown, found, names);
  if (found.size() == 1 && names.size() == 1) return found.front();
  if (names.size() > 1) {
    fail(folder.string(), "holds several recordings: give one, like " + names[0] + " or " + names[1]);
  }
  if (names.size() == 1) fail(folder.string(), "holds no folders of pictures, but a video: give " + names.front());
  if (!list_pictures(folder).empty()) {
    fail(folder.string(), "holds pictures of one view: give the folder above it, or mono:" + folder.string());
  }
  fail(folder.string(), "no recording found in it: give " + std::string(kForms));
}

void require_pictures(const View& view, const fs::path& folder) {
  if (view.empty()) fail(folder.string(), "holds no pictures (" + std::string(kPictureKinds) + ")");
}

View list_view(Recording::Kind kind, const fs::path& folder) {
  View view = kind == Recording::Kind::kEuroc ? list_euroc_camera(folder) : list_pictures(folder);
  require_pictures(view, folder);
  return view;
}

/// Line k of times.txt belongs to picture number k, so that a cut of a sequence may keep the whole file.
void apply_kitti_times(const fs::path& file, View& view) {
  const std::vector<std::chrono::nanoseconds> times = read_kitti_times(file);
  for (ViewFile& picture : view) {
    if (!picture.number) continue;
    if (*picture.number >= times.size()) {
      fail(file.string(), "has " + std::to_string(times.size()) + " times, none for " + picture.path.string() +
                              ": complete or remove it");
    }
    picture.time = times[static_cast<std::size_t>(*picture.number)];
  }
}

std::unique_ptr<FrameSource> open_folders(const std::string& source, Recording recording,
                                          const ReplayOptions& options) {
  if (options.swap) std::swap(recording.left, recording.right);
  View left = list_view(recording.kind, recording.left);
  View right = list_view(recording.kind, recording.right);
  const fs::path times = recording.left.parent_path() / "times.txt";
  const bool one_list_of_times = recording.kind == Recording::Kind::kKitti && fs::exists(times);
  if (one_list_of_times) {
    apply_kitti_times(times, left);
    apply_kitti_times(times, right);
  }
  Pairing pairing = pair_views(left, right, options.fps);
  if (one_list_of_times) {
    for (PairEntry& entry : pairing.entries) entry.skew.reset();
  }
  return std::make_unique<FolderSource>(source, std::move(pairing), true, options);
}

std::unique_ptr<FrameSource> open_mono(const std::string& source, const fs::path& path, const ReplayOptions& options) {
  if (options.swap || options.shift_rows != 0) {
    fail(source, "exchanging the views and shifting the right one need two views: leave them out");
  }
  if (!fs::exists(path)) fail(path.string(), "no such folder or video: check the path after mono:");
  if (!is_folder(path)) {
    return std::make_unique<VideoSource>(source, VideoSource::Layout::kMono, path.string(), "", options);
  }
  const bool euroc = fs::exists(path / "data.csv");
  const View view = list_view(euroc ? Recording::Kind::kEuroc : Recording::Kind::kFolders, path);
  return std::make_unique<FolderSource>(source, single_view(view, options.fps), false, options);
}

std::unique_ptr<FrameSource> open_two(const std::string& source, std::string left, std::string right,
                                      const ReplayOptions& options) {
  for (const std::string& path : {left, right}) {
    if (!fs::exists(path)) fail(path, "no such file or folder: LEFT,RIGHT needs two videos or two folders");
  }
  if (is_folder(left) != is_folder(right)) {
    fail(source, "one is a folder, the other a file: give two videos or two folders");
  }
  if (is_folder(left)) return open_folders(source, {Recording::Kind::kFolders, left, right}, options);
  if (options.swap) std::swap(left, right);
  return std::make_unique<VideoSource>(source, VideoSource::Layout::kTwoFiles, left, right, options);
}

}  // namespace

std::unique_ptr<FrameSource> open_replay(const std::string& source, const ReplayOptions& options) {
  if (!(options.fps >= 0.1 && options.fps <= 10'000)) {
    fail(source, "a rate of " + std::to_string(options.fps) + " Hz is outside 0.1..10000");
  }
  if (source.empty()) fail("source", "is empty: give " + std::string(kForms));
  silence_codecs();

  if (source.starts_with("mono:")) return open_mono(source, source.substr(5), options);
  if (source.starts_with("sbs:")) {
    const std::string file = source.substr(4);
    if (is_folder(file)) fail(file, "is a folder; sbs: takes a video");
    return std::make_unique<VideoSource>(source, VideoSource::Layout::kSideBySide, file, "", options);
  }
  if (is_folder(source)) return open_folders(source, find_recording(source), options);
  if (fs::exists(source)) {
    fail(source, "is a file: give sbs:" + source + " if it shows both views side by side, mono:" + source +
                     " if it shows one, or LEFT,RIGHT");
  }

  // A path may hold commas itself: the one that divides has something that exists on both sides.
  std::size_t comma = source.find(',');
  for (std::size_t at = comma; at != std::string::npos; at = source.find(',', at + 1)) {
    if (fs::exists(source.substr(0, at)) && fs::exists(source.substr(at + 1))) comma = at;
  }
  if (comma != std::string::npos) return open_two(source, source.substr(0, comma), source.substr(comma + 1), options);

  const std::size_t colon = source.find(':');
  if (colon != std::string::npos && source.find('/') > colon) {
    fail(source, "unknown form '" + source.substr(0, colon + 1) + "': give " + kForms);
  }
  fail(source, "no such folder or file: give " + std::string(kForms));
}

}  // namespace stereotrack::capture
