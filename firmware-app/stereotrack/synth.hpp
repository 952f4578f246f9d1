#pragma once

#include <cstdint>
#include <filesystem>
#include <iosfwd>
#include <string>

namespace stereotrack {

/// `stereotrack synth SCENE --out DIR [--seed N] [--frames N] [--size WxH]`
struct SynthArguments {
  std::string scene;          ///< NAME, or synthetic:NAME
  std::filesystem::path out;  ///< made if it is not there
  std::uint64_t seed = 1;
  std::uint64_t frames = 600;
  std::string size = "640x480";
};

/// Writes into `out`
///     left/%06d.png right/%06d.png   8-bit colour
///     masks/%06d.png                 0 still, 50 shadow of a moving object, 255 moving object; left view
///     disparity/%06d.png             16 bit, true disparity x 256 of the left view, 0 = none (sky)
///     calibration.yml                OpenCV keys, unit metres
///     gt.csv                         frame,id,left,top,width,height,confidence,x,y,z of every visible object;
///                                    confidence 0 (not scored) where under a quarter of it is visible
/// Where the scene says how pictures come (dropout), those of left/ and right/ are named SECONDS_NANOSECONDS.png by a
/// stamp of their own, from 1,700,000,000 s on, and may be missing; frames and the other pictures' numbers are
/// ordinals, which count frames of which a picture came, as a replay of the folder does. Where a picture is missing or
/// the pair is wrong, gt.csv has confidence 0. Beside it lies
///     pairs.csv                      frame,left,right,right_off,skew_ns, in the first line, too; left, right: 1 if the
///                                    picture came; right_off: the right picture is that of so many frames later, so
///                                    the pair is wrong unless it is 0; skew_ns: right stamp - left stamp, 0 without a
///                                    pair
/// Numbered pictures of an earlier run are overwritten, or removed when it had more of them. gt.csv and
/// calibration.yml appear last, whole: without them the folder is not a finished sequence.
/// Answers the exit code, 0. Throws config::Error for a wrong scene, size or count, std::runtime_error if
/// something cannot be written or the user interrupts.
int run_synth(const SynthArguments& arguments, std::ostream& messages);

}  // namespace stereotrack
