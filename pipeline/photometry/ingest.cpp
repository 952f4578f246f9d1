#include "pipeline/photometry/ingest.hpp"

#include <algorithm>
#include <optional>

namespace stereotrack {

void ingest_picture(const Picture& in, const IngestPlanes& out, Histogram* histogram) noexcept {
  const int width = out.y.width;
  const int height = out.y.height;
  const bool colour = !out.cb.empty();
  std::optional<HistogramCounter> counter;
  if (histogram != nullptr) counter.emplace();
  for (int y = 0; y < height; ++y) {
    const PlaneRow row = colour ? PlaneRow{out.y.row(y), out.cb.row(y), out.cr.row(y)} : PlaneRow{out.y.row(y)};
    switch (in.format) {
      case PixelFormat::kBgr8: bgr_row(in.row(y), width, row); break;
      case PixelFormat::kYuyv: packed_row(in.row(y), PackedOrder::kLumaFirst, width, row); break;
      case PixelFormat::kUyvy: packed_row(in.row(y), PackedOrder::kChromaFirst, width, row); break;
      case PixelFormat::kGrey8:
      case PixelFormat::kNv12: copy_row(in.row(y), width, row.y); break;
    }
    if (counter) counter->add_row(row.y, width);
  }
  if (colour && in.format == PixelFormat::kNv12) {
    for (int y = 0; y < height; y += 2) {
      chroma_pairs_row(in.row(height + y / 2), width, out.cb.row(y), out.cr.row(y));
      std::copy_n(out.cb.row(y), width, out.cb.row(y + 1));
      std::copy_n(out.cr.row(y), width, out.cr.row(y + 1));
    }
  }
  if (counter) *histogram = counter->sum();
}

}  // namespace stereotrack
