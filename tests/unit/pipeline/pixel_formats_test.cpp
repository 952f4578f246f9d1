// The pipeline takes each format that a source may give, and finds the same targets in each.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <iterator>
#include <map>
#include <memory>
#include <optional>
#include <vector>

#include "drivers/capture/synthetic/synthetic_source.hpp"
#include "pipeline/pipeline.hpp"
#include "tests/support/pixel_layouts.hpp"

namespace stereotrack {
namespace {

constexpr int kWidth = 320;
constexpr int kHeight = 240;
constexpr int kFrames = 200;

/// A picture with its memory.
struct Owned {
  std::vector<std::uint8_t> bytes;
  Picture picture;
};

Owned empty_picture(int width, int height, PixelFormat format, int padding = 0) {
  Owned made;
  const int stride = static_cast<int>(row_bytes(format, width)) + padding;
  made.bytes.assign(static_cast<std::size_t>(stride) * static_cast<std::size_t>(memory_rows(format, height)), 128);
  made.picture = {made.bytes.data(), width, height, stride, format};
  return made;
}

Pipeline::Setup setup_of(int width, int height, const StereoCalibration* calibration = nullptr, bool colour = true) {
  Pipeline::Setup setup;
  setup.width = width;
  setup.height = height;
  setup.colour = colour;
  setup.calibration = calibration;
  return setup;
}

FramePair mono(const Picture& picture) {
  FramePair pair;
  pair.ordinal = 1;
  pair.left = picture;
  return pair;
}

Owned converted(const Picture& bgr, PixelFormat format) {
  Owned made = empty_picture(bgr.width, bgr.height, format, 6);
  test::lay_out(bgr, format, made.picture.stride_bytes, made.bytes);
  return made;
}

/// The targets believed in and measured, frame by frame.
using Targets = std::vector<std::vector<TrackReport> >;

/// The scene in one format as its pipeline sees it.
class Run {
 public:
  Run(PixelFormat format, const StereoCalibration& calibration) : format_(format) {
    Result<Pipeline> made = Pipeline::create({}, setup_of(kWidth, kHeight, &calibration, has_colour(format)), arena_);
    EXPECT_TRUE(made.has_value());
    if (made.has_value()) pipeline_.emplace(*made);
  }

  void step(FramePair pair) {
    std::optional<Owned> left;
    std::optional<Owned> right;
    if (format_ != PixelFormat::kBgr8) {
      left = converted(pair.left, format_);
      right = converted(pair.right, format_);
      pair.left = left->picture;
      pair.right = right->picture;
    }
    ASSERT_TRUE(pipeline_.has_value());
    const Result<FrameResult> result = pipeline_->run(pair);
    ASSERT_TRUE(result.has_value());
    EXPECT_EQ((result->flags & kFlagNoColour) == 0, has_colour(format_));
    std::vector<TrackReport>& targets = found_.emplace_back();
    std::copy_if(result->tracks.begin(), result->tracks.end(), std::back_inserter(targets),
                 [](const TrackReport& track) { return track.state == TrackState::kConfirmed && track.measured; });
  }

  [[nodiscard]] const Targets& found() const { return found_; }

 private:
  PixelFormat format_;
  Arena arena_;
  std::optional<Pipeline> pipeline_;
  Targets found_;
};

/// In each of these formats; the scene, which takes longer to draw than to track, is drawn once.
std::vector<Targets> targets_of(const std::vector<PixelFormat>& formats) {
  capture::SyntheticOptions options;
  options.width = kWidth;
  options.height = kHeight;
  options.frames = kFrames;
  const auto source = capture::open_synthetic("eleven", options);
  const StereoCalibration calibration = source->calibration();
  std::vector<std::unique_ptr<Run> > runs;
  for (const PixelFormat format : formats) runs.push_back(std::make_unique<Run>(format, calibration));
  FramePair pair;
  while (source->next(pair) == capture::Next::kPair) {
    for (const auto& run : runs) run->step(pair);
  }
  std::vector<Targets> found;
  for (const auto& run : runs) found.push_back(run->found());
  return found;
}

double shared_part(const Rect& a, const Rect& b) {
  const double common = static_cast<double>(intersect(a, b).area());
  return common / (static_cast<double>(a.area()) + static_cast<double>(b.area()) - common);
}

/// How the targets of one run are found in another, which may number them differently.
struct Agreement {
  int targets = 0;     ///< of the one run, frame by frame
  int same = 0;        ///< of these, seen in the other run in the same place and under the same name throughout
  double overlap = 0;  ///< of their boxes, intersection over union, on average
  double apart = 0;    ///< of their positions, as a part of the distance, on average
};

Agreement agreement_of(const Targets& one, const Targets& other) {
  // Whom each is mistaken for, and how often.
  std::map<std::uint32_t, std::map<std::uint32_t, int> > partners;
  const auto partner_of = [](const TrackReport& target, const std::vector<TrackReport>& among) {
    const auto best = std::max_element(among.begin(), among.end(), [&](const TrackReport& a, const TrackReport& b) {
      return shared_part(target.box, a.box) < shared_part(target.box, b.box);
    });
    return best != among.end() && shared_part(target.box, best->box) >= 0.5 ? &*best : nullptr;
  };
  Agreement sum;
  for (std::size_t frame = 0; frame < one.size(); ++frame) {
    for (const TrackReport& target : one[frame]) {
      ++sum.targets;
      const TrackReport* partner = partner_of(target, other[frame]);
      if (partner == nullptr) continue;
      ++partners[target.id][partner->id];
      sum.overlap += shared_part(target.box, partner->box);
      sum.apart += (target.position - partner->position).norm() / target.position.norm();
    }
  }
  int found = 0;
  for (const auto& [id, names] : partners) {
    int most = 0;
    for (const auto& [name, count] : names) {
      most = std::max(most, count);
      found += count;
    }
    sum.same += most;
  }
  sum.overlap /= std::max(found, 1);
  sum.apart /= std::max(found, 1);
  return sum;
}

// How much of what one format finds another must find, too.
struct Demand {
  double same = 1;     ///< of the targets
  double overlap = 1;  ///< of their boxes, at least
  double apart = 0;    ///< of their positions, at most
};

void expect_agreement(const Targets& one, const Targets& other, const Demand& demand) {
  ASSERT_EQ(one.size(), static_cast<std::size_t>(kFrames));
  ASSERT_EQ(other.size(), one.size());
  for (const Agreement& agreement : {agreement_of(one, other), agreement_of(other, one)}) {
    EXPECT_GT(agreement.targets, 300);
    EXPECT_GE(agreement.same, demand.same * agreement.targets);
    EXPECT_GE(agreement.overlap, demand.overlap);
    EXPECT_LE(agreement.apart, demand.apart);
  }
}

// Luma is the same to the bit; chroma is shared by two or four pixels, which moves the borders of what differs from its
// background by colour. Nine in ten must be the same; measured are 98 % with kYuyv, 93 % with kNv12. The others are the
// same bytes in another order.
TEST(PixelFormats, TargetsAreTheSameFromPackedPicturesAsFromBgr) {
  const std::vector<Targets> found =
      targets_of({PixelFormat::kBgr8, PixelFormat::kYuyv, PixelFormat::kNv12, PixelFormat::kUyvy, PixelFormat::kRgb8});
  for (const std::size_t packed : {1U, 2U}) {
    SCOPED_TRACE(packed);
    expect_agreement(found[0], found[packed], {.same = 0.9, .overlap = 0.95, .apart = 0.005});
  }
  expect_agreement(found[1], found[3], {});
  expect_agreement(found[0], found[4], {});
}

// What the bits below the 8 most significant hold is of no consequence, and where they lie neither.
TEST(PixelFormats, TargetsAreTheSameFromGreyOfMoreBitsAsFromEight) {
  const std::vector<Targets> found =
      targets_of({PixelFormat::kGrey8, PixelFormat::kGrey10, PixelFormat::kGrey12, PixelFormat::kGrey16,
                  PixelFormat::kGrey10Packed, PixelFormat::kGrey12Packed});
  for (std::size_t other = 1; other < found.size(); ++other) {
    SCOPED_TRACE(other);
    expect_agreement(found[0], found[other], {});
  }
}

// A mosaic has a quarter of the samples of red and of blue, half of those of green, and what lies between them is made
// up: the finest texture is lost, and edges move by a pixel. Measured, with the four patterns: 87 to 96 % the same,
// their boxes by 0.87, their places by 0.9 to 6.5 % of the distance. That of ten bits is the same to the bit.
TEST(PixelFormats, TargetsAreTheSameFromMosaicsAsFromBgr) {
  const std::vector<Targets> found =
      targets_of({PixelFormat::kBgr8, PixelFormat::kBayerRggb8, PixelFormat::kBayerGrbg8, PixelFormat::kBayerGbrg8,
                  PixelFormat::kBayerBggr8, PixelFormat::kBayerGrbg10, PixelFormat::kBayerBggr10Packed});
  for (std::size_t mosaic = 1; mosaic <= 4; ++mosaic) {
    SCOPED_TRACE(mosaic);
    expect_agreement(found[0], found[mosaic], {.same = 0.8, .overlap = 0.85, .apart = 0.08});
  }
  expect_agreement(found[2], found[5], {});
  expect_agreement(found[4], found[6], {});
}

TEST(PixelFormats, GreyPicturesWhereColourWasAnnouncedAreAFault) {
  Arena arena;
  Result<Pipeline> pipeline = Pipeline::create({}, setup_of(32, 16), arena);
  ASSERT_TRUE(pipeline.has_value());
  const Owned grey = empty_picture(32, 16, PixelFormat::kGrey8);
  EXPECT_EQ(pipeline->run(mono(grey.picture)).error(), Fault::kBadFormat);
}

TEST(PixelFormats, SizesThatAFormatCannotHaveAreAFault) {
  const auto fault_of = [](int width, int height, PixelFormat format) -> std::optional<Fault> {
    Arena arena;
    Result<Pipeline> pipeline = Pipeline::create({}, setup_of(width, height), arena);
    EXPECT_TRUE(pipeline.has_value());
    const Owned one = empty_picture(width, height + 1, format);  // a row more than is said
    Picture picture = one.picture;
    picture.height = height;
    const Result<FrameResult> result = pipeline->run(mono(picture));
    if (result.has_value()) return std::nullopt;
    return result.error();
  };
  EXPECT_EQ(fault_of(33, 17, PixelFormat::kBgr8), std::nullopt);
  EXPECT_EQ(fault_of(33, 17, PixelFormat::kRgb8), std::nullopt);
  EXPECT_EQ(fault_of(32, 17, PixelFormat::kYuyv), std::nullopt);
  EXPECT_EQ(fault_of(32, 17, PixelFormat::kUyvy), std::nullopt);
  EXPECT_EQ(fault_of(32, 18, PixelFormat::kNv12), std::nullopt);
  EXPECT_EQ(fault_of(33, 17, PixelFormat::kYuyv), Fault::kBadSize);
  EXPECT_EQ(fault_of(33, 17, PixelFormat::kUyvy), Fault::kBadSize);
  EXPECT_EQ(fault_of(33, 18, PixelFormat::kNv12), Fault::kBadSize);
  EXPECT_EQ(fault_of(32, 17, PixelFormat::kNv12), Fault::kBadSize);
  for (int i = static_cast<int>(PixelFormat::kBayerRggb8); i < kPixelFormats; ++i) {
    const auto format = static_cast<PixelFormat>(i);
    const bool in_fours = format >= PixelFormat::kBayerRggb10Packed;
    EXPECT_EQ(fault_of(36, 18, format), std::nullopt) << i;
    EXPECT_EQ(fault_of(34, 18, format), in_fours ? std::optional(Fault::kBadSize) : std::nullopt) << i;
    EXPECT_EQ(fault_of(33, 18, format), Fault::kBadSize) << i;
    EXPECT_EQ(fault_of(36, 17, format), Fault::kBadSize) << i;
  }
}

TEST(PixelFormats, GreySizesThatAFormatCannotHaveAreAFault) {
  const auto fits = [](int width, PixelFormat format) { return fits_format(format, width, 17); };
  for (const PixelFormat format : {PixelFormat::kGrey10, PixelFormat::kGrey12, PixelFormat::kGrey16}) {
    EXPECT_TRUE(fits(33, format)) << static_cast<int>(format);
  }
  EXPECT_TRUE(fits(36, PixelFormat::kGrey10Packed));
  EXPECT_FALSE(fits(34, PixelFormat::kGrey10Packed));
  EXPECT_TRUE(fits(34, PixelFormat::kGrey12Packed));
  EXPECT_FALSE(fits(33, PixelFormat::kGrey12Packed));
}

}  // namespace
}  // namespace stereotrack
