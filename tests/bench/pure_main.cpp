// The pure part of the project as a program that needs no OpenCV, for CPUs that there is only an emulator of. Drawing
// takes an emulator longest, so pairs come through a pipe from this program as it runs on the machine itself:
//     stereotrack_pure pairs A:B ...    pairs of synthetic:eleven to standard output, 1.8 MB each
//     stereotrack_pure work             matchers and pipelines, marked for whoever counts instructions (mark.hpp)
#include <CLI/CLI.hpp>
#include <array>
#include <chrono>
#include <cstdio>
#include <exception>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "drivers/capture/synthetic/synthetic_source.hpp"
#include "pipeline/core/simd.hpp"
#include "pipeline/photometry/ingest.hpp"
#include "pipeline/pipeline.hpp"
#include "pipeline/stereo/census_matcher.hpp"
#include "pipeline/stereo/sad_matcher.hpp"
#include "tests/bench/mark.hpp"
#include "tests/bench/settings.hpp"

namespace stereotrack::bench {

namespace {

constexpr int kWidth = 640;
constexpr int kHeight = 480;
constexpr int kDisparities = 64;

// A pipeline with its memory, on frames of synthetic:eleven.
class Tracked {
 public:
  Tracked(const std::vector<std::string>& settings, const StereoCalibration& calibration, StageObserver observer = {})
      : pipeline_(make(configured(settings).pipeline, calibration, observer)) {
    arena_.seal();
  }
  FrameResult run(const FramePair& pair) {
    const Result<FrameResult> result = pipeline_.run(pair);
    if (!result.has_value()) throw std::runtime_error(std::string("the pipeline: ") + to_string(result.error()));
    return *result;
  }

 private:
  Pipeline make(const PipelineConfig& config, const StereoCalibration& calibration, StageObserver observer) {
    Pipeline::Setup setup;
    setup.width = kWidth;
    setup.height = kHeight;
    setup.colour = true;
    setup.calibration = &calibration;
    setup.observer = observer;
    const Result<Pipeline> made = Pipeline::create(config, setup, arena_);
    if (!made.has_value()) throw std::runtime_error(std::string("the pipeline: ") + to_string(made.error()));
    return *made;
  }

  Arena arena_;
  Pipeline pipeline_;
};

// ---------------------------------------------------------------- pairs

constexpr std::size_t kPictureBytes = std::size_t{3} * kWidth * kHeight;

// What stands before each pair's two pictures, in the order of bytes that all our machines have.
struct PairHeader {
  std::uint64_t ordinal = 0;
  std::int64_t capture_time_ns = 0;
};

// The cameras of synthetic:eleven: ideal.
StereoCalibration ideal_cameras() { return capture::synthetic::Rig().calibration(kWidth, kHeight); }

void put(const void* data, std::size_t bytes) {
  if (std::fwrite(data, 1, bytes, stdout) != bytes) throw std::runtime_error("standard output takes no more");
}

void write_pairs(const std::vector<std::pair<std::uint64_t, std::uint64_t>>& ranges) {
  const auto source = capture::open_synthetic("eleven");
  for (const auto& [first, last] : ranges) {
    source->skip_to(first - 1);
    for (std::uint64_t ordinal = first; ordinal <= last; ++ordinal) {
      FramePair pair;
      if (source->next(pair) != capture::Next::kPair) throw std::runtime_error("synthetic:eleven has no such pair");
      const PairHeader header{pair.ordinal, pair.capture_time.time_since_epoch().count()};
      put(&header, sizeof header);
      for (const Picture* picture : {&pair.left, &pair.right}) {
        for (int y = 0; y < kHeight; ++y) put(picture->row(y), std::size_t{3} * kWidth);
      }
    }
  }
}

// Pairs from standard input; their pixels last until the next one is read.
class PairReader {
 public:
  // False at the end.
  bool next(FramePair& pair) {
    PairHeader header;
    const std::size_t got = std::fread(&header, 1, sizeof header, stdin);
    if (got == 0) return false;
    if (got != sizeof header || std::fread(pixels_.data(), 1, pixels_.size(), stdin) != pixels_.size()) {
      throw std::runtime_error("standard input ends within a pair");
    }
    pair = {};
    pair.ordinal = header.ordinal;
    pair.capture_time = CaptureTime(std::chrono::nanoseconds(header.capture_time_ns));
    pair.left = {pixels_.data(), kWidth, kHeight, std::ptrdiff_t{3} * kWidth, PixelFormat::kBgr8};
    pair.right = pair.left;
    pair.right.data += kPictureBytes;
    return true;
  }
  FramePair next() {
    FramePair pair;
    if (!next(pair)) throw std::runtime_error("standard input has too few pairs");
    return pair;
  }

 private:
  std::vector<std::uint8_t> pixels_ = std::vector<std::uint8_t>(2 * kPictureBytes);
};

// ---------------------------------------------------------------- work

// A matcher on the rectified pair that the benchmark's matchers have: the cameras of synthetic:eleven are ideal.
template <class Matcher>
void mark_matcher(Marks& marks, const std::string& name, const FramePair& pair, int calls) {
  Arena arena;
  const ImageView<std::uint8_t> left = arena.image<std::uint8_t>(kWidth, kHeight);
  const ImageView<std::uint8_t> right = arena.image<std::uint8_t>(kWidth, kHeight);
  const ImageView<std::uint16_t> out = arena.image<std::uint16_t>(kWidth, kHeight);
  Result<Ingest> ingest = Ingest::create(kWidth, arena);
  if (!ingest.has_value()) throw std::runtime_error(name + ": " + to_string(ingest.error()));
  ingest->run(pair.left, {.y = left, .cb = {}, .cr = {}}, nullptr);
  ingest->run(pair.right, {.y = right, .cb = {}, .cr = {}}, nullptr);
  typename Matcher::Config config;
  config.width = kWidth;
  config.height = kHeight;
  config.block = 9;
  config.range = {0, kDisparities - 1};
  Result<Matcher> matcher = Matcher::create(config, arena);
  if (!matcher.has_value()) throw std::runtime_error(name + ": " + to_string(matcher.error()));
  const std::size_t number = marks.number_of(name);
  (void)matcher->run(left, right, out);
  for (int i = 0; i < calls; ++i) {
    marks.begin();
    (void)matcher->run(left, right, out);
    marks.was(number);
    marks.end();
  }
}

// A pipeline whose stages are marked, NAME/STAGE.
class MarkedPipeline {
 public:
  MarkedPipeline(Marks& marks, const std::string& name, const std::vector<std::string>& settings,
                 const StereoCalibration& calibration)
      : marks_(marks), tracked_(settings, calibration, {&MarkedPipeline::stage_ended, this}) {
    for (std::size_t i = 0; i < kStages; ++i) {
      stages_[i] = marks.number_of(name + "/" + to_string(static_cast<Stage>(i)));
    }
    rest_ = marks.number_of(name + "/rest");
  }
  MarkedPipeline(const MarkedPipeline&) = delete;
  MarkedPipeline& operator=(const MarkedPipeline&) = delete;

  void run(const FramePair& pair, bool counts) {
    counts_ = counts;
    if (counts) marks_.begin();
    (void)tracked_.run(pair);
    if (!counts) return;
    marks_.was(rest_);
    marks_.end();
  }

 private:
  static void stage_ended(void* self, Stage stage) noexcept {
    const auto& pipeline = *static_cast<MarkedPipeline*>(self);
    if (pipeline.counts_) pipeline.marks_.was(pipeline.stages_[static_cast<std::size_t>(stage)]);
  }

  Marks& marks_;
  Tracked tracked_;
  std::array<std::size_t, kStages> stages_{};
  std::size_t rest_ = 0;
  bool counts_ = false;
};

void work(int warm_up) {
  Marks marks;
  PairReader pairs;
  {
    const FramePair pair = pairs.next();
    mark_matcher<SadMatcher>(marks, "sad_dense", pair, 2);
    mark_matcher<CensusMatcher>(marks, "census_dense", pair, 2);
  }
  const StereoCalibration calibration = with_lens(ideal_cameras());
  const std::vector<std::string> range = range_settings(kWidth, kDisparities);
  MarkedPipeline thesis(marks, "thesis", joined(thesis_settings(warm_up), range), calibration);
  MarkedPipeline robust(marks, "robust", joined({"preset=robust"}, range), calibration);
  MarkedPipeline shipped(marks, "robust_as_shipped", {"preset=robust"}, calibration);
  int frames = -warm_up;
  for (FramePair pair; pairs.next(pair); ++frames) {
    for (MarkedPipeline* pipeline : {&thesis, &robust, &shipped}) pipeline->run(pair, frames >= 0);
  }
  if (frames <= 0) throw std::runtime_error("standard input has too few pairs");
  std::printf("simd %s\n", to_string(simd_in_use()));
  for (std::size_t i = 0; i < marks.names().size(); ++i) std::printf("%zu %s\n", i + 1, marks.names()[i].c_str());
}

std::vector<std::pair<std::uint64_t, std::uint64_t>> parse_ranges(const std::vector<std::string>& texts) {
  std::vector<std::pair<std::uint64_t, std::uint64_t>> ranges;
  for (const std::string& text : texts) {
    unsigned long long first = 0;
    unsigned long long last = 0;
    int end = 0;
    if (std::sscanf(text.c_str(), "%llu:%llu%n", &first, &last, &end) != 2 || end != static_cast<int>(text.size()) ||
        first == 0 || last < first) {
      throw std::runtime_error(text + ": want A:B, ordinals from 1");
    }
    ranges.emplace_back(first, last);
  }
  return ranges;
}

}  // namespace
}  // namespace stereotrack::bench

int main(int argc, char** argv) {
  CLI::App app("The pipeline on synthetic:eleven, 640x480, without OpenCV.");
  app.require_subcommand(1);
  std::vector<std::string> ranges;
  CLI::App* pairs = app.add_subcommand("pairs", "draws pairs, to standard output");
  pairs->add_option("RANGES", ranges, "A:B, ordinals from 1, both included")->required();
  int warm_up = 32;
  CLI::App* work = app.add_subcommand(
      "work",
      "reads a pair for the matchers, and those of which the pipelines' count; prints the numbers of the marks");
  work->add_option("--warm-up", warm_up, "pairs that do not count, in which backgrounds are learnt")
      ->check(CLI::Range(1, 400))
      ->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  try {
    if (pairs->parsed()) stereotrack::bench::write_pairs(stereotrack::bench::parse_ranges(ranges));
    if (work->parsed()) stereotrack::bench::work(warm_up);
    if (std::fflush(stdout) != 0) throw std::runtime_error("standard output takes no more");
    return 0;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "stereotrack_pure: %s\n", error.what());
    return 1;
  }
}
