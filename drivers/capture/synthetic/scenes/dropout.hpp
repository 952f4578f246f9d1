#pragma once

#include <cstdint>

#include "drivers/capture/synthetic/scene.hpp"

namespace stereotrack::capture::synthetic {

/// Pictures that never come, and pairs that are none: the link between the cameras and the tracker is bad.
///
/// Nine things pass (see Passers). From frame 41 on each 20 frames hold one fault, in each 100 frames one of each kind,
/// in a drawn order, begun 4 to 10 frames after their first:
///
///     left missing     1 to 3 left pictures never come        replay: kSkipped, the ordinal counts
///     right missing    1 to 3 right pictures never come       likewise
///     both missing     1 to 5 pairs never come                no ordinal; the capture time jumps
///     wrong, unseen    1 to 8 pairs whose right picture is    one frame later or earlier than the left; the time
///                      stamps agree as those of good pairs    do: only what moves in the pictures tells
///     wrong, stamped   1 to 4 pairs, likewise; the time       stamps differ by 0.30 to 0.45 of a period towards the
///                      true side, so that they are still paired
///
/// Time stamps of good pairs differ by up to 0.3 ms. A wrong pair's right picture is, byte for byte, the one that
/// belongs to the frame before (off = -1) or after (1): what stands still has its true disparity, what moves one that
/// is wrong by its way in a frame. Periods are those of 30 frames a second.
///
/// `stereotrack synth` names the pictures SECONDS_NANOSECONDS.png, each with its own stamp, from 1,700,000,000 s on, so
/// that a replay pairs them by time, as `synthetic:dropout` pairs them. pairs.csv beside gt.csv tells for each ordinal
/// what came; rows of gt.csv have confidence 0 (not scored) where a picture is missing or the pair is wrong: whether a
/// tracker uses the left picture alone then is its own affair. masks/ and disparity/ have all ordinals.
[[nodiscard]] Scene make_dropout(std::uint64_t seed);

}  // namespace stereotrack::capture::synthetic
