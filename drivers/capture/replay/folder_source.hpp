#pragma once

#include <cstddef>
#include <future>
#include <opencv2/core/mat.hpp>
#include <string>

#include "drivers/capture/frame_source.hpp"
#include "drivers/capture/replay/pairing.hpp"
#include "drivers/capture/replay/replay.hpp"

namespace stereotrack::capture {

/// Pictures in files, paired beforehand. Rules of size, format and time: replay.hpp.
class FolderSource final : public FrameSource {
 public:
  /// Decodes pairs until one is readable. Throws if none is, or if `options` do not suit the size.
  FolderSource(std::string name, Pairing pairing, bool stereo, const ReplayOptions& options);

  [[nodiscard]] const SourceInfo& info() const noexcept override { return info_; }
  [[nodiscard]] Next next(FramePair& out) noexcept override;
  [[nodiscard]] const std::string& skip_reason() const noexcept override { return reason_; }
  void skip_to(std::uint64_t ordinal) noexcept override;

 private:
  struct Decoded {
    cv::Mat left;
    cv::Mat right;
    std::string fault;
  };

  /// Reads one entry, and converts it once info_ holds the source's size and format. Runs on the decoding thread.
  [[nodiscard]] Decoded decode(const PairEntry& entry) const;
  void decode_ahead();
  [[nodiscard]] Next read_next(FramePair& out);

  SourceInfo info_;
  Pairing pairing_;
  ReplayOptions options_;
  std::size_t position_ = 0;  ///< entries handed out so far
  Decoded current_;
  std::string reason_;
  std::future<Decoded>
      ahead_;  ///< entry position_; last member: its destructor waits for the thread, which reads the others
};

}  // namespace stereotrack::capture
