#include "firmware-app/stereotrack/synth.hpp"

#include <array>
#include <cerrno>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <future>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <regex>
#include <set>
#include <stdexcept>
#include <string_view>
#include <utility>
#include <vector>

#include "config/calibration/read_calibration.hpp"
#include "config/error.hpp"
#include "drivers/capture/synthetic/synthetic_source.hpp"
#include "firmware-app/formatted.hpp"
#include "firmware-app/stereotrack/interrupt.hpp"
#include "firmware-app/stereotrack/output_file.hpp"
#include "firmware-app/stereotrack/picture_size.hpp"
#include "firmware-app/stereotrack/progress.hpp"
#include "firmware-app/stereotrack/truth_file.hpp"

namespace stereotrack {
namespace {

namespace fs = std::filesystem;

constexpr std::array<const char*, 4> kFolders{"left", "right", "masks", "disparity"};

std::string numbered(std::uint64_t ordinal) {
  return formatted("%06llu.png", static_cast<unsigned long long>(ordinal));
}

/// Names with a time are told by ten digits of seconds: see time_in_name().
constexpr std::chrono::nanoseconds kFirstStamp = std::chrono::seconds(1'700'000'000);

std::string stamped(std::chrono::nanoseconds since_first) {
  const std::chrono::nanoseconds time = kFirstStamp + since_first;
  return formatted("%lld_%09lld.png", static_cast<long long>(time.count() / 1'000'000'000),
                   static_cast<long long>(time.count() % 1'000'000'000));
}

/// A file that is whole or gone. Not flushed to the disk one by one: there are thousands.
void write_whole(const fs::path& path, const std::vector<std::uint8_t>& bytes) {
  std::FILE* file = std::fopen(path.c_str(), "wb");
  int error = file == nullptr ? errno : 0;
  if (file != nullptr) {
    if (std::fwrite(bytes.data(), 1, bytes.size(), file) != bytes.size()) error = errno;
    if (std::fclose(file) != 0 && error == 0) error = errno;
  }
  if (error == 0) return;
  std::error_code ignored;
  if (file != nullptr) fs::remove(path, ignored);
  throw std::runtime_error(path.string() + ": cannot be written: " + std::strerror(error) +
                           (error == ENOSPC ? ": free some space or choose another folder" : ""));
}

/// Copies of what one pair is written from, so that the next can be drawn meanwhile.
struct PairPictures {
  std::array<std::string, kFolders.size()> names;  ///< in the order of kFolders
  std::array<cv::Mat, kFolders.size()> pictures;   ///< likewise; empty: not to be written

  void write(const fs::path& out) const {
    std::vector<std::uint8_t> bytes;
    for (std::size_t i = 0; i < kFolders.size(); ++i) {
      if (pictures[i].empty()) continue;
      const fs::path path = out / kFolders[i] / names[i];
      // OpenCV's own settings are its fastest; noise does not compress better with others.
      if (!cv::imencode(".png", pictures[i], bytes)) {
        throw std::runtime_error(path.string() + ": cannot be encoded as PNG");
      }
      write_whole(path, bytes);
    }
  }
};

template <class T>
cv::Mat copy_of(const T* data, int width, int height, int type) {
  // OpenCV has no view of memory that may only be read; clone() reads.
  return cv::Mat(height, width, type, const_cast<T*>(data)).clone();
}

cv::Mat copy_of(const Picture& picture) {
  return picture.empty() ? cv::Mat() : copy_of(picture.data, picture.width, picture.height, CV_8UC3);
}

std::string pair_row(std::uint64_t frame, const capture::synthetic::Delivery& d) {
  return formatted("%llu,%d,%d,%d,%lld\n", static_cast<unsigned long long>(frame), d.left ? 1 : 0, d.right ? 1 : 0,
                   d.right ? d.right_off : 0, static_cast<long long>(d.left && d.right ? d.skew_ns : 0));
}

void prepare(const fs::path& out) {
  make_output_folder(out);
  std::error_code ignored;
  for (const char* whole : {"gt.csv", "calibration.yml", "pairs.csv"}) fs::remove(out / whole, ignored);
  for (const char* folder : kFolders) make_output_folder(out / folder);
}

/// Pictures of ours in left/ and right/ that this run did not write: a replay would pair them.
void remove_others(const fs::path& out, const std::array<std::set<std::string>, 2>& written) {
  static const std::regex kOurs("[0-9]{6}\\.png|[0-9]{10}_[0-9]{9}\\.png");
  std::error_code ignored;
  for (std::size_t side = 0; side < written.size(); ++side) {
    std::vector<fs::path> others;
    for (const auto& entry : fs::directory_iterator(out / kFolders[side])) {
      const std::string name = entry.path().filename().string();
      if (std::regex_match(name, kOurs) && written[side].count(name) == 0) others.push_back(entry.path());
    }
    for (const fs::path& other : others) fs::remove(other, ignored);
  }
}

void remove_later_ones(const fs::path& out, std::uint64_t last) {
  std::error_code ignored;
  for (const char* folder : {"masks", "disparity"}) {
    for (std::uint64_t n = last + 1; fs::remove(out / folder / numbered(n), ignored); ++n) {
    }
  }
}

}  // namespace

int run_synth(const SynthArguments& arguments, std::ostream& messages) {
  constexpr std::string_view kPrefix = "synthetic:";
  const std::string name =
      arguments.scene.starts_with(kPrefix) ? arguments.scene.substr(kPrefix.size()) : arguments.scene;
  capture::SyntheticOptions options;
  options.seed = arguments.seed;
  options.frames = arguments.frames;
  const PictureSize size = parse_picture_size(arguments.size);
  options.width = size.width;
  options.height = size.height;
  options.truth = true;
  std::unique_ptr<capture::SyntheticSource> source;
  try {
    source = capture::open_synthetic(name, options);
  } catch (const capture::SceneError& error) {
    throw config::Error(error.what());
  }
  prepare(arguments.out);
  const Interrupts interrupts;

  Progress progress(messages, source->info().pairs);
  TruthFile truth_file;
  std::string pairs = "frame,left,right,right_off,skew_ns\n";
  std::array<std::set<std::string>, 2> written;
  std::uint64_t last = 0;
  std::future<void> writing;
  FramePair pair;
  while (!interrupts.asked()) {
    const capture::Next next = source->next(pair);
    if (next == capture::Next::kEnd) break;
    const capture::synthetic::Delivery& delivery = source->delivery();
    const bool whole = delivery.left && delivery.right;
    if (next == capture::Next::kSkipped && whole) throw std::runtime_error(source->skip_reason());
    const capture::GroundTruth& truth = source->truth();
    PairPictures pictures{{},
                          {copy_of(source->picture(0)), copy_of(source->picture(1)),
                           copy_of(truth.labels.data(), options.width, options.height, CV_8UC1),
                           copy_of(truth.disparity.data(), options.width, options.height, CV_16UC1)}};
    pictures.names.fill(numbered(pair.ordinal));
    if (source->delivers()) {
      const std::chrono::nanoseconds time = pair.capture_time.time_since_epoch();
      pictures.names[0] = stamped(time);
      pictures.names[1] = stamped(time + std::chrono::nanoseconds(delivery.skew_ns));
      pairs += pair_row(pair.ordinal, delivery);
    }
    for (std::size_t side = 0; side < written.size(); ++side) {
      if (!pictures.pictures[side].empty()) written[side].insert(pictures.names[side]);
    }
    truth_file.add(pair.ordinal, *source);
    last = pair.ordinal;
    if (writing.valid()) writing.get();
    writing =
        std::async(std::launch::async, [&out = arguments.out, pictures = std::move(pictures)] { pictures.write(out); });
    progress.step();
  }
  if (writing.valid()) writing.get();
  progress.finish();
  if (interrupts.asked()) {
    throw std::runtime_error(arguments.out.string() +
                             ": interrupted; the pictures so far are whole, gt.csv is missing");
  }
  remove_later_ones(arguments.out, last);
  remove_others(arguments.out, written);
  if (source->delivers()) {
    OutputFile pairs_file(arguments.out / "pairs.csv");
    pairs_file.write(pairs);
    pairs_file.commit();
  }
  calibration::write_opencv((arguments.out / "calibration.yml").string(), source->calibration());
  truth_file.save(arguments.out / "gt.csv");
  return 0;
}

}  // namespace stereotrack
