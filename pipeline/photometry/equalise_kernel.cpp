#include "pipeline/photometry/equalise_kernel.hpp"

#include "pipeline/core/simd.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "pipeline/photometry/equalise_kernel.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace stereotrack {
namespace HWY_NAMESPACE {
namespace {

// Returns how many pixels it did: whole vectors, the rest is the reference's.

#if HWY_TARGET == HWY_SCALAR

int map_pixels(const GreyTable&, int, std::uint8_t*) { return 0; }

#else

namespace hn = hwy::HWY_NAMESPACE;

// An instruction looks up 16 bytes: all 16 parts of the table are asked with the lower half of each pixel, and the bits
// of its upper half choose among the answers, as in a knock-out tournament.
int map_pixels(const GreyTable& table, int width, std::uint8_t* pixels) {
  const hn::ScalableTag<std::uint8_t> d;
  const int lanes = static_cast<int>(hn::Lanes(d));
  int x = 0;
  for (; x + lanes <= width; x += lanes) {
    const auto pixel = hn::LoadU(d, pixels + x);
    const auto low = hn::And(pixel, hn::Set(d, 15));
    const auto part = [&](int i)
                          HWY_ATTR { return hn::TableLookupBytes(hn::LoadDup128(d, table.data() + 16 * i), low); };
    const auto bit = [&](int i) HWY_ATTR { return hn::TestBit(pixel, hn::Set(d, static_cast<std::uint8_t>(1 << i))); };
    const auto bit4 = bit(4);
    const auto bit5 = bit(5);
    const auto bit6 = bit(6);
    const auto two = [&](int i) HWY_ATTR { return hn::IfThenElse(bit4, part(i + 1), part(i)); };
    const auto four = [&](int i) HWY_ATTR { return hn::IfThenElse(bit5, two(i + 2), two(i)); };
    const auto eight = [&](int i) HWY_ATTR { return hn::IfThenElse(bit6, four(i + 4), four(i)); };
    hn::StoreU(hn::IfThenElse(bit(7), eight(8), eight(0)), d, pixels + x);
  }
  return x;
}

#endif

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace stereotrack
HWY_AFTER_NAMESPACE();

#if HWY_ONCE

namespace stereotrack {

namespace {

HWY_EXPORT(map_pixels);

}  // namespace

void map_row_reference(const GreyTable& table, int width, std::uint8_t* pixels) noexcept {
  for (int x = 0; x < width; ++x) pixels[x] = table[pixels[x]];
}

void map_row(const GreyTable& table, int width, std::uint8_t* pixels) noexcept {
  const int done = simd_in_use() == SimdTarget::kScalar ? 0 : HWY_DYNAMIC_DISPATCH(map_pixels)(table, width, pixels);
  map_row_reference(table, width - done, pixels + done);
}

}  // namespace stereotrack

#endif
