#pragma once

#include <cstdint>

#include "pipeline/core/arena.hpp"
#include "pipeline/core/image_view.hpp"
#include "pipeline/core/result.hpp"
#include "pipeline/core/stage.hpp"
#include "pipeline/frame.hpp"
#include "pipeline/photometry/ingest_kernel.hpp"

namespace stereotrack {

/// Where Ingest writes: planes of one size. cb and cr empty where only luma is wanted.
struct IngestPlanes {
  ImageView<std::uint8_t> y;
  ImageView<std::uint8_t> cb;
  ImageView<std::uint8_t> cr;
};

/// The first stage: a picture as its source delivers it becomes planes, and each of its bytes is read exactly once,
/// from the first to the last, as memory that a camera writes is slow to read.
///     kGrey8                 Y as it is; chroma is not written
///     kGrey10, 12, 16, ...   Y the 8 most significant bits: sample_of(); chroma is not written
///     kBgr8, kRgb8           Y by (3.1), Cb by (3.18), Cr by (3.19): colour.hpp
///     kYuyv, kUyvy           Y, Cb, Cr as they are; a pair's chroma is that of both its pixels
///     kNv12                  likewise; a square's chroma is that of its four pixels
///     kBayer...              sample_of() each, then the missing colours from the samples beside them, bilinear
///                            (bayer_row(): the equations), then as kBgr8
/// "As they are" in ITU-R BT.601 of whichever range the camera has; only full range is what kBgr8 gives. A mosaic goes
/// on beyond its borders as it came: row -1 is row 1, row H is row H - 2, and so for columns, which keeps its colours
/// in their places. No black level is taken away and no white balance set: what stays the same from frame to frame is
/// background, and cameras do both better.
/// In: a picture whose size its format allows (frame.hpp), no wider than `width` where it is a mosaic. Out: planes of
/// its size; without cb and cr, chroma that lies in rows of its own is not read. histogram: null, or how often each Y
/// occurs, counted while the row is at hand.
/// copy: null, or where the picture's bytes go as well, row after row without what lies between (picture_bytes()): what
/// a recorder keeps. Each row is copied first and read from there, so that the source's memory is still read once.
/// O(pixels), 0.1 ns a pixel, 0.4 with histogram; what bounds it is how fast the source can be read. One instance a
/// thread: three rows of a mosaic are kept while it is read; nothing crosses pictures.
class Ingest {
 public:
  /// Faults: kBadSize, a width below 1; kOutOfMemory.
  [[nodiscard]] static Result<Ingest> create(int width, Arena& arena) noexcept;

  void run(const Picture& in, const IngestPlanes& out, Histogram* histogram, std::uint8_t* copy = nullptr) noexcept;

 private:
  Ingest() = default;

  ImageView<std::uint8_t> lines_;  ///< of a mosaic: row y in line y % 3, behind kMargin
};
static_assert(RealTimeStage<Ingest, &Ingest::run>);

}  // namespace stereotrack
