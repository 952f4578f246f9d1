#pragma once

#include <cstdint>
#include <string>

#include "drivers/capture/synthetic/synthetic_source.hpp"

namespace stereotrack::capture {

inline SyntheticOptions small(std::uint64_t seed = 1) {
  SyntheticOptions o;
  o.seed = seed;
  o.width = 160;
  o.height = 120;
  o.truth = true;
  return o;
}

inline std::uint64_t fnv1a(const Picture& p, std::uint64_t hash) {
  for (int y = 0; y < p.height; ++y) {
    for (std::size_t i = 0; i < row_bytes(p.format, p.width); ++i) hash = (hash ^ p.row(y)[i]) * 0x100000001b3ULL;
  }
  return hash;
}

inline std::uint64_t hash_of(const FramePair& pair) {
  return fnv1a(pair.right, fnv1a(pair.left, 0xcbf29ce484222325ULL));
}

/// The pair with this ordinal, nothing before it drawn. 0 when there is none.
inline std::uint64_t hash_at(const std::string& name, const SyntheticOptions& options, std::uint64_t ordinal) {
  const auto source = open_synthetic(name, options);
  source->skip_to(ordinal - 1);
  FramePair pair;
  return source->next(pair) == Next::kPair && pair.ordinal == ordinal ? hash_of(pair) : 0;
}

inline double luma(const Picture& p, int x, int y) {
  const std::uint8_t* v = p.row(y) + 3 * x;
  return 0.114 * v[0] + 0.587 * v[1] + 0.299 * v[2];
}

}  // namespace stereotrack::capture
