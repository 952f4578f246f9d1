// The pipeline takes each format that a source may give, and finds the same targets in each.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <iterator>
#include <map>
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

Pipeline::Setup setup_of(int width, int height, const StereoCalibration* calibration = nullptr) {
  Pipeline::Setup setup;
  setup.width = width;
  setup.height = height;
  setup.colour = true;
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

Targets targets_of(PixelFormat format) {
  capture::SyntheticOptions options;
  options.width = kWidth;
  options.height = kHeight;
  options.frames = kFrames;
  const auto source = capture::open_synthetic("eleven", options);
  const StereoCalibration calibration = source->calibration();
  Arena arena;
  Result<Pipeline> pipeline = Pipeline::create({}, setup_of(kWidth, kHeight, &calibration), arena);
  EXPECT_TRUE(pipeline.has_value());
  Targets found;
  FramePair pair;
  while (source->next(pair) == capture::Next::kPair) {
    std::optional<Owned> left;
    std::optional<Owned> right;
    if (format != PixelFormat::kBgr8) {
      left = converted(pair.left, format);
      right = converted(pair.right, format);
      pair.left = left->picture;
      pair.right = right->picture;
    }
    const Result<FrameResult> result = pipeline->run(pair);
    EXPECT_TRUE(result.has_value());
    if (!result.has_value()) return found;
    EXPECT_EQ(result->flags & kFlagNoColour, 0U);
    std::vector<TrackReport>& targets = found.emplace_back();
    std::copy_if(result->tracks.begin(), result->tracks.end(), std::back_inserter(targets),
                 [](const TrackReport& track) { return track.state == TrackState::kConfirmed && track.measured; });
  }
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

// Luma is the same to the bit; chroma is shared by two or four pixels, which moves the borders of what differs from its
// background by colour. Nine in ten must be the same; measured are 98 % with kYuyv, 93 % with kNv12.
TEST(PixelFormats, TargetsAreTheSameFromPackedPicturesAsFromBgr) {
  const Targets bgr = targets_of(PixelFormat::kBgr8);
  ASSERT_EQ(bgr.size(), static_cast<std::size_t>(kFrames));
  for (const PixelFormat format : {PixelFormat::kYuyv, PixelFormat::kNv12}) {
    const Targets packed = targets_of(format);
    ASSERT_EQ(packed.size(), bgr.size());
    for (const Agreement& agreement : {agreement_of(bgr, packed), agreement_of(packed, bgr)}) {
      EXPECT_GT(agreement.targets, 300);
      EXPECT_GE(agreement.same * 10, agreement.targets * 9) << static_cast<int>(format);
      EXPECT_GE(agreement.overlap, 0.95) << static_cast<int>(format);
      EXPECT_LE(agreement.apart, 0.005) << static_cast<int>(format);
    }
  }
}

// The same bytes in another order.
TEST(PixelFormats, UyvyIsYuyvInAnotherOrder) {
  const Targets yuyv = targets_of(PixelFormat::kYuyv);
  const Targets uyvy = targets_of(PixelFormat::kUyvy);
  ASSERT_EQ(yuyv.size(), uyvy.size());
  const Agreement agreement = agreement_of(yuyv, uyvy);
  EXPECT_GT(agreement.targets, 300);
  EXPECT_EQ(agreement.same, agreement.targets);
  EXPECT_EQ(agreement.overlap, 1);
  EXPECT_EQ(agreement.apart, 0);
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
  EXPECT_EQ(fault_of(32, 17, PixelFormat::kYuyv), std::nullopt);
  EXPECT_EQ(fault_of(32, 17, PixelFormat::kUyvy), std::nullopt);
  EXPECT_EQ(fault_of(32, 18, PixelFormat::kNv12), std::nullopt);
  EXPECT_EQ(fault_of(33, 17, PixelFormat::kYuyv), Fault::kBadSize);
  EXPECT_EQ(fault_of(33, 17, PixelFormat::kUyvy), Fault::kBadSize);
  EXPECT_EQ(fault_of(33, 18, PixelFormat::kNv12), Fault::kBadSize);
  EXPECT_EQ(fault_of(32, 17, PixelFormat::kNv12), Fault::kBadSize);
}

}  // namespace
}  // namespace stereotrack
