#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "pipeline/pipeline.hpp"

struct crypto_generichash_blake2b_state;

namespace stereotrack {

/// BLAKE2b-256 of what is fed to it, as 64 hexadecimal digits.
class Digest {
 public:
  Digest();
  Digest(const Digest&) = delete;
  Digest& operator=(const Digest&) = delete;
  ~Digest();
  void add(std::span<const std::byte> bytes) noexcept;
  /// The pixels without the padding of the rows, after width, height and format.
  void add(const Picture& picture) noexcept;
  [[nodiscard]] std::string hex() const;

 private:
  crypto_generichash_blake2b_state* state_;
};

struct Percentiles {
  double p50 = 0;
  double p99 = 0;
  double max = 0;
};

/// Zeros for no values.
[[nodiscard]] Percentiles percentiles(std::vector<double> values);

/// Times of each stage of each frame [ms]; give observer() to the pipeline.
class StageTimes {
 public:
  [[nodiscard]] StageObserver observer() noexcept { return {&StageTimes::stage_ended, this}; }
  /// Before each frame: takes the room for its times, so that the observer takes none while the stages run.
  void frame_begins();

  [[nodiscard]] Percentiles of(Stage stage) const;
  [[nodiscard]] Percentiles whole() const;

 private:
  static void stage_ended(void* context, Stage stage) noexcept;
  std::chrono::steady_clock::time_point last_;
  std::array<std::vector<double>, kStages> ms_;
};

/// summary.json: what a run was and did.
struct Summary {
  std::string source;
  std::uint64_t frames = 0;               ///< pairs that went through the pipeline
  std::uint64_t skipped = 0;              ///< pairs that could not be read
  std::vector<std::string> skip_reasons;  ///< the first hundred
  std::vector<double> pair_skews_us;      ///< |right - left capture time| of each pair whose source has both
  std::uint64_t wrong_pairs = 0;          ///< of two instants, told by what moves: kFlagWrongPair
  std::uint64_t tracks = 0;               ///< confirmed ones
  std::uint64_t rows = 0;                 ///< of tracks.csv
  std::uint32_t flags = 0;                ///< FrameFlag bits of all frames together
  RejectionCounts rejections{};
  std::uint64_t hulls_reduced = 0;  ///< hulls of targets with fewer vertices than they should have
  std::uint64_t deadline_misses = 0;
  std::uint64_t telemetry_sent = 0;
  std::uint64_t telemetry_dropped = 0;
  std::uint64_t telemetry_failed = 0;
  std::uint64_t allocations_after_warmup = 0;
  std::uint64_t memory_bytes = 0;
  std::string pixels_hash;
  std::string telemetry_hash;
  std::string configuration;  ///< TOML
};

/// Writes PATH whole or not at all; throws std::runtime_error. With times == null no measured time enters, so that
/// the same input gives the same bytes.
void save_summary(const std::filesystem::path& path, const Summary& summary, const StageTimes* times);

}  // namespace stereotrack
