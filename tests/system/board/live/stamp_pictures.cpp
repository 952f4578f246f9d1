// Pictures in files with the times at which cameras were seen to give them: so that a replay of the files has the dt of
// the run to the nanosecond, and can be compared with it exactly.
//
//     stamp_pictures RECORDING PICTURES OUT
//
// PICTURES has left/ and right/, files 000001.png, ...: picture k is that of the run's pair k. OUT becomes a EuRoC
// folder (cam0/ cam1/, data.csv) of links to them. Pairs from before the recording have times, too, a period apart
// each; a replay leaves them out with --frames. Says the first and the last pair of the recording.
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>

#include "drivers/record/recording_source.hpp"

namespace stereotrack {
namespace {

namespace fs = std::filesystem;

void list(std::ofstream& csv, const fs::path& data, const fs::path& pictures, std::uint64_t ordinal,
          std::chrono::nanoseconds time) {
  char name[32];
  (void)std::snprintf(name, sizeof name, "%06llu.png", static_cast<unsigned long long>(ordinal));
  if (!fs::exists(pictures / name)) throw std::runtime_error((pictures / name).string() + ": is not there");
  fs::create_symlink(fs::absolute(pictures / name), data / name);
  csv << time.count() << ',' << name << '\n';
}

int stamp(const std::string& path, const fs::path& pictures, const fs::path& out) {
  record::RecordingSource recording(path);
  if (!recording.about().exact) throw std::runtime_error(path + ": is not exact");
  fs::create_directories(out / "cam0/data");
  fs::create_directories(out / "cam1/data");
  std::ofstream left(out / "cam0/data.csv");
  std::ofstream right(out / "cam1/data.csv");
  const auto add = [&](std::uint64_t ordinal, CaptureTime time, std::chrono::nanoseconds skew) {
    list(left, out / "cam0/data", pictures / "left", ordinal, time.time_since_epoch());
    list(right, out / "cam1/data", pictures / "right", ordinal, time.time_since_epoch() + skew);
  };
  std::uint64_t first = 0;
  std::uint64_t last = 0;
  FramePair pair;
  while (recording.next(pair) == capture::Next::kPair) {
    if (first == 0) {
      first = pair.ordinal;
      for (std::uint64_t k = 1; k < first; ++k) {
        add(k, pair.capture_time - static_cast<std::int64_t>(first - k) * recording.info().period, {});
      }
    }
    if (last != 0 && pair.ordinal != last + 1) throw std::runtime_error(path + ": a pair is missing");
    last = pair.ordinal;
    add(pair.ordinal, pair.capture_time, pair.skew.value_or(std::chrono::nanoseconds(0)));
  }
  (void)std::printf("first %llu last %llu\n", static_cast<unsigned long long>(first),
                    static_cast<unsigned long long>(last));
  return left.flush() && right.flush() ? 0 : 1;
}

}  // namespace
}  // namespace stereotrack

int main(int count, char** words) {
  if (count != 4) {
    (void)std::fprintf(stderr, "usage: stamp_pictures RECORDING PICTURES OUT\n");
    return 2;
  }
  try {
    return stereotrack::stamp(words[1], words[2], words[3]);
  } catch (const std::exception& error) {
    (void)std::fprintf(stderr, "stamp_pictures: %s\n", error.what());
    return 1;
  }
}
