#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <span>
#include <vector>

#include "pipeline/track/track_report.hpp"

namespace stereotrack {

/// tracks.csv: MOTChallenge columns `frame,id,left,top,width,height,confidence,x,y,z`.
/// Rows of confirmed tracks in the frames in which they were measured; when a track is confirmed, its
/// tentative frames come too. State at capture time; x y z = -1 -1 -1 where depth is unknown. Sorted by frame,
/// then id. Kept in memory until save(): a row is 64 bytes.
class TracksFile {
 public:
  void add(std::uint64_t frame, std::span<const TrackReport> tracks);

  /// Writes PATH whole or not at all; throws std::runtime_error.
  void save(const std::filesystem::path& path) const;

  [[nodiscard]] std::size_t rows() const noexcept { return rows_.size(); }
  /// Tracks that were confirmed so far.
  [[nodiscard]] std::size_t tracks() const noexcept { return confirmed_; }

 private:
  struct Row {
    std::uint64_t frame;
    std::uint32_t id;
    Rect box;
    double confidence;
    bool has_depth;
    Eigen::Vector3d position;
  };

  std::vector<Row> rows_;
  std::map<std::uint32_t, std::vector<Row>> tentative_;
  std::vector<std::uint32_t> known_;
  std::size_t confirmed_ = 0;
};

}  // namespace stereotrack
