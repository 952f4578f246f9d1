#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

#include "drivers/capture/synthetic/synthetic_source.hpp"

namespace stereotrack {

/// gt.csv: the ground truth of a synthetic scene in the columns of tracks.csv, box and mean position [m] of what each
/// object shows of itself in the left picture; confidence 0: not scored. Kept in memory until save().
class TruthFile {
 public:
  /// The objects of the pair that the scene has just given, or skipped.
  void add(std::uint64_t frame, const capture::SyntheticSource& scene);

  /// Writes PATH whole or not at all; throws std::runtime_error.
  void save(const std::filesystem::path& path) const;

 private:
  std::string rows_;
};

}  // namespace stereotrack
