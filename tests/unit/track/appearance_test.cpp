#include "pipeline/track/appearance.hpp"

#include <gtest/gtest.h>

#include <random>
#include <vector>

namespace stereotrack {
namespace {

struct Colour {
  std::uint8_t y, cb, cr;
};

// Y at the ends of its range, where both halves of a pixel fall into one bin.
constexpr Colour kBlack{8, 128, 128};
constexpr Colour kWhite{250, 128, 128};
constexpr Colour kRed{120, 100, 170};

void paint(Appearance& appearance, const Colour& colour, int pixels) {
  for (int i = 0; i < pixels; ++i) appearance.add(colour.y, colour.cb, colour.cr);
}

Appearance of(const Colour& colour, int pixels = 100) {
  Appearance out;
  paint(out, colour, pixels);
  return out;
}

double share(const Appearance& appearance, const Colour& colour) {
  return appearance.share(colour.y, colour.cb, colour.cr);
}

TEST(Appearance, ShareIsThePartOfThePixelsOfThatColour) {
  Appearance both = of(kBlack, 30);
  paint(both, kWhite, 10);
  EXPECT_DOUBLE_EQ(share(both, kBlack), 0.75);
  EXPECT_DOUBLE_EQ(share(both, kWhite), 0.25);
  EXPECT_EQ(share(both, kRed), 0);
  EXPECT_EQ(share(both, {8, 160, 128}), 0) << "as dark, but not grey";
}

TEST(Appearance, PixelCountsHalfInItsBinAndHalfInTheNextNearerOne) {
  // Bins of 32 grey levels: 77 is in 64..95, its lower half, and next to it is 32..63.
  const Appearance one = of({77, 128, 128}, 1);
  EXPECT_DOUBLE_EQ(one.share(64, 128, 128), 0.5);
  EXPECT_DOUBLE_EQ(one.share(95, 128, 128), 0.5);
  EXPECT_DOUBLE_EQ(one.share(63, 128, 128), 0.5);
  EXPECT_EQ(one.share(96, 128, 128), 0);
  EXPECT_EQ(one.share(31, 128, 128), 0);
}

TEST(Appearance, CountsOfRowsAreThePixelsOneByOne) {
  std::mt19937 engine(4);
  for (const bool grey : {false, true}) {
    Appearance one_by_one;
    Appearance::Counts counts;
    for (int n = 0; n < 300; ++n) {  // every level, and rows of every length up to 299
      std::vector<std::uint8_t> y(static_cast<std::size_t>(n));
      std::vector<std::uint8_t> cb(y.size(), 128);
      std::vector<std::uint8_t> cr(y.size(), 128);
      for (std::size_t i = 0; i < y.size(); ++i) {
        y[i] = static_cast<std::uint8_t>(engine());
        if (!grey) cb[i] = static_cast<std::uint8_t>(engine());
        if (!grey) cr[i] = static_cast<std::uint8_t>(engine());
        one_by_one.add(y[i], cb[i], cr[i]);
      }
      counts.add(y.data(), grey ? nullptr : cb.data(), grey ? nullptr : cr.data(), n);
    }
    const Appearance together(counts);
    for (int y = 0; y < 256; ++y) {
      for (int chroma = 0; chroma < 256; chroma += 5) {
        const Colour colour{static_cast<std::uint8_t>(y), static_cast<std::uint8_t>(chroma),
                            static_cast<std::uint8_t>(255 - chroma / 2)};
        ASSERT_EQ(share(together, colour), share(one_by_one, colour)) << y << ' ' << chroma;
      }
    }
    EXPECT_EQ(together.explains(one_by_one), 1);
  }
  EXPECT_FALSE(Appearance(Appearance::Counts()).known());
}

TEST(Appearance, GreyStaysGreyUnderASlightTint) {
  for (const int tint : {-6, -2, 2, 5}) {
    const auto c = static_cast<std::uint8_t>(128 + tint);
    EXPECT_DOUBLE_EQ(of({100, 128, 128}).explains(of({100, c, c})), 1) << tint;
  }
}

TEST(Appearance, ExplainsItselfAndNoStranger) {
  Appearance mixed = of(kBlack, 30);
  paint(mixed, kRed, 50);
  EXPECT_NEAR(mixed.explains(mixed), 1, 1e-6);
  EXPECT_NEAR(of(kRed, 7).explains(of(kRed, 900)), 1, 1e-6) << "whatever their sizes";
  EXPECT_EQ(mixed.explains(of(kWhite)), 0);
  EXPECT_EQ(of(kWhite).explains(mixed), 0);
  EXPECT_NEAR(mixed.explains(of({8, 60, 128})), 0, 1e-6) << "as dark, but blue";
}

TEST(Appearance, PartOfAThingIsExplainedIfItIsKnownToBeAPart) {
  Appearance thing = of(kBlack, 50);
  paint(thing, kWhite, 50);
  EXPECT_NEAR(thing.explains(of(kBlack, 50), 0.5), 1, 1e-6);
  EXPECT_NEAR(thing.explains(of(kBlack, 50)), 0.5, 1e-6) << "the white half is missing";
  EXPECT_EQ(thing.explains(of(kRed, 50), 0.5), 0) << "not a part of it";
  EXPECT_NEAR(thing.explains(of(kBlack, 50), 7), 0.5, 1e-6) << "a part is no more than the whole";
}

TEST(Appearance, UnknownExplainsAndIsExplainedByEverything) {
  const Appearance unknown;
  EXPECT_FALSE(unknown.known());
  EXPECT_EQ(unknown.explains(of(kRed)), 1);
  EXPECT_EQ(of(kRed).explains(unknown), 1);
  EXPECT_EQ(share(unknown, kRed), 0);
  Appearance cleared = of(kRed);
  EXPECT_TRUE(cleared.known());
  cleared.clear();
  EXPECT_FALSE(cleared.known());
}

TEST(Appearance, LearnsByTheRate) {
  Appearance appearance = of(kBlack, 10);
  appearance.learn(of(kWhite, 1000), 0.25);
  EXPECT_NEAR(share(appearance, kBlack), 0.75, 1e-6) << "whatever the number of pixels";
  EXPECT_NEAR(share(appearance, kWhite), 0.25, 1e-6);
  appearance.learn(of(kWhite), 0.5);
  EXPECT_NEAR(share(appearance, kBlack), 0.375, 1e-6);
  EXPECT_NEAR(share(appearance, kWhite), 0.625, 1e-6);
  appearance.learn(of(kRed), 0);
  EXPECT_NEAR(share(appearance, kWhite), 0.625, 1e-6);
  EXPECT_EQ(share(appearance, kRed), 0);
  appearance.learn(of(kBlack), 1);
  EXPECT_NEAR(appearance.explains(of(kBlack)), 1, 1e-6);
  EXPECT_EQ(share(appearance, kWhite), 0);
}

TEST(Appearance, UnknownLearnsAtOnceAndNothingIsLearntFromTheUnknown) {
  Appearance appearance;
  appearance.learn(of(kBlack), 0.1);
  EXPECT_DOUBLE_EQ(share(appearance, kBlack), 1);
  appearance.learn(Appearance{}, 0.9);
  EXPECT_DOUBLE_EQ(share(appearance, kBlack), 1);
}

TEST(Appearance, SlightChangeOfLightMovesLittle) {
  const auto shaded = [](int from, int change) {
    Appearance out;
    for (int y = from; y < from + 96; ++y) out.add(static_cast<std::uint8_t>(y + change), 128, 128);
    return out;
  };
  EXPECT_GT(shaded(60, 0).explains(shaded(60, 8)), 0.85);
  EXPECT_LT(shaded(60, 0).explains(shaded(60, 90)), 0.4) << "another light is not slight";
  // Of one colour: 8 levels on, one of its two bins is still the same; three bins on, none is.
  for (int y = 0; y < 248; ++y) {
    const Appearance before = of({static_cast<std::uint8_t>(y), 128, 128});
    EXPECT_GE(before.explains(of({static_cast<std::uint8_t>(y + 8), 128, 128})), 0.5 - 1e-6) << y;
    if (y < 160) {
      EXPECT_EQ(before.explains(of({static_cast<std::uint8_t>(y + 96), 128, 128})), 0) << y;
    }
  }
}

TEST(Appearance, ChromaBeyondTheBinsIsInTheOuterOnes) {
  EXPECT_NEAR(of({8, 0, 128}).explains(of({8, 80, 128})), 1, 1e-6);
  EXPECT_NEAR(of({8, 128, 255}).explains(of({8, 128, 176})), 1, 1e-6);
  EXPECT_EQ(of({8, 0, 128}).explains(of({8, 255, 128})), 0);
}

}  // namespace
}  // namespace stereotrack
