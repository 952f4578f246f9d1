#include "drivers/capture/synthetic/scenes/dropout.hpp"

#include <array>
#include <utility>

#include "drivers/capture/synthetic/random.hpp"
#include "drivers/capture/synthetic/scenes/passers.hpp"
#include "drivers/capture/synthetic/scenes/yard.hpp"

namespace stereotrack::capture::synthetic {
namespace {

constexpr std::uint64_t kFirst = 41;  ///< frame
constexpr std::uint64_t kBlock = 20;  ///< frames
constexpr double kPeriod_ns = 1e9 / 30.0;

enum class Fault : std::uint8_t { kLeft, kRight, kBoth, kUnseen, kStamped };
constexpr std::size_t kFaults = 5;

struct Link {
  std::uint64_t key = 0;

  [[nodiscard]] Delivery at(std::uint64_t frame) const noexcept {
    Delivery d;
    d.skew_ns = static_cast<std::int64_t>(Random(key ^ mix_bits(frame)).uniform(-3e5, 3e5));
    if (frame < kFirst) return d;
    const std::uint64_t block = (frame - kFirst) / kBlock;
    const std::uint64_t cycle = block / kFaults;
    std::array<Fault, kFaults> order{Fault::kLeft, Fault::kRight, Fault::kBoth, Fault::kUnseen, Fault::kStamped};
    Random shuffle(mix_bits(key + cycle));
    for (std::size_t i = kFaults - 1; i > 0; --i) {
      std::swap(order[i], order[static_cast<std::size_t>(shuffle.below(static_cast<int>(i) + 1))]);
    }
    const Fault fault = order[static_cast<std::size_t>(block % kFaults)];
    constexpr std::array<int, kFaults> kMost{3, 3, 5, 8, 4};
    Random random(mix_bits(key ^ (block << 20U)));
    const auto begin = static_cast<std::uint64_t>(4 + random.below(7));
    const auto count = static_cast<std::uint64_t>(1 + random.below(kMost[static_cast<std::size_t>(fault)]));
    const int off = random.chance(0.5) ? 1 : -1;
    const double share = random.uniform(0.30, 0.45);
    const std::uint64_t place = (frame - kFirst) % kBlock;
    if (place < begin || place >= begin + count) return d;
    switch (fault) {
      case Fault::kLeft: d.left = false; break;
      case Fault::kRight: d.right = false; break;
      case Fault::kBoth: d.left = d.right = false; break;
      case Fault::kUnseen: d.right_off = off; break;
      case Fault::kStamped:
        d.right_off = off;
        d.skew_ns += static_cast<std::int64_t>(off * share * kPeriod_ns);
        break;
    }
    return d;
  }
};

}  // namespace

Scene make_dropout(std::uint64_t seed) {
  Scene scene;
  scene.name = "dropout";
  scene.seed = seed;
  Random random(seed * 1000003ULL + 1301);
  build_yard(scene, random);
  const Wardrobe wardrobe = make_wardrobe(scene, random);
  const Link link{random.bits()};
  scene.delivery = [link](std::uint64_t frame) { return link.at(frame); };
  let_pass(scene, wardrobe, {1301});
  return scene;
}

}  // namespace stereotrack::capture::synthetic
