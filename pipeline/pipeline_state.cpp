#include <array>
#include <cstring>

#include "pipeline/core/checksum.hpp"
#include "pipeline/core/state.hpp"
#include "pipeline/core/state_block.hpp"
#include "pipeline/pipeline.hpp"

namespace stereotrack {

// Everything that a frame finds as the one before left it. Not here: planes, masks, canvases, disparities and blobs,
// which each frame writes before it reads them, and what create() made.
template <class Self, class Archive>
void Pipeline::visit_state(Self& self, Archive& archive) noexcept {
  archive(self.started_, self.last_time_);
  archive.bounded(self.frames_, 0, self.config_.background.frames + 1);
  archive(self.equalise_left_, self.equalise_right_);
  archive(self.mean_y_, self.mean_cb_, self.mean_cr_);
  archive(self.background_left_, self.background_right_, self.background_disparity_);
  archive(self.convex_hull_, self.detector_, self.pair_check_, self.tracker_);
}

// What gives the state its form and its meaning; all of the configuration is for who keeps the block to compare.
std::uint64_t Pipeline::fingerprint() const noexcept {
  const auto number = [](auto value) { return static_cast<std::uint64_t>(value); };
  const std::array<std::uint64_t, 9> form{number(setup_.width),
                                          number(setup_.height),
                                          number(setup_.colour),
                                          number(rectifier_.has_value()),
                                          number(config_.equalise),
                                          number(config_.background.method),
                                          number(config_.background.frames),
                                          number(full_range_),
                                          number(state_bytes())};
  // Without rules the sum is that of a version that knew none.
  return checksum(std::as_bytes(std::span(form))) ^ (zone_rules_ ? zone_rules_->fingerprint() : 0);
}

std::size_t Pipeline::state_bytes() const noexcept {
  StateSizer sizer;
  visit_state(*this, sizer);
  return sizeof(StateHeader) + sizer.bytes();
}

std::size_t Pipeline::copy_state_part(std::size_t first, std::span<std::byte> out) const noexcept {
  StateHeader header;
  StateWriter counter({});
  visit_state(*this, counter);
  header.fingerprint = fingerprint();
  header.bytes = sizeof header + counter.position();
  if (first >= header.bytes) return 0;
  StateWriter writer(out, first);
  writer.numbers(reinterpret_cast<const std::byte*>(&header), sizeof header);
  visit_state(*this, writer);
  return std::min(out.size(), static_cast<std::size_t>(header.bytes) - first);
}

Result<std::size_t> Pipeline::save_state(std::span<std::byte> out) const noexcept {
  StateWriter counter({});
  visit_state(*this, counter);
  const std::size_t bytes = sizeof(StateHeader) + counter.position();
  if (out.size() < bytes) return fail(Fault::kBadSize);
  const std::span<std::byte> block = out.first(bytes);
  (void)copy_state_part(0, block);
  (void)seal_state(block);
  return bytes;
}

Result<void> Pipeline::restore_state(std::span<const std::byte> block) noexcept {
  const Result<std::span<const std::byte>> body = open_state(block, fingerprint());
  if (!body.has_value()) return fail(body.error());
  StateReader reader(*body);
  visit_state(*this, reader);
  // With a checksum that fits, only a block that somebody made up can end here.
  if (reader.failed() || reader.position() != body->size()) return fail(Fault::kBadState);
  return {};
}

}  // namespace stereotrack
