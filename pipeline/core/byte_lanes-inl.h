// Bytes as pairs of 16-bit lanes, for kernels whose sums outgrow a byte: the even pixels in one vector, the odd ones in
// another, without a shuffle. To be included by kernels only, after <hwy/highway.h>: it is compiled once for each
// instruction set, hence no #pragma once.
#if defined(STEREOTRACK_BYTE_LANES_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef STEREOTRACK_BYTE_LANES_INL_H
#undef STEREOTRACK_BYTE_LANES_INL_H
#else
#define STEREOTRACK_BYTE_LANES_INL_H
#endif

#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace stereotrack {
namespace HWY_NAMESPACE {

/// Bytes 0, 2, 4 ... and 1, 3, 5 ... of `bytes`, as 16-bit lanes. Little-endian, as all targets of simd.hpp are.
template <class V>
HWY_INLINE auto even_bytes(V bytes) {
  const hwy::HWY_NAMESPACE::RepartitionToWide<hwy::HWY_NAMESPACE::DFromV<V>> d16;
  return hwy::HWY_NAMESPACE::And(hwy::HWY_NAMESPACE::BitCast(d16, bytes), hwy::HWY_NAMESPACE::Set(d16, 0xFF));
}
template <class V>
HWY_INLINE auto odd_bytes(V bytes) {
  const hwy::HWY_NAMESPACE::RepartitionToWide<hwy::HWY_NAMESPACE::DFromV<V>> d16;
  return hwy::HWY_NAMESPACE::ShiftRight<8>(hwy::HWY_NAMESPACE::BitCast(d16, bytes));
}

/// The bytes that even_bytes() and odd_bytes() took apart; each lane must be below 256.
template <class V>
HWY_INLINE auto zip_bytes(V even, V odd) {
  const hwy::HWY_NAMESPACE::RepartitionToNarrow<hwy::HWY_NAMESPACE::DFromV<V>> d8;
  return hwy::HWY_NAMESPACE::BitCast(d8, hwy::HWY_NAMESPACE::Or(even, hwy::HWY_NAMESPACE::ShiftLeft<8>(odd)));
}

}  // namespace HWY_NAMESPACE
}  // namespace stereotrack
HWY_AFTER_NAMESPACE();

#endif
