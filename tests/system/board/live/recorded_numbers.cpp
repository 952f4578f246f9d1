// Which exposures were made pairs of: the numbers that sensors_on_line wrote into the pictures of a recording.
//
//     recorded_numbers RECORDING
//
// A line a pair, "LEFT RIGHT", or "LEFT mono" of one without a right picture.
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <stdexcept>

#include "drivers/record/recording_source.hpp"

int main(int count, char** words) {
  using namespace stereotrack;
  if (count != 2) {
    (void)std::fprintf(stderr, "usage: recorded_numbers RECORDING\n");
    return 2;
  }
  try {
    record::RecordingSource recording(words[1]);
    const auto number_of = [](const Picture& picture) {
      std::uint64_t number = 0;
      std::memcpy(&number, picture.data, sizeof number);
      return static_cast<unsigned long long>(number);
    };
    FramePair pair;
    for (capture::Next next = recording.next(pair); next != capture::Next::kEnd; next = recording.next(pair)) {
      if (next == capture::Next::kSkipped) throw std::runtime_error(recording.skip_reason());
      if (pair.right.empty()) {
        (void)std::printf("%llu mono\n", number_of(pair.left));
      } else {
        (void)std::printf("%llu %llu\n", number_of(pair.left), number_of(pair.right));
      }
    }
    return 0;
  } catch (const std::exception& error) {
    (void)std::fprintf(stderr, "recorded_numbers: %s\n", error.what());
    return 1;
  }
}
