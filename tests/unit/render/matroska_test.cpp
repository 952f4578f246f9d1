#include "firmware-app/render/matroska.hpp"

#include <gtest/gtest.h>

#include <vector>

namespace stereotrack::render {
namespace {

using Bytes = std::vector<std::uint8_t>;

Bytes changed(Bytes head) {
  make_ids_constant(head);
  return head;
}

TEST(Matroska, IdsBecomeOneAndTheCrcFollows) {
  // Segment of unknown size { Info { CRC-32, SegmentUID of 2 bytes }, Tracks { TrackEntry { TrackUID of 1 byte } } };
  // CRC-32 of 73 A4 82 00 01 by zlib: 0x2FEF1C28.
  const Bytes wanted{0x18, 0x53, 0x80, 0x67, 0x01, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF,  //
                     0x15, 0x49, 0xA9, 0x66, 0x8B, 0xBF, 0x84, 0,    0,    0,    0,           //
                     0x73, 0xA4, 0x82, 0x00, 0x01,                                            //
                     0x16, 0x54, 0xAE, 0x6B, 0x86, 0xAE, 0x84, 0x73, 0xC5, 0x81, 0x01};
  Bytes head = wanted;
  head[26] = 0xDE;
  head[27] = 0xAD;
  head.back() = 0x77;
  Bytes expected = wanted;
  const std::uint32_t crc = 0x2FEF1C28;
  for (std::size_t i = 0; i < 4; ++i) expected[19 + i] = static_cast<std::uint8_t>(crc >> 8U * i);
  EXPECT_EQ(changed(head), expected);
}

TEST(Matroska, OtherElementsStay) {
  const Bytes head{0x1A, 0x45, 0xDF, 0xA3, 0x84, 0x42, 0x86, 0x81, 0x05,  // EBML { EBMLVersion }
                   0xAE, 0x83, 0xD7, 0x81, 0x09};                         // TrackEntry { TrackNumber }
  EXPECT_EQ(changed(head), head);
}

TEST(Matroska, CutOffOrMeaninglessBytesStay) {
  for (const Bytes& head : {Bytes{}, Bytes{0}, Bytes{0x15}, Bytes{0x15, 0x49, 0xA9, 0x66}, Bytes{0x73, 0xA4, 0x80},
                            Bytes{0x73, 0xA4, 0x00, 0x10, 0x20}}) {
    EXPECT_EQ(changed(head), head);
  }
}

}  // namespace
}  // namespace stereotrack::render
