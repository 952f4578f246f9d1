#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>

#include "pipeline/frame.hpp"

namespace stereotrack::capture {

/// What a source is, known once it is open.
struct SourceInfo {
  std::string name;                          ///< as the user wrote it, for messages
  int width = 0;                             ///< of one picture [px]
  int height = 0;                            ///< of one picture [px]
  PixelFormat format = PixelFormat::kGrey8;  ///< kBgr8 where the source has colour
  bool stereo = true;                        ///< false: mono, `right` stays empty
  bool has_time = false;                     ///< capture times come from the source, not from a rate
  std::chrono::nanoseconds period{0};        ///< nominal time between pairs
  std::optional<std::uint64_t> pairs;        ///< how many there are, where known
};

enum class Next : std::uint8_t {
  kPair,     ///< `out` holds a pair
  kSkipped,  ///< this ordinal could not be read; skip_reason() says why, in one line naming the file
  kEnd,      ///< no more
};

/// Where frame pairs come from. Opening may throw std::runtime_error with one line naming the file or
/// device and the way out; after that nothing throws. One thread.
class FrameSource {
 public:
  FrameSource() = default;
  FrameSource(const FrameSource&) = delete;
  FrameSource& operator=(const FrameSource&) = delete;
  virtual ~FrameSource() = default;

  [[nodiscard]] virtual const SourceInfo& info() const noexcept = 0;

  /// Reads the next pair. `out.ordinal` and, where known, `out.capture_time` are set for kSkipped too.
  /// The pixels in `out` stay valid until the next call.
  [[nodiscard]] virtual Next next(FramePair& out) noexcept = 0;

  /// Why the last next() answered kSkipped.
  [[nodiscard]] virtual const std::string& skip_reason() const noexcept = 0;

  /// Goes on as if pairs up to and including `ordinal` had been read, without decoding what can be left
  /// undecoded. Only before the first next().
  virtual void skip_to(std::uint64_t ordinal) noexcept = 0;
};

}  // namespace stereotrack::capture
