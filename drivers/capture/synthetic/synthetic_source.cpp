#include "drivers/capture/synthetic/synthetic_source.hpp"

#include <algorithm>
#include <cmath>
#include <exception>
#include <numbers>
#include <stdexcept>
#include <thread>

#include "drivers/capture/synthetic/random.hpp"
#include "pipeline/core/pinned_math.hpp"

namespace stereotrack::capture {
namespace {

using namespace synthetic;  // NOLINT(google-build-using-namespace): this file is the engine's outer wall

const SceneEntry& find_scene(const std::string& name) {
  for (const SceneEntry& entry : scenes()) {
    if (entry.name == name) return entry;
  }
  throw SceneError("synthetic:" + name + ": no such scene; there is " + scene_names());
}

void check(const std::string& name, const SyntheticOptions& o) {
  const auto refuse = [&](const std::string& what) { throw SceneError("synthetic:" + name + ": " + what); };
  if (o.width < 64 || o.width > 4096 || o.height < 48 || o.height > 3072) {
    refuse("size " + std::to_string(o.width) + "x" + std::to_string(o.height) + " is not within 64x48 to 4096x3072");
  }
  if (o.frames < 1 || o.frames > 100000) refuse(std::to_string(o.frames) + " frames is not within 1 to 100000");
  if (!(o.fps >= 1 && o.fps <= 1000)) refuse("frame rate " + std::to_string(o.fps) + " is not within 1 to 1000");
}

/// Clouds: slow waves of +-10 % of the sun, +-6 % of the sky; about half of that in grey levels.
LightLevel light_at(std::uint64_t seed, double t_s) noexcept {
  Random random(mix_bits(seed) + 77);
  const auto wave = [&](double period_s, double amplitude) {
    return amplitude * pinned_sin(2.0 * std::numbers::pi * (t_s / period_s + random.uniform()));
  };
  const double slow = wave(23.0, 0.075);
  const double quicker = wave(9.7, 0.025);
  return {1.0 + slow + quicker, 1.0 + 0.6 * slow + 0.4 * quicker};
}

}  // namespace

SyntheticSource::SyntheticSource(const std::string& name, const SyntheticOptions& options) : options_(options) {
  const SceneEntry& entry = find_scene(name);
  check(name, options);
  info_.name = "synthetic:" + name;
  info_.width = options.width;
  info_.height = options.height;
  info_.format = PixelFormat::kBgr8;
  info_.stereo = true;
  info_.has_time = true;
  info_.period = std::chrono::nanoseconds(static_cast<std::int64_t>(1e9 / options.fps + 0.5));
  info_.pairs = options.frames;

  scene_ = entry.make(options.seed);
  call_cast(0.0);
  calibration_ = scene_.rig.calibration(options.width, options.height);
  Random random(mix_bits(options.seed) + 5);
  // Linear gains; a grey level goes with about their square root: the right picture is 4 to 6 % darker or brighter.
  const double brighter = random.chance(0.5) ? random.uniform(1.095, 1.13) : random.uniform(0.885, 0.915);
  const std::array<Vec3, 2> gains{
      Vec3{1, 1, 1}, Vec3{brighter * random.uniform(0.97, 1.03), brighter, brighter * random.uniform(0.95, 1.05)}};
  constexpr double kExposure = 0.92;
  views_.reserve(2);
  for (int i = 0; i < 2; ++i) {
    views_.emplace_back(scene_, scene_.rig.camera(i, options.width, options.height));
    Sensor::Config config;
    config.seed = options.seed;
    config.camera = i;
    config.width = options.width;
    config.height = options.height;
    config.gain = gains[static_cast<std::size_t>(i)] * kExposure;
    sensors_.emplace_back(config);
    pixels_.emplace_back(3U * static_cast<std::size_t>(options.width) * static_cast<std::size_t>(options.height));
  }
}

void SyntheticSource::call_cast(double t_s) {
  // A cast starts up to its prelude before its act; acts do not overlap.
  const auto act = static_cast<std::int64_t>(std::floor((t_s + scene_.prelude_s) / scene_.act_s));
  if (act == act_) return;
  cast_ = scene_.cast(static_cast<std::uint32_t>(act));
  act_ = act;
}

Next SyntheticSource::next(FramePair& out) noexcept {
  if (done_ >= options_.frames) return Next::kEnd;
  ++done_;
  out = {};
  out.ordinal = done_;
  const auto since = static_cast<double>(done_ - 1);
  out.capture_time = CaptureTime(std::chrono::nanoseconds(static_cast<std::int64_t>(since * 1e9 / options_.fps + 0.5)));
  try {
    const double t = since / options_.fps;
    call_cast(t);
    posed_.resize(std::max(posed_.size(), cast_.size()));
    posed_count_ = 0;
    for (const Actor& actor : cast_) {
      if (pose(actor, t, posed_[posed_count_])) ++posed_count_;
    }
    const Moment moment = scene_.moment ? scene_.moment(t) : Moment{};
    LightLevel level = light_at(options_.seed, t);
    level.lamp = moment.lamp;
    if (scene_.foliage) scene_.foliage->pose(t, foliage_);
    const std::span<const PosedActor> actors(posed_.data(), posed_count_);
    const auto render = [&](std::size_t i) {
      if (scene_.sways) {
        views_[i].turn(scene_.rig.camera(static_cast<int>(i), options_.width, options_.height, moment.sway));
      }
      views_[i].cast_actors(actors, foliage_);
      views_[i].expose(level, moment.exposure, sensors_[i], done_, pixels_[i].data());
    };
    render(0);
    render(1);
    if (options_.truth) work_out_truth();
  } catch (const std::exception& e) {
    skip_reason_ = info_.name + ": frame " + std::to_string(done_) + ": " + e.what();
    return Next::kSkipped;
  }
  const auto picture = [&](std::size_t i) {
    return Picture{pixels_[i].data(), options_.width, options_.height, std::ptrdiff_t{3} * options_.width,
                   PixelFormat::kBgr8};
  };
  out.left = picture(0);
  out.right = picture(1);
  return Next::kPair;
}

void SyntheticSource::work_out_truth() {
  const View& view = views_[0];
  const PinholeCamera& camera = view.camera();
  const int width = options_.width;
  const int height = options_.height;
  const std::size_t pixels = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  truth_.labels.assign(pixels, GroundTruth::kStill);
  truth_.disparity.assign(pixels, 0);

  struct Sum {
    Rect box;
    double x = 0, y = 0, z = 0;
    int count = 0;
    int hidden = 0;
    int whole = 0;
  };
  std::vector<Sum> sums(posed_count_);
  std::vector<std::int16_t> owners(pixels);
  std::vector<float> depths(pixels);
  const double disparity_unit = 256.0 * camera.f * scene_.rig.baseline_m;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const std::size_t i = static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x);
      const View::Owner owner = view.owner(x, y);
      owners[i] = static_cast<std::int16_t>(owner.actor);
      depths[i] = owner.inverse_depth > 0 ? static_cast<float>(1.0 / owner.inverse_depth) : 1e6F;
      truth_.disparity[i] = static_cast<std::uint16_t>(std::min(disparity_unit * owner.inverse_depth + 0.5, 65535.0));
      if (owner.actor < 0) {
        if (view.darkening(x, y) > 0.16) truth_.labels[i] = GroundTruth::kShadow;
        continue;
      }
      const auto actor = static_cast<std::size_t>(owner.actor);
      truth_.labels[i] = posed_[actor].undecided ? GroundTruth::kUnknown : GroundTruth::kMoving;
      Sum& sum = sums[actor];
      const double z = 1.0 / owner.inverse_depth;
      sum.box = unite(sum.box, {x, y, 1, 1});
      sum.x += (x - camera.cx) / camera.f * z;
      sum.y += (y - camera.cy) / camera.f * z;
      sum.z += z;
      ++sum.count;
    }
  }

  // All of each object, seen alone and beyond the picture's edge.
  constexpr std::array<Offset, 1> kCenter{};
  for (std::size_t a = 0; a < posed_count_; ++a) {
    if (sums[a].count == 0) continue;
    Rect box;
    for (const Shape& s : posed_[a].shapes) box = unite(box, screen_box(camera, s));
    box = intersect(box, {-2 * width, -2 * height, 5 * width, 5 * height});
    stamp_.assign(static_cast<std::size_t>(box.area()), 0);
    for (const Shape& s : posed_[a].shapes) {
      cast(camera, s, intersect(screen_box(camera, s), box), kCenter, [&](int x, int y, std::size_t, double depth) {
        auto& stamp = stamp_[static_cast<std::size_t>(y - box.top) * static_cast<std::size_t>(box.width) +
                             static_cast<std::size_t>(x - box.left)];
        if (stamp == 0) ++sums[a].whole;
        const bool inside = x >= 0 && y >= 0 && x < width && y < height;
        if (inside && stamp < 2) {
          const std::size_t i =
              static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x);
          const int owner = owners[i];
          if (owner >= 0 && owner != static_cast<int>(a) && depth > static_cast<double>(depths[i])) {
            ++sums[a].hidden;
            stamp = 2;
          }
        }
        if (stamp == 0) stamp = 1;
      });
    }
  }

  truth_.objects.clear();
  for (std::size_t a = 0; a < posed_count_; ++a) {
    const Sum& s = sums[a];
    if (s.count == 0) continue;
    truth_.objects.push_back({posed_[a].id, s.box, s.x / s.count, s.y / s.count, s.z / s.count, s.count, s.hidden,
                              std::max(s.whole, s.count), posed_[a].undecided});
  }
  std::sort(truth_.objects.begin(), truth_.objects.end(),
            [](const TrueObject& a, const TrueObject& b) { return a.id < b.id; });
}

std::unique_ptr<SyntheticSource> open_synthetic(const std::string& name, const SyntheticOptions& options) {
  return std::make_unique<SyntheticSource>(name, options);
}

}  // namespace stereotrack::capture
