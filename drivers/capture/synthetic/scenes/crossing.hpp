#pragma once

#include <cstdint>

#include "drivers/capture/synthetic/scene.hpp"

namespace stereotrack::capture::synthetic {

/// People who pass in front of and behind each other: who is who afterwards?
///
/// Twelve people walk on straight lines, in six pairs; each pair meets where the left camera sees one behind the other:
///
///     pair  ids      they meet                      in front at z  clothes    half or more of it hidden for
///     1     1, 2     from opposite sides            4.9 - 5.3 m    different  0.1 - 0.6 s
///     2     3, 4     from opposite sides            6.2 - 6.8 m    the same   0.1 - 0.6 s
///     3     5, 6     one overtakes the other        5.4 - 6.0 m    different  0.6 - 1.0 s
///     4     7, 8     one behind who stands for 2 s  5.2 - 5.8 m    different  0.2 - 0.9 s
///     5     9, 10    one overtakes the other        6.6 - 7.2 m    the same   1.0 - 1.5 s
///     6     11, 12   from opposite sides            7.6 - 8.0 m    the same   0.1 - 0.6 s
///
/// The odd id is in front and taller (1.80 to 1.92 m, the other 1.50 to 1.60); the other goes 0.75 to 0.95 m behind.
/// Pairs meet 3 s apart, about at 3, 6 ... 18 s, in a drawn order, at 0.8 to 1.4 m/s; those of different pairs hide
/// each other, too: 15 or more times in all that a quarter of somebody is hidden. "The same" clothes are the same to
/// the thread, shoes, skin and hair as well. Hidden is what others of the cast hide of what lies in the picture, by
/// area. Nobody is half hidden for longer than 1.5 s at a time. An act is 33 s; the promises are about its first 22.
[[nodiscard]] Scene make_crossing(std::uint64_t seed);

}  // namespace stereotrack::capture::synthetic
