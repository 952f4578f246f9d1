#pragma once

#include <gtest/gtest.h>

#include "pipeline/core/simd.hpp"

namespace stereotrack::test {

/// Runs `body` once for each instruction set of this machine, the plain reference included, then with the best again.
template <class Body>
void on_each_target(Body&& body) {
  for (const SimdTarget target : simd_targets()) {
    SCOPED_TRACE(to_string(target));
    ASSERT_TRUE(use_simd(target));
    body();
  }
  ASSERT_TRUE(use_simd(simd_targets().back()));
}

/// Row lengths at which a vector of up to 64 lanes begins, ends, is just missed or just exceeded; by two and four
/// pixels, too, for what comes in such groups.
inline constexpr int kRowLengths[] = {0,  1,  2,  3,  4,  5,  7,  8,  9,  15, 16,  17,  31,  32,  33,  34,  47,  48,
                                      49, 60, 62, 63, 64, 65, 66, 67, 68, 97, 124, 126, 127, 128, 129, 130, 132, 200};

}  // namespace stereotrack::test
