#include "pipeline/photometry/ingest.hpp"

#include <algorithm>
#include <cstring>
#include <optional>

namespace stereotrack {

namespace {

constexpr int kLines = 3;
constexpr int kMargin = 64;  // before a line, so that it begins on a cache line; the column before the first lies in it

PlaneRow row_of(const IngestPlanes& planes, int y) noexcept {
  if (planes.cb.empty()) return {planes.y.row(y)};
  return {planes.y.row(y), planes.cb.row(y), planes.cr.row(y)};
}

// A row of what has its pixels' luma in the row.
void take_row(PixelFormat format, const std::uint8_t* from, int width, const PlaneRow& row) noexcept {
  switch (format) {
    case PixelFormat::kBgr8: return colour_row(from, ColourOrder::kBlueFirst, width, row);
    case PixelFormat::kRgb8: return colour_row(from, ColourOrder::kRedFirst, width, row);
    case PixelFormat::kYuyv: return packed_row(from, PackedOrder::kLumaFirst, width, row);
    case PixelFormat::kUyvy: return packed_row(from, PackedOrder::kChromaFirst, width, row);
    default: return unpack_row(from, sample_layout(format), width, row.y);
  }
}

}  // namespace

Result<Ingest> Ingest::create(int width, Arena& arena) noexcept {
  if (width < 1) return fail(Fault::kBadSize);
  Ingest self;
  self.lines_ = arena.image<std::uint8_t>(kMargin + width, kLines);  // with padding, where the column behind it lies
  if (self.lines_.empty()) return fail(Fault::kOutOfMemory);
  return self;
}

void Ingest::run(const Picture& in, const IngestPlanes& out, Histogram* histogram, std::uint8_t* copy) noexcept {
  const int width = out.y.width;
  const int height = out.y.height;
  std::optional<HistogramCounter> counter;
  if (histogram != nullptr) counter.emplace();
  const std::size_t bytes = row_bytes(in.format, width);
  const auto source_row = [&](int y) {
    if (copy == nullptr) return in.row(y);
    std::uint8_t* copied = copy + static_cast<std::size_t>(y) * bytes;
    std::memcpy(copied, in.row(y), bytes);
    return static_cast<const std::uint8_t*>(copied);
  };
  const auto line = [&](int y) { return lines_.row(y % kLines) + kMargin; };
  const auto take_line = [&](int y) {
    std::uint8_t* samples = line(y);
    unpack_row(source_row(y), sample_layout(in.format), width, samples);
    samples[-1] = samples[1];
    samples[width] = samples[width - 2];
  };
  const bool mosaic = is_bayer(in.format);
  const BayerRed red = mosaic ? bayer_red(in.format) : BayerRed{};
  if (mosaic && height > 0) take_line(0);
  for (int y = 0; y < height; ++y) {
    const PlaneRow row = row_of(out, y);
    if (mosaic) {
      const bool last = y + 1 == height;
      if (!last) take_line(y + 1);
      bayer_row({.above = line(y == 0 ? 1 : y - 1),
                 .row = line(y),
                 .below = line(last ? y - 1 : y + 1),
                 .red = y % 2 == red.y,
                 .green_first = (y % 2 == red.y) != (red.x == 0)},
                width, row);
    } else {
      take_row(in.format, source_row(y), width, row);
    }
    if (counter) counter->add_row(row.y, width);
  }
  if (in.format == PixelFormat::kNv12 && !out.cb.empty()) {
    for (int y = 0; y < height; y += 2) {
      chroma_pairs_row(source_row(height + y / 2), width, out.cb.row(y), out.cr.row(y));
      std::copy_n(out.cb.row(y), width, out.cb.row(y + 1));
      std::copy_n(out.cr.row(y), width, out.cr.row(y + 1));
    }
  } else if (in.format == PixelFormat::kNv12 && copy != nullptr) {
    for (int y = height; y < memory_rows(in.format, height); ++y) (void)source_row(y);
  }
  if (counter) *histogram = counter->sum();
}

}  // namespace stereotrack
