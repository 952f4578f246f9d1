#pragma once

#include <cstdint>
#include <deque>
#include <iterator>
#include <map>

#include "pipeline/pipeline.hpp"

namespace stereotrack::render {

/// Where the tracks were during the last kTrail_s seconds.
class Trails {
 public:
  static constexpr double kTrail_s = 2.0;

  struct Place {
    CaptureTime time{};
    double image_x = 0;  ///< raw left picture [px]
    double image_y = 0;
    bool has_depth = false;
    double x = 0;  ///< [calibration unit]
    double z = 0;
  };

  void add(const FrameResult& result) {
    if (result.capture_time < now_) places_.clear();
    now_ = result.capture_time;
    for (const TrackReport& track : result.tracks) {
      places_[track.id].push_back(
          {now_, track.image_x, track.image_y, track.has_depth, track.position.x(), track.position.z()});
    }
    for (auto it = places_.begin(); it != places_.end();) {
      std::deque<Place>& places = it->second;
      while (!places.empty() && age_s(places.front()) > kTrail_s) places.pop_front();
      it = places.empty() ? places_.erase(it) : std::next(it);
    }
  }

  /// Oldest first. Only ids of the result last added.
  [[nodiscard]] const std::deque<Place>& of(std::uint32_t id) const { return places_.at(id); }

  /// How strongly to draw what begins there: 1 now, 0 kTrail_s ago.
  [[nodiscard]] double strength(const Place& place) const { return 1 - age_s(place) / kTrail_s; }

 private:
  [[nodiscard]] double age_s(const Place& place) const { return seconds_between(place.time, now_); }

  CaptureTime now_{};
  std::map<std::uint32_t, std::deque<Place>> places_;
};

}  // namespace stereotrack::render
