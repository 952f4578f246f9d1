#pragma once

#include <libcamera/camera.h>
#include <libcamera/camera_manager.h>
#include <libcamera/control_ids.h>
#include <libcamera/controls.h>
#include <libcamera/property_ids.h>
#include <libcamera/stream.h>

#include <sys/types.h>

#include <cmath>
#include <cstdint>
#include <cstring>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

/// What differs between libcamera 0.0.3 (Debian 12) and 0.7, at one place:
/// * which controls there are, and what type they have: they are looked up by name in the maps that libcamera itself
///   brings, and values are read and made by the type that is found there. No control of libcamera's headers is named,
///   and texts are read as bytes, for what get() gives of them has changed;
/// * how a configuration is asked for: roles are a vector, later a Span, which a vector becomes;
/// * which device nodes are a camera's: the manager is asked by node, later the camera by a property, SystemDevices;
/// * automatic exposure: one switch, AeEnable; from 0.5 on exposure and gain have modes of their own, beside it.
namespace stereotrack::libcamera_module::compat {

namespace lc = ::libcamera;

[[nodiscard]] inline std::unique_ptr<lc::CameraConfiguration> configuration(lc::Camera& camera, lc::StreamRole role) {
  const std::vector<lc::StreamRole> roles{role};
  std::unique_ptr<lc::CameraConfiguration> made = camera.generateConfiguration(roles);
  if (made && made->empty()) made.reset();
  return made;
}

/// The first element, of an array; none: no number.
template <class Number>
[[nodiscard]] std::optional<Number> number_of(const lc::ControlValue& value) {
  const auto bytes = value.data();
  const auto as = [&](auto number) -> std::optional<Number> {
    if (bytes.size() < sizeof number) return std::nullopt;
    std::memcpy(&number, bytes.data(), sizeof number);
    return static_cast<Number>(number);
  };
  switch (value.type()) {
    case lc::ControlTypeBool:
    case lc::ControlTypeByte: return as(std::uint8_t{});
    case lc::ControlTypeInteger32: return as(std::int32_t{});
    case lc::ControlTypeInteger64: return as(std::int64_t{});
    case lc::ControlTypeFloat: return as(float{});
    default: return std::nullopt;
  }
}

[[nodiscard]] inline std::string text_of(const lc::ControlValue& value) {
  if (value.type() != lc::ControlTypeString) return {};
  const auto bytes = value.data();
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

/// Of a list that libcamera made by one of its maps; none: it is not there.
class Named {
 public:
  Named(const lc::ControlIdMap& map, std::string_view name) {
    for (const auto& [number, id] : map) {
      if (id->name() == name) number_ = number;
    }
  }
  template <class Number>
  [[nodiscard]] std::optional<Number> in(const lc::ControlList& list) const {
    if (!number_ || !list.contains(*number_)) return std::nullopt;
    return number_of<Number>(list.get(*number_));
  }
  [[nodiscard]] std::string text_in(const lc::ControlList& list) const {
    return number_ && list.contains(*number_) ? text_of(list.get(*number_)) : std::string();
  }

 private:
  std::optional<unsigned int> number_;
};

[[nodiscard]] inline Named metadata(std::string_view name) { return {lc::controls::controls, name}; }
[[nodiscard]] inline Named property(std::string_view name) { return {lc::properties::properties, name}; }

/// Whether the node, a video device, is one of the camera's. What a manager says of it depends on its version, so it is
/// a parameter of a template.
template <class Manager>
[[nodiscard]] bool is_node_of(Manager& manager, const std::shared_ptr<lc::Camera>& camera, dev_t node) {
  if constexpr (requires { manager.get(node); }) {
    return manager.get(node) == camera;
  } else {
    for (const auto& [number, id] : lc::properties::properties) {
      if (id->name() != "SystemDevices" || !camera->properties().contains(number)) continue;
      const lc::ControlValue& value = camera->properties().get(number);
      const auto bytes = value.data();
      for (std::size_t at = 0; at + sizeof(std::int64_t) <= bytes.size(); at += sizeof(std::int64_t)) {
        std::int64_t each = 0;
        std::memcpy(&each, bytes.data() + at, sizeof each);
        if (static_cast<dev_t>(each) == node) return true;
      }
    }
    return false;
  }
}

/// A control that a camera has.
class Settable {
 public:
  Settable(const lc::ControlInfoMap& controls, std::string_view name) {
    for (const auto& [id, info] : controls) {
      if (id->name() != name) continue;
      id_ = id;
      info_ = &info;
    }
  }
  explicit operator bool() const noexcept { return id_ != nullptr; }
  template <class Number>
  [[nodiscard]] Number least() const {
    return id_ == nullptr ? Number{} : number_of<Number>(info_->min()).value_or(Number{});
  }
  template <class Number>
  [[nodiscard]] Number most() const {
    return id_ == nullptr ? Number{} : number_of<Number>(info_->max()).value_or(Number{});
  }
  /// Of the control's own type. Nothing happens where that is no number.
  void set(lc::ControlList& list, double value) const {
    switch (id_->type()) {
      case lc::ControlTypeBool: return put(list, value != 0);
      case lc::ControlTypeByte: return put(list, static_cast<std::uint8_t>(std::lround(value)));
      case lc::ControlTypeInteger32: return put(list, static_cast<std::int32_t>(std::lround(value)));
      case lc::ControlTypeInteger64: return put(list, static_cast<std::int64_t>(std::llround(value)));
      case lc::ControlTypeFloat: return put(list, static_cast<float>(value));
      default: return;
    }
  }
  /// The same value twice, as limits have it.
  void set_both(lc::ControlList& list, std::int64_t value) const {
    const std::int64_t both[] = {value, value};
    list.set(id_->id(), lc::ControlValue(lc::Span<const std::int64_t, 2>(both)));
  }

 private:
  template <class Value>
  void put(lc::ControlList& list, Value value) const {
    list.set(id_->id(), lc::ControlValue(value));
  }

  const lc::ControlId* id_ = nullptr;
  const lc::ControlInfo* info_ = nullptr;
};

}  // namespace stereotrack::libcamera_module::compat
