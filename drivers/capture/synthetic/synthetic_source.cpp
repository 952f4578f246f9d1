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
  if (scene_.delivery) {
    for (std::uint64_t frame = 1; frame <= options.frames; ++frame) {
      const Delivery d = scene_.delivery(frame);
      if (d.left || d.right) frames_.push_back(frame);
    }
    info_.pairs = frames_.size();
  }
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
    config.noise = scene_.noise;
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

void SyntheticSource::pose_cast(double t_s) {
  posed_.resize(std::max(posed_.size(), cast_.size()));
  posed_count_ = 0;
  for (const Actor& actor : cast_) {
    if (pose(actor, t_s, posed_[posed_count_])) ++posed_count_;
  }
  if (scene_.foliage) scene_.foliage->pose(t_s, foliage_);
}

/// How many moments make up an exposure: what moves fastest goes on by a pixel from one to the next. Odd, so that one
/// is the middle.
int SyntheticSource::exposures(double t_s) {
  if (scene_.shutter_s <= 0) return 1;
  constexpr int kMost = 49;
  const PinholeCamera& camera = views_[0].camera();
  double farthest_px = 0;
  PosedActor before;
  PosedActor after;
  for (const Actor& actor : cast_) {
    if (!pose(actor, t_s - 0.5 * scene_.shutter_s, before) || !pose(actor, t_s + 0.5 * scene_.shutter_s, after))
      continue;
    if (intersect(screen_box(camera, before.center, before.radius), {0, 0, camera.width, camera.height}).empty() &&
        intersect(screen_box(camera, after.center, after.radius), {0, 0, camera.width, camera.height}).empty()) {
      continue;
    }
    const Vec3 a = camera.to_camera(before.center);
    const Vec3 b = camera.to_camera(after.center);
    if (a.z < 0.5 || b.z < 0.5) continue;
    const Vec3 moved{a.x / a.z - b.x / b.z, a.y / a.z - b.y / b.z, 0};
    farthest_px = std::max(farthest_px, camera.f * length(moved));
  }
  return std::min(2 * static_cast<int>(0.5 * farthest_px + 0.4) + 1, kMost);
}

void SyntheticSource::draw(std::uint64_t frame, bool left, bool right) {
  const double t = static_cast<double>(frame - 1) / options_.fps;
  call_cast(t);
  const Moment moment = scene_.moment ? scene_.moment(t) : Moment{};
  LightLevel level = light_at(options_.seed, t);
  level.lamp = moment.lamp;
  const View::Exposure exposure{moment.exposure, moment.ripple, frame};
  const std::array<bool, 2> wanted{left, right};
  for (std::size_t i = 0; i < 2; ++i) {
    if (wanted[i] && scene_.sways) {
      views_[i].turn(scene_.rig.camera(static_cast<int>(i), options_.width, options_.height, moment.sway));
    }
  }
  const int count = exposures(t);
  if (left) exposures_ = count;
  if (left && options_.truth && count > 1) covers_.assign(pixels_[0].size() / 3, {});
  for (int step = 0; step < count; ++step) {
    // The middle comes last: the truth is worked out from how everything is posed then.
    const int half = count / 2;
    const int k = step < half ? step - half : (step + 1 < count ? step - half + 1 : 0);
    pose_cast(t + scene_.shutter_s * k / count);
    const std::span<const PosedActor> actors(posed_.data(), posed_count_);
    for (std::size_t i = 0; i < 2; ++i) {
      if (!wanted[i]) continue;
      views_[i].cast_actors(actors, foliage_);
      if (count == 1) {
        views_[i].expose(level, exposure, sensors_[i], pixels_[i].data());
        continue;
      }
      views_[i].gather(level, step == 0);
      if (i == 0 && options_.truth) cover();
    }
  }
  if (count == 1) return;
  for (std::size_t i = 0; i < 2; ++i) {
    if (wanted[i]) views_[i].develop(exposure, sensors_[i], pixels_[i].data());
  }
}

void SyntheticSource::cover() {
  const View& view = views_[0];
  for (int y = 0; y < options_.height; ++y) {
    const auto [first, last] = view.row_span(y);
    for (int x = first; x < last; ++x) {
      const View::Owner owner = view.owner(x, y);
      if (owner.actor < 0) continue;
      const std::uint32_t id = posed_[static_cast<std::size_t>(owner.actor)].id;
      Cover& c =
          covers_[static_cast<std::size_t>(y) * static_cast<std::size_t>(options_.width) + static_cast<std::size_t>(x)];
      if (c.id == id) {
        ++c.count;
        c.inverse_depth += owner.inverse_depth;
      } else if (--c.count <= 0) {
        c = {id, 1, owner.inverse_depth};
      }
    }
  }
}

Next SyntheticSource::next(FramePair& out) noexcept {
  if (done_ >= *info_.pairs) return Next::kEnd;
  ++done_;
  out = {};
  out.ordinal = done_;
  const std::uint64_t frame = frames_.empty() ? done_ : frames_[static_cast<std::size_t>(done_ - 1)];
  const auto since = static_cast<double>(frame - 1);
  out.capture_time = CaptureTime(std::chrono::nanoseconds(static_cast<std::int64_t>(since * 1e9 / options_.fps + 0.5)));
  try {
    delivery_ = scene_.delivery ? scene_.delivery(frame) : Delivery{};
    const bool apart = delivery_.right && delivery_.right_off != 0;
    if (apart) draw(frame + static_cast<std::uint64_t>(static_cast<std::int64_t>(delivery_.right_off)), false, true);
    // The truth of the left picture is wanted even where it never comes.
    draw(frame, true, delivery_.right && !apart);
    if (options_.truth) work_out_truth();
  } catch (const std::exception& e) {
    skip_reason_ = info_.name + ": frame " + std::to_string(done_) + ": " + e.what();
    return Next::kSkipped;
  }
  if (!delivery_.left || !delivery_.right) {
    skip_reason_ = info_.name + ": frame " + std::to_string(done_) + ": the " + (delivery_.left ? "right" : "left") +
                   " picture is missing";
    return Next::kSkipped;
  }
  if (delivers()) out.skew = std::chrono::nanoseconds(delivery_.skew_ns);
  out.left = picture(0);
  out.right = picture(1);
  return Next::kPair;
}

Picture SyntheticSource::picture(int side) const noexcept {
  if (!(side == 0 ? delivery_.left : delivery_.right)) return {};
  return Picture{pixels_[static_cast<std::size_t>(side)].data(), options_.width, options_.height,
                 std::ptrdiff_t{3} * options_.width, PixelFormat::kBgr8};
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
  const auto seen = [&](int x, int y, const Cover& cover) {
    if (4 * cover.count < exposures_) return View::Owner{-1, view.still_inverse_depth(x, y)};
    const auto posed = std::find_if(posed_.begin(), posed_.begin() + static_cast<std::ptrdiff_t>(posed_count_),
                                    [&](const PosedActor& a) { return a.id == cover.id; });
    const auto actor = posed - posed_.begin();
    if (actor == static_cast<std::ptrdiff_t>(posed_count_)) return View::Owner{-1, view.still_inverse_depth(x, y)};
    return View::Owner{static_cast<int>(actor), cover.inverse_depth / cover.count};
  };
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const std::size_t i = static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x);
      const View::Owner owner = exposures_ > 1 ? seen(x, y, covers_[i]) : view.owner(x, y);
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
