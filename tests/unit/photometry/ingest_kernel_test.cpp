#include "pipeline/photometry/ingest_kernel.hpp"

#include <gtest/gtest.h>

#include <random>
#include <string>
#include <utility>
#include <vector>

#include "pipeline/photometry/colour.hpp"
#include "tests/support/each_target.hpp"

namespace stereotrack {
namespace {

using test::kRowLengths;
using test::on_each_target;
using Row = std::vector<std::uint8_t>;

Row random_row(std::size_t size, unsigned seed) {
  std::mt19937 engine(seed);
  Row row(size);
  for (std::uint8_t& value : row) value = static_cast<std::uint8_t>(engine());
  return row;
}

/// Rows of three planes, with one byte more, so that a write past their end is seen.
struct Out {
  explicit Out(int width) {
    for (Row& row : rows) row.assign(static_cast<std::size_t>(width) + 1, 77);
  }
  PlaneRow colour() { return {rows[0].data(), rows[1].data(), rows[2].data()}; }
  PlaneRow luma() { return {rows[0].data(), nullptr, nullptr}; }
  bool operator==(const Out&) const = default;
  Row rows[3];
};

TEST(IngestKernel, EveryColourIsTheReference) {
  constexpr int kSize = 65536;
  Row bgr(3 * kSize);
  for (int b = 0; b < 256; ++b) {
    for (std::size_t i = 0; i < kSize; ++i) {
      bgr[3 * i] = static_cast<std::uint8_t>(b);
      bgr[3 * i + 1] = static_cast<std::uint8_t>(i);
      bgr[3 * i + 2] = static_cast<std::uint8_t>(i >> 8);
    }
    Out expected(kSize);
    colour_row_reference(bgr.data(), ColourOrder::kBlueFirst, kSize, expected.colour());
    on_each_target([&] {
      Out got(kSize);
      colour_row(bgr.data(), ColourOrder::kBlueFirst, kSize, got.colour());
      EXPECT_TRUE(got == expected) << "blue " << b;
    });
  }
}

// As `row` with each target, with and without chroma, against `reference`, at all lengths that are a multiple of
// `step`.
template <class Rows, class Reference>
void expect_reference_at_every_length(int step, Rows&& row, Reference&& reference) {
  const Row source = random_row(1000, 1);
  for (const int width : kRowLengths) {
    if (width % step != 0) continue;
    for (const bool colour : {false, true}) {
      Out expected(width);
      reference(source.data() + 1, width, colour ? expected.colour() : expected.luma());
      on_each_target([&] {
        Out got(width);
        row(source.data() + 1, width, colour ? got.colour() : got.luma());
        EXPECT_TRUE(got == expected) << width << (colour ? " colour" : " luma");
      });
    }
  }
}

TEST(IngestKernel, ColourRowIsTheReferenceAtEveryLengthAndNothingBeyondIsTouched) {
  for (const ColourOrder order : {ColourOrder::kBlueFirst, ColourOrder::kRedFirst}) {
    expect_reference_at_every_length(
        1, [&](const std::uint8_t* from, int width, const PlaneRow& out) { colour_row(from, order, width, out); },
        [&](const std::uint8_t* from, int width, const PlaneRow& out) {
          colour_row_reference(from, order, width, out);
        });
  }
}

TEST(IngestKernel, CopiedRowIsTheReferenceAtEveryLengthAndNothingBeyondIsTouched) {
  expect_reference_at_every_length(
      1, [](const std::uint8_t* from, int width, const PlaneRow& out) { copy_row(from, width, out.y); },
      [](const std::uint8_t* from, int width, const PlaneRow& out) { copy_row_reference(from, width, out.y); });
}

TEST(IngestKernel, PackedRowIsTheReferenceAtEveryLengthAndNothingBeyondIsTouched) {
  for (const PackedOrder order : {PackedOrder::kLumaFirst, PackedOrder::kChromaFirst}) {
    expect_reference_at_every_length(
        2, [&](const std::uint8_t* from, int width, const PlaneRow& out) { packed_row(from, order, width, out); },
        [&](const std::uint8_t* from, int width, const PlaneRow& out) {
          packed_row_reference(from, order, width, out);
        });
  }
}

TEST(IngestKernel, UnpackedRowIsTheReferenceAtEveryLengthAndNothingBeyondIsTouched) {
  struct Layout {
    SampleLayout layout;
    int together;
  };
  for (const Layout& one : {Layout{SampleLayout::kBytes, 1},
                            {SampleLayout::kWords10, 1},
                            {SampleLayout::kWords12, 1},
                            {SampleLayout::kWords16, 1},
                            {SampleLayout::kPacked10, 4},
                            {SampleLayout::kPacked12, 2}}) {
    SCOPED_TRACE(static_cast<int>(one.layout));
    expect_reference_at_every_length(
        one.together,
        [&](const std::uint8_t* from, int width, const PlaneRow& out) { unpack_row(from, one.layout, width, out.y); },
        [&](const std::uint8_t* from, int width, const PlaneRow& out) {
          unpack_row_reference(from, one.layout, width, out.y);
        });
  }
}

// Each value of 16 bits, those too that a sample of 10 or 12 cannot have.
TEST(IngestKernel, EveryWordIsItsMostSignificantBits) {
  Row words(2 * 65536);
  for (std::size_t i = 0; i < 65536; ++i) {
    words[2 * i] = static_cast<std::uint8_t>(i);
    words[2 * i + 1] = static_cast<std::uint8_t>(i >> 8);
  }
  on_each_target([&] {
    for (const auto& [layout, shift] :
         {std::pair{SampleLayout::kWords10, 2}, {SampleLayout::kWords12, 4}, {SampleLayout::kWords16, 8}}) {
      Row got(65536);
      unpack_row(words.data(), layout, 65536, got.data());
      int wrong = 0;
      for (std::size_t i = 0; i < 65536; ++i) wrong += got[i] == static_cast<std::uint8_t>(i >> shift) ? 0 : 1;
      EXPECT_EQ(wrong, 0) << "by " << shift;
    }
  });
}

TEST(IngestKernel, PackedSamplesByHand) {
  // V4L2_PIX_FMT_Y10P: four bytes of bits 9..2, one of the bits 1..0. V4L2_PIX_FMT_Y12P: two and one.
  on_each_target([] {
    const Row ten{1, 2, 3, 4, 0xFF, 5, 6, 7, 255, 0xFF};
    Row out(9, 77);
    unpack_row(ten.data(), SampleLayout::kPacked10, 8, out.data());
    EXPECT_EQ(out, (Row{1, 2, 3, 4, 5, 6, 7, 255, 77}));
    const Row twelve{1, 2, 0xFF, 3, 255, 0xFF};
    out.assign(5, 77);
    unpack_row(twelve.data(), SampleLayout::kPacked12, 4, out.data());
    EXPECT_EQ(out, (Row{1, 2, 3, 255, 77}));
  });
}

TEST(IngestKernel, BayerRowIsTheReferenceAtEveryLengthAndNothingBeyondIsTouched) {
  for (const bool red : {false, true}) {
    for (const bool green_first : {false, true}) {
      SCOPED_TRACE(std::string(red ? "red" : "blue") + (green_first ? " after green" : " first"));
      const auto rows = [&](const std::uint8_t* from) {
        return BayerRows{from, from + 250, from + 600, red, green_first};
      };
      expect_reference_at_every_length(
          2, [&](const std::uint8_t* from, int width, const PlaneRow& out) { bayer_row(rows(from), width, out); },
          [&](const std::uint8_t* from, int width, const PlaneRow& out) {
            bayer_row_reference(rows(from), width, out);
          });
    }
  }
}

TEST(IngestKernel, BayerRowByHand) {
  // Columns -1 to 4 of a row of green and red, of blue and green above and below. At (0): red 60, green (10 + 20 + 30 +
  // 41 + 2) / 4 = 25, blue (100 + 110 + 120 + 131 + 2) / 4 = 115. At (1): green 30, red (60 + 71 + 1) / 2 = 66, blue
  // (110 + 131 + 1) / 2 = 121.
  const Row above{100, 10, 110, 11, 112, 12};
  const Row row{41, 60, 30, 71, 31, 80};
  const Row below{120, 20, 131, 21, 133, 22};
  on_each_target([&] {
    Out out(2);
    bayer_row({above.data() + 1, row.data() + 1, below.data() + 1, true, false}, 2, out.colour());
    const std::uint8_t first = luma(115, 25, 60);
    const std::uint8_t second = luma(121, 30, 66);
    EXPECT_EQ(out.rows[0], (Row{first, second, 77}));
    EXPECT_EQ(out.rows[1], (Row{chroma_blue(115, first), chroma_blue(121, second), 77}));
    EXPECT_EQ(out.rows[2], (Row{chroma_red(60, first), chroma_red(66, second), 77}));
  });
}

TEST(IngestKernel, ChromaPairsAreTheReferenceAtEveryLengthAndNothingBeyondIsTouched) {
  const Row source = random_row(300, 2);
  for (const int width : kRowLengths) {
    if (width % 2 != 0) continue;
    Out expected(width);
    chroma_pairs_row_reference(source.data() + 1, width, expected.rows[1].data(), expected.rows[2].data());
    on_each_target([&] {
      Out got(width);
      chroma_pairs_row(source.data() + 1, width, got.rows[1].data(), got.rows[2].data());
      EXPECT_TRUE(got == expected) << width;
    });
  }
}

TEST(IngestKernel, PackedPairsByHand) {
  on_each_target([] {
    const Row pixels{10, 100, 11, 200, 12, 101, 13, 201};
    Out out(4);
    packed_row(pixels.data(), PackedOrder::kLumaFirst, 4, out.colour());
    EXPECT_EQ(out.rows[0], (Row{10, 11, 12, 13, 77}));
    EXPECT_EQ(out.rows[1], (Row{100, 100, 101, 101, 77}));
    EXPECT_EQ(out.rows[2], (Row{200, 200, 201, 201, 77}));
    packed_row(pixels.data(), PackedOrder::kChromaFirst, 4, out.colour());
    EXPECT_EQ(out.rows[0], (Row{100, 200, 101, 201, 77}));
    EXPECT_EQ(out.rows[1], (Row{10, 10, 12, 12, 77}));
    EXPECT_EQ(out.rows[2], (Row{11, 11, 13, 13, 77}));
    chroma_pairs_row(pixels.data(), 4, out.rows[1].data(), out.rows[2].data());
    EXPECT_EQ(out.rows[1], (Row{10, 10, 11, 11, 77}));
    EXPECT_EQ(out.rows[2], (Row{100, 100, 200, 200, 77}));
  });
}

TEST(HistogramCounter, CountsEachPixelOfEveryLengthOnce) {
  HistogramCounter counter;
  Histogram expected{};
  for (const int width : kRowLengths) {
    const Row row = random_row(static_cast<std::size_t>(width) + 1, static_cast<unsigned>(width));
    counter.add_row(row.data(), width);
    for (int x = 0; x < width; ++x) ++expected[row[static_cast<std::size_t>(x)]];
  }
  EXPECT_EQ(counter.sum(), expected);
}

}  // namespace
}  // namespace stereotrack
