#include "firmware-app/stereotrack/tracks_file.hpp"

#include <algorithm>
#include <cstdio>
#include <string>

#include "firmware-app/stereotrack/output_file.hpp"

namespace stereotrack {

void TracksFile::add(std::uint64_t frame, std::span<const TrackReport> tracks) {
  std::map<std::uint32_t, std::vector<Row>> still_tentative;
  for (const TrackReport& track : tracks) {
    const Row row{frame, track.id, track.box, track.confidence, track.has_depth, track.position};
    if (track.state == TrackState::kTentative) {
      auto& waiting = still_tentative[track.id];
      waiting = std::move(tentative_[track.id]);
      if (track.measured) waiting.push_back(row);
      continue;
    }
    if (const auto waiting = tentative_.find(track.id); waiting != tentative_.end()) {
      rows_.insert(rows_.end(), waiting->second.begin(), waiting->second.end());
    }
    if (std::find(known_.begin(), known_.end(), track.id) == known_.end()) {
      known_.push_back(track.id);
      ++confirmed_;
    }
    if (track.measured) rows_.push_back(row);
  }
  // Tentative tracks that are not reported any more were dropped: so are their rows.
  tentative_ = std::move(still_tentative);
}

void TracksFile::save(const std::filesystem::path& path) const {
  std::vector<Row> sorted = rows_;
  std::stable_sort(sorted.begin(), sorted.end(),
                   [](const Row& a, const Row& b) { return a.frame != b.frame ? a.frame < b.frame : a.id < b.id; });
  OutputFile file(path);
  for (const Row& row : sorted) {
    char line[256];
    if (row.has_depth) {
      (void)std::snprintf(line, sizeof line, "%llu,%u,%d,%d,%d,%d,%.3f,%.5f,%.5f,%.5f\n",
                          static_cast<unsigned long long>(row.frame), row.id, row.box.left, row.box.top, row.box.width,
                          row.box.height, row.confidence, row.position.x(), row.position.y(), row.position.z());
    } else {
      (void)std::snprintf(line, sizeof line, "%llu,%u,%d,%d,%d,%d,%.3f,-1,-1,-1\n",
                          static_cast<unsigned long long>(row.frame), row.id, row.box.left, row.box.top, row.box.width,
                          row.box.height, row.confidence);
    }
    file.write(line);
  }
  file.commit();
}

}  // namespace stereotrack
