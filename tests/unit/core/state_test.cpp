#include "pipeline/core/state.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <vector>

#include "pipeline/core/arena.hpp"
#include "pipeline/core/checksum.hpp"
#include "pipeline/core/rect.hpp"
#include "pipeline/core/state_block.hpp"

namespace stereotrack {
namespace {

enum class Mood : std::uint8_t { kCalm, kBusy, kLost };

struct Part {
  double weight = 0;
  FixedVector<Point, 4> corners;
  template <class Self, class Archive>
  static void visit_state(Self& self, Archive& archive) noexcept {
    archive(self.weight, self.corners);
  }
};

struct Whole {
  bool started = false;
  int row = 0;
  Mood mood = Mood::kCalm;
  std::array<std::uint8_t, 3> table{};
  ImageView<std::uint16_t> picture;
  BoundedVector<Part> parts;
  std::optional<Part> extra;

  template <class Self, class Archive>
  static void visit_state(Self& self, Archive& archive) noexcept {
    archive(self.started);
    archive.bounded(self.row, 0, 9);
    archive.bounded(self.mood, Mood::kCalm, Mood::kLost);
    archive(self.table, self.picture, self.parts, self.extra);
  }
};

Whole make(Arena& arena) {
  Whole whole;
  whole.picture = arena.image<std::uint16_t>(5, 3);
  whole.parts = BoundedVector<Part>(arena.array<Part>(4));
  whole.extra.emplace();
  return whole;
}

Whole filled(Arena& arena) {
  Whole whole = make(arena);
  whole.started = true;
  whole.row = 7;
  whole.mood = Mood::kBusy;
  whole.table = {1, 2, 3};
  for (int y = 0; y < 3; ++y) {
    for (int x = 0; x < 5; ++x) whole.picture.at(x, y) = static_cast<std::uint16_t>(100 * y + x);
  }
  Part part;
  part.weight = 2.5;
  (void)part.corners.push({-1, 4});
  (void)part.corners.push({3, 8});
  (void)whole.parts.push(part);
  (void)whole.parts.push(Part{});
  whole.extra->weight = -1;
  return whole;
}

std::vector<std::byte> bytes_of(const Whole& whole) {
  StateWriter counter({});
  Whole::visit_state(whole, counter);
  std::vector<std::byte> bytes(counter.position());
  StateWriter writer(bytes);
  Whole::visit_state(whole, writer);
  return bytes;
}

TEST(State, WhatIsWrittenIsReadBack) {
  Arena arena;
  const std::vector<std::byte> bytes = bytes_of(filled(arena));
  Whole read = make(arena);
  (void)read.parts.push(Part{.weight = 9, .corners = {}});
  StateReader reader(bytes);
  Whole::visit_state(read, reader);
  EXPECT_FALSE(reader.failed());
  EXPECT_EQ(reader.position(), bytes.size());
  EXPECT_EQ(bytes_of(read), bytes);
  EXPECT_EQ(read.picture.at(4, 2), 204);
  EXPECT_EQ(read.parts.size(), 2U);
  EXPECT_EQ(read.parts[0].corners[1], (Point{3, 8}));
  EXPECT_EQ(read.mood, Mood::kBusy);
}

// started 1, row 4, mood 1, table 3, picture 5 x 3 x 2, parts 4 + (8 + 4 + 2 x 8) + (8 + 4), extra 8 + 4
TEST(State, FieldsLieOneAfterTheOtherWithoutPadding) {
  Arena arena;
  EXPECT_EQ(bytes_of(filled(arena)).size(), 1U + 4 + 1 + 3 + 30 + 4 + 28 + 12 + 12);
}

TEST(State, SizerSaysWhatFullListsTake) {
  Arena arena;
  Whole whole = make(arena);
  StateSizer sizer;
  Whole::visit_state(std::as_const(whole), sizer);
  EXPECT_EQ(sizer.bytes(), 1U + 4 + 1 + 3 + 30 + 4 + 4 * (8 + 4 + 4 * 8) + (8 + 4 + 4 * 8));
}

TEST(State, WindowsOfAnySizeGiveTheWhole) {
  Arena arena;
  const Whole whole = filled(arena);
  const std::vector<std::byte> bytes = bytes_of(whole);
  for (const std::size_t size : {1U, 2U, 7U, 30U, 64U, 1000U}) {
    std::vector<std::byte> joined(bytes.size());
    for (std::size_t first = 0; first < bytes.size(); first += size) {
      const std::span<std::byte> part = std::span(joined).subspan(first, std::min(size, bytes.size() - first));
      StateWriter writer(part, first);
      Whole::visit_state(whole, writer);
    }
    EXPECT_EQ(joined, bytes) << size;
  }
}

TEST(State, ReaderStopsWhereBytesAreMissing) {
  Arena arena;
  const std::vector<std::byte> bytes = bytes_of(filled(arena));
  for (std::size_t size = 0; size < bytes.size(); ++size) {
    Whole read = make(arena);
    StateReader reader(std::span<const std::byte>(bytes).first(size));
    Whole::visit_state(read, reader);
    EXPECT_TRUE(reader.failed()) << size;
  }
}

TEST(State, LengthBeyondCapacityFailsAndListStaysWithin) {
  Arena arena;
  std::vector<std::byte> bytes = bytes_of(filled(arena));
  bytes[1 + 4 + 1 + 3 + 30] = std::byte{5};  // of parts, which has room for 4
  Whole read = make(arena);
  StateReader reader(bytes);
  Whole::visit_state(read, reader);
  EXPECT_TRUE(reader.failed());
  EXPECT_LE(read.parts.size(), 4U);
}

TEST(State, ReaderTakesNoValueThatDoesHarm) {
  Arena arena;
  Whole whole = filled(arena);
  whole.row = 1000;
  whole.extra->weight = std::numeric_limits<double>::quiet_NaN();
  std::vector<std::byte> bytes = bytes_of(whole);
  bytes[0] = std::byte{77};
  bytes[5] = std::byte{200};
  Whole read = make(arena);
  StateReader reader(bytes);
  Whole::visit_state(read, reader);
  EXPECT_FALSE(reader.failed());
  EXPECT_EQ(bytes_of(read)[0], std::byte{1});
  EXPECT_EQ(read.row, 9);
  EXPECT_EQ(read.mood, Mood::kLost);
  EXPECT_EQ(read.extra->weight, 0);
}

TEST(Checksum, EachChangedBitChangesIt) {
  for (const std::size_t size : {0U, 1U, 7U, 8U, 9U, 31U, 32U, 33U, 100U}) {
    std::vector<std::byte> bytes(size, std::byte{0x5A});
    const std::uint64_t sum = checksum(bytes);
    for (std::size_t bit = 0; bit < size * 8; ++bit) {
      bytes[bit / 8] ^= static_cast<std::byte>(1U << (bit % 8));
      EXPECT_NE(checksum(bytes), sum) << size << ' ' << bit;
      bytes[bit / 8] ^= static_cast<std::byte>(1U << (bit % 8));
    }
    bytes.push_back(std::byte{0});
    EXPECT_NE(checksum(bytes), sum) << "a byte more";
  }
}

// So that recordings of one machine and version are read by the next.
TEST(Checksum, IsThatOfTheFormat) {
  std::vector<std::byte> bytes(100);
  for (std::size_t i = 0; i < bytes.size(); ++i) bytes[i] = static_cast<std::byte>(i);
  EXPECT_EQ(checksum(bytes), 7046581830653007688U);
}

std::vector<std::byte> block() {
  StateHeader header;
  header.fingerprint = 42;
  std::vector<std::byte> bytes(sizeof header + 100, std::byte{7});
  header.bytes = bytes.size();
  std::memcpy(bytes.data(), &header, sizeof header);
  return bytes;
}

TEST(StateBlock, IsOpenedOnceItIsSealed) {
  std::vector<std::byte> bytes = block();
  EXPECT_FALSE(open_state(bytes, 42).has_value());
  ASSERT_TRUE(seal_state(bytes).has_value());
  const auto body = open_state(bytes, 42);
  ASSERT_TRUE(body.has_value());
  EXPECT_EQ(body->size(), 100U);
}

TEST(StateBlock, IsRefusedWhereAnyBitDiffersOrAnotherConfigurationIsMeant) {
  std::vector<std::byte> bytes = block();
  ASSERT_TRUE(seal_state(bytes).has_value());
  EXPECT_FALSE(open_state(bytes, 43).has_value());
  EXPECT_FALSE(open_state(std::span(bytes).first(bytes.size() - 1), 42).has_value());
  EXPECT_FALSE(open_state({}, 42).has_value());
  const std::size_t reserved = offsetof(StateHeader, reserved);
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    if (i >= reserved && i < reserved + 4) continue;
    bytes[i] ^= std::byte{1};
    EXPECT_FALSE(open_state(bytes, 42).has_value()) << i;
    bytes[i] ^= std::byte{1};
  }
}

}  // namespace
}  // namespace stereotrack
