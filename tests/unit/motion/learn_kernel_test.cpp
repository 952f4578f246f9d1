#include "pipeline/motion/learn_kernel.hpp"

#include <gtest/gtest.h>

#include <random>
#include <vector>

#include "tests/support/each_target.hpp"

namespace stereotrack {
namespace {

using test::kRowLengths;
using test::on_each_target;

constexpr LearnRates kRates{.window = 60, .absorb = 300, .pull = 2};

/// The state of a row, owned, and the pictures that it learns from.
struct State {
  std::vector<std::uint16_t> mean[3];
  std::vector<std::uint16_t> deviation[3];
  std::vector<std::uint16_t> candidate[3];
  std::vector<std::uint16_t> age;
  std::vector<std::uint16_t> candidate_age;
  friend bool operator==(const State&, const State&) = default;
};

struct Sight {
  std::vector<std::uint8_t> now[3];
  std::vector<std::uint8_t> mask;
};

int learn(const decltype(learn_row)& function, State& state, const Sight& sight, int colours, const LearnRates& rates,
          int from, int width) {
  LearnRow row;
  for (int c = 0; c < colours; ++c) {
    row.channels[static_cast<std::size_t>(c)] = {sight.now[c].data() + from, state.mean[c].data() + from,
                                                 state.deviation[c].data() + from, state.candidate[c].data() + from};
  }
  row.count = colours;
  row.age = state.age.data() + from;
  row.candidate_age = state.candidate_age.data() + from;
  row.mask = sight.mask.data() + from;
  return function(row, rates, width);
}

class Draw {
 public:
  explicit Draw(unsigned seed) : engine_(seed) {}
  int operator()(int low, int high) { return std::uniform_int_distribution<int>(low, high)(engine_); }

 private:
  std::mt19937 engine_;
};

State empty_state(std::size_t size) {
  State state;
  for (int c = 0; c < 3; ++c) {
    for (auto* plane : {&state.mean[c], &state.deviation[c], &state.candidate[c]}) plane->resize(size);
  }
  state.age.resize(size);
  state.candidate_age.resize(size);
  return state;
}

/// A row of a scene with background, foreground that stays, comes and goes, ghosts, and forgetting.
Sight sight_of(std::size_t size, Draw& draw, int frame) {
  Sight sight;
  for (auto& plane : sight.now) plane.resize(size);
  sight.mask.resize(size);
  for (std::size_t x = 0; x < size; ++x) {
    const bool object = x % 50 > 30 && frame % 40 > 12;
    for (auto& plane : sight.now) {
      plane[x] = static_cast<std::uint8_t>((object ? 180 : 60) + draw(-6, 6) * (draw(0, 9) == 0 ? 5 : 1));
    }
    sight.mask[x] = object || draw(0, 29) == 0 ? 255 : 0;
    if (draw(0, 199) == 0) sight.mask[x] = 1;
    if (x % 50 > 40 && object) sight.mask[x] = 2;
    if (x >= 130 && x < 200) sight.mask[x] = 0;  // some vectors are background as a whole
  }
  return sight;
}

TEST(LearnKernel, SequencesOfPicturesLeaveTheReferencesState) {
  constexpr std::size_t kSize = 333;
  for (const LearnRates& rates : {kRates, LearnRates{2, 2, 0}, LearnRates{1024, 60000, 8}, LearnRates{30, 12, 1}}) {
    for (const int colours : {1, 3}) {
      on_each_target([&] {
        Draw draw(9);
        State expected = empty_state(kSize);
        State got = expected;
        for (int frame = 0; frame < 150; ++frame) {
          const Sight sight = sight_of(kSize, draw, frame);
          const int changed = learn(learn_row_reference, expected, sight, colours, rates, 0, kSize);
          EXPECT_EQ(learn(learn_row, got, sight, colours, rates, 0, kSize), changed);
          ASSERT_EQ(got, expected) << "frame " << frame;
        }
      });
    }
  }
}

TEST(LearnKernel, EveryLengthIsTheReferenceAndNothingBeyondIsTouched) {
  for (const int width : kRowLengths) {
    on_each_target([&] {
      Draw draw(5);
      State expected = empty_state(260);
      for (int frame = 0; frame < 20; ++frame) {
        (void)learn(learn_row_reference, expected, sight_of(260, draw, frame), 3, kRates, 0, 260);
      }
      State got = expected;
      const Sight sight = sight_of(260, draw, 20);
      const int changed = learn(learn_row_reference, expected, sight, 3, kRates, 1, width);
      EXPECT_EQ(learn(learn_row, got, sight, 3, kRates, 1, width), changed);
      EXPECT_EQ(got, expected) << width;
    });
  }
}

/// Rows of 65536 pixels: every distance that a picture can have from a mean, for one age after the other.
TEST(LearnKernel, EveryQuotientIsTheReference) {
  constexpr int kSize = 65536;
  const LearnRates rates{1024, 60000, 0};
  Sight sight;
  sight.mask.assign(kSize, 0);
  for (const int now : {0, 131, 255}) {
    sight.now[0].assign(kSize, static_cast<std::uint8_t>(now));
    for (int age = 1; age <= 1026; age += age < 80 ? 1 : 59) {
      State expected = empty_state(kSize);
      for (int i = 0; i < kSize; ++i) {
        expected.mean[0][static_cast<std::size_t>(i)] = static_cast<std::uint16_t>(i);
        expected.deviation[0][static_cast<std::size_t>(i)] = static_cast<std::uint16_t>(i * 40503);
      }
      expected.age.assign(kSize, static_cast<std::uint16_t>(age));
      const State before = expected;
      (void)learn(learn_row_reference, expected, sight, 1, rates, 0, kSize);
      on_each_target([&] {
        State got = before;
        (void)learn(learn_row, got, sight, 1, rates, 0, kSize);
        EXPECT_TRUE(got == expected) << age;
      });
    }
  }
}

TEST(LearnKernel, AnyStateIsTheReference) {
  constexpr std::size_t kSize = 20000;
  Draw draw(77);
  for (const LearnRates& rates : {kRates, LearnRates{2, 2, 8}, LearnRates{1024, 60000, 0}}) {
    State state = empty_state(kSize);
    Sight sight = sight_of(kSize, draw, 30);
    for (std::size_t x = 0; x < kSize; ++x) {
      for (int c = 0; c < 3; ++c) {
        const int now = draw(0, 255);
        sight.now[c][x] = static_cast<std::uint8_t>(now);
        state.mean[c][x] = static_cast<std::uint16_t>(draw(0, 65535));
        state.deviation[c][x] = static_cast<std::uint16_t>(draw(0, 65535));
        // Half of them about as far as a candidate may be.
        const int apart = draw(0, 1) == 0 ? draw(3070, 3074) * (draw(0, 1) * 2 - 1) : draw(-70000, 70000);
        state.candidate[c][x] = static_cast<std::uint16_t>(std::clamp(now * 256 + apart, 0, 65535));
      }
      state.age[x] = static_cast<std::uint16_t>(draw(0, 1) == 0 ? draw(0, 12) : draw(0, rates.absorb));
      state.candidate_age[x] =
          static_cast<std::uint16_t>(draw(0, 1) == 0 ? draw(0, 12) % rates.absorb : draw(0, rates.absorb - 1));
      sight.mask[x] = static_cast<std::uint8_t>(std::array{0, 1, 255, 2, 255}[static_cast<std::size_t>(draw(0, 4))]);
    }
    const State before = state;
    const int changed = learn(learn_row_reference, state, sight, 3, rates, 0, kSize);
    EXPECT_GT(changed, 8000);
    on_each_target([&] {
      State got = before;
      EXPECT_EQ(learn(learn_row, got, sight, 3, rates, 0, kSize), changed);
      EXPECT_EQ(got, state);
    });
  }
}

}  // namespace
}  // namespace stereotrack
