#include "pipeline/photometry/ingest.hpp"

#include <algorithm>
#include <cstring>
#include <optional>

namespace stereotrack {

void ingest_picture(const Picture& in, const IngestPlanes& out, Histogram* histogram, std::uint8_t* copy) noexcept {
  const int width = out.y.width;
  const int height = out.y.height;
  const bool colour = !out.cb.empty();
  std::optional<HistogramCounter> counter;
  if (histogram != nullptr) counter.emplace();
  const std::size_t row_bytes = static_cast<std::size_t>(width) * static_cast<std::size_t>(bytes_per_pixel(in.format));
  const auto source_row = [&](int y) {
    if (copy == nullptr) return in.row(y);
    std::uint8_t* copied = copy + static_cast<std::size_t>(y) * row_bytes;
    std::memcpy(copied, in.row(y), row_bytes);
    return static_cast<const std::uint8_t*>(copied);
  };
  for (int y = 0; y < height; ++y) {
    const std::uint8_t* from = source_row(y);
    const PlaneRow row = colour ? PlaneRow{out.y.row(y), out.cb.row(y), out.cr.row(y)} : PlaneRow{out.y.row(y)};
    switch (in.format) {
      case PixelFormat::kBgr8: bgr_row(from, width, row); break;
      case PixelFormat::kYuyv: packed_row(from, PackedOrder::kLumaFirst, width, row); break;
      case PixelFormat::kUyvy: packed_row(from, PackedOrder::kChromaFirst, width, row); break;
      case PixelFormat::kGrey8:
      case PixelFormat::kNv12: copy_row(from, width, row.y); break;
    }
    if (counter) counter->add_row(row.y, width);
  }
  if (colour && in.format == PixelFormat::kNv12) {
    for (int y = 0; y < height; y += 2) {
      chroma_pairs_row(source_row(height + y / 2), width, out.cb.row(y), out.cr.row(y));
      std::copy_n(out.cb.row(y), width, out.cb.row(y + 1));
      std::copy_n(out.cr.row(y), width, out.cr.row(y + 1));
    }
  } else if (copy != nullptr && in.format == PixelFormat::kNv12) {
    for (int y = height; y < memory_rows(in.format, height); ++y) (void)source_row(y);
  }
  if (counter) *histogram = counter->sum();
}

}  // namespace stereotrack
