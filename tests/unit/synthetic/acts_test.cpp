#include <gtest/gtest.h>

#include <cmath>
#include <set>
#include <string>
#include <vector>

#include "drivers/capture/synthetic/scene.hpp"

namespace stereotrack::capture {
namespace {

class SyntheticActs : public testing::TestWithParam<std::string> {};

// Casts follow one another for as long as is asked for: two minutes are five of them.
TEST_P(SyntheticActs, EverySceneGoesOnForTwoMinutes) {
  for (const synthetic::SceneEntry& entry : synthetic::scenes()) {
    if (entry.name != GetParam()) continue;
    const synthetic::Scene scene = entry.make(3);
    EXPECT_EQ(scene.name, entry.name);
    std::set<std::uint32_t> ids;
    const int acts = static_cast<int>(std::ceil((120 + scene.prelude_s) / scene.act_s));
    for (int act = 0; act < acts; ++act) {
      const std::vector<synthetic::Actor> cast = scene.cast(static_cast<std::uint32_t>(act));
      EXPECT_FALSE(cast.empty());
      for (const synthetic::Actor& actor : cast) {
        EXPECT_TRUE(ids.insert(actor.id).second) << "id " << actor.id << " comes twice";
        // Whoever sets out earlier or leaves later would pop up or vanish in the picture.
        EXPECT_GE(actor.path.start_s(), act * scene.act_s - scene.prelude_s) << "id " << actor.id;
        EXPECT_LE(actor.path.end_s(), (act + 1) * scene.act_s - scene.prelude_s) << "id " << actor.id;
      }
    }
  }
}

std::vector<std::string> names() {
  std::vector<std::string> all;
  for (const synthetic::SceneEntry& entry : synthetic::scenes()) all.emplace_back(entry.name);
  return all;
}

INSTANTIATE_TEST_SUITE_P(Scenes, SyntheticActs, testing::ValuesIn(names()), [](const auto& name) {
  std::string word;
  for (const char c : name.param) word += c == '-' ? '_' : c;
  return word;
});

}  // namespace
}  // namespace stereotrack::capture
