/// Fills the table of ../module.h by the libcamera that it is built against. Exceptions end here: whatever may throw
/// runs inside guarded().
///
/// A camera that is unplugged must not take the process with it, and libcamera (0.0.3 at least, on a machine with udev)
/// ends the process in two cases, by assertions of its own, which both are kept from happening:
/// * stop() of a camera whose device is gone: its buffers do not come back. Such a camera is left as it is, never
///   stopped and never destroyed; its memory stays until the process ends;
/// * a device that comes back: its camera has the id of the one that was. So the manager does not learn of devices that
///   come or go: udev_monitor_enable_receiving() and udev_monitor_get_fd() below take the place of libudev's. Another
///   manager has to look, once no camera is open: renew().
#include "drivers/capture/libcamera/module.h"

#include <libcamera/camera.h>
#include <libcamera/camera_manager.h>
#include <libcamera/framebuffer_allocator.h>
#include <libcamera/logging.h>
#include <libcamera/request.h>
#include <linux/dma-buf.h>
#include <sys/eventfd.h>
#include <sys/ioctl.h>
#include <sys/mman.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <csignal>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <exception>
#include <iostream>
#include <iterator>
#include <memory>
#include <ostream>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "drivers/capture/libcamera/module/compat.hpp"
#include "drivers/capture/libcamera/module/complaints.hpp"
#include "drivers/capture/libcamera/module/handover.hpp"
#include "drivers/capture/libcamera/module/nodes.hpp"

namespace lc = ::libcamera;
namespace lm = stereotrack::libcamera_module;
namespace compat = lm::compat;

namespace {

constexpr std::int64_t kMicrosecond = 1000;

template <std::size_t kSize>
void put_text(char (&to)[kSize], const std::string& text) {
  (void)std::snprintf(to, kSize, "%s", text.c_str());
}
void put_why(char* why, const std::string& text) { (void)std::snprintf(why, kLibcameraTextSize, "%s", text.c_str()); }

std::string error_text(int error) { return std::string(std::strerror(error)) + ", errno " + std::to_string(error); }

template <class Result, class Body>
Result guarded(char* why, Result failed, const Body& body) noexcept {
  try {
    return body();
  } catch (const std::exception& error) {
    if (why != nullptr) put_why(why, error.what());
  } catch (...) {
    if (why != nullptr) put_why(why, "libcamera threw something");
  }
  return failed;
}

/// Threads that libcamera and we start meanwhile take no signals, which are the program's, but those of a fault of
/// their own.
class WithoutSignals {
 public:
  WithoutSignals() noexcept {
    sigset_t ours;
    (void)sigfillset(&ours);
    for (const int fault : {SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT, SIGTRAP, SIGSYS}) (void)sigdelset(&ours, fault);
    (void)pthread_sigmask(SIG_BLOCK, &ours, &before_);
  }
  WithoutSignals(const WithoutSignals&) = delete;
  WithoutSignals& operator=(const WithoutSignals&) = delete;
  ~WithoutSignals() { (void)pthread_sigmask(SIG_SETMASK, &before_, nullptr); }

 private:
  sigset_t before_{};
};

/// While it lives libcamera's log is held back. A thread of libcamera's may be writing as it ends: the stream stays.
class HeldLog {
 public:
  HeldLog() {
    if (!is_ours()) return;
    complaints().forget();
    (void)lc::logSetStream(&stream());
  }
  HeldLog(const HeldLog&) = delete;
  HeldLog& operator=(const HeldLog&) = delete;
  ~HeldLog() {
    if (is_ours()) (void)lc::logSetStream(&std::cerr, ::isatty(STDERR_FILENO) != 0);
  }
  [[nodiscard]] static std::string last() { return complaints().last(); }

 private:
  /// Nobody has chosen what is logged, and where to.
  static bool is_ours() noexcept {
    const char* const levels = std::getenv("LIBCAMERA_LOG_LEVELS");
    return std::getenv("LIBCAMERA_LOG_FILE") == nullptr && levels != nullptr &&
           std::strcmp(levels, STEREOTRACK_LIBCAMERA_LOG_LEVELS) == 0;
  }
  static lm::Complaints& complaints() {
    static auto* const kept = new lm::Complaints;
    return *kept;
  }
  static std::ostream& stream() {
    static auto* const kept = new std::ostream(&complaints());
    return *kept;
  }
};

std::int64_t monotonic_now() noexcept {
  timespec now{};
  (void)::clock_gettime(CLOCK_MONOTONIC, &now);
  return now.tv_sec * std::int64_t{1'000'000'000} + now.tv_nsec;
}

void sync_memory(int descriptor, std::uint64_t flags) noexcept {
  dma_buf_sync sync{};
  sync.flags = DMA_BUF_SYNC_READ | flags;
  // Memory that is no dma-buf needs none.
  while (::ioctl(descriptor, DMA_BUF_IOCTL_SYNC, &sync) != 0 && (errno == EINTR || errno == EAGAIN)) {
  }
}

/// A buffer's memory, mapped once a descriptor.
class Mapping {
 public:
  explicit Mapping(const lc::FrameBuffer& buffer) {
    // Planes that share a descriptor share its mapping, so that what lies close together stays so.
    for (const lc::FrameBuffer::Plane& plane : buffer.planes()) {
      Part& part = part_of(plane.fd.get());
      part.bytes = std::max(part.bytes, offset_of(plane) + plane.length);
    }
    try {
      for (Part& part : parts_) map(part);
    } catch (...) {
      unmap();
      throw;
    }
    for (const lc::FrameBuffer::Plane& plane : buffer.planes()) {
      planes_.push_back({part_of(plane.fd.get()).memory + offset_of(plane), plane.length});
    }
  }
  Mapping(const Mapping&) = delete;
  Mapping& operator=(const Mapping&) = delete;
  Mapping(Mapping&& other) noexcept : parts_(std::move(other.parts_)), planes_(std::move(other.planes_)) {
    other.parts_.clear();
  }
  Mapping& operator=(Mapping&&) = delete;
  ~Mapping() { unmap(); }

  struct Plane {
    const std::uint8_t* data = nullptr;
    std::uint64_t bytes = 0;
  };
  [[nodiscard]] const std::vector<Plane>& planes() const noexcept { return planes_; }

  /// Around each lease: the processor's caches and the device's agree.
  void begin_read() const noexcept {
    for (const Part& part : parts_) sync_memory(part.descriptor, DMA_BUF_SYNC_START);
  }
  void end_read() const noexcept {
    for (const Part& part : parts_) sync_memory(part.descriptor, DMA_BUF_SYNC_END);
  }

 private:
  struct Part {
    int descriptor = -1;
    std::uint8_t* memory = nullptr;
    std::size_t bytes = 0;
  };

  static std::size_t offset_of(const lc::FrameBuffer::Plane& plane) {
    return plane.offset == lc::FrameBuffer::Plane::kInvalidOffset ? 0 : plane.offset;
  }
  Part& part_of(int descriptor) {
    for (Part& part : parts_) {
      if (part.descriptor == descriptor) return part;
    }
    return parts_.emplace_back(Part{descriptor, nullptr, 0});
  }
  static void map(Part& part) {
    void* const memory = ::mmap(nullptr, part.bytes, PROT_READ, MAP_SHARED, part.descriptor, 0);
    if (memory == MAP_FAILED) throw std::runtime_error("its buffers cannot be mapped (" + error_text(errno) + ")");
    part.memory = static_cast<std::uint8_t*>(memory);
  }
  void unmap() noexcept {
    for (const Part& part : parts_) {
      if (part.memory != nullptr) (void)::munmap(part.memory, part.bytes);
    }
    parts_.clear();
  }

  std::vector<Part> parts_;
  std::vector<Plane> planes_;
};

std::string model_of(lc::Camera& camera) {
  const std::string model = compat::property("Model").text_in(camera.properties());
  return model.empty() ? camera.id() : model;
}

std::string location_of(lc::Camera& camera) {
  const auto location = compat::property("Location").in<int>(camera.properties());
  constexpr const char* kLocations[] = {"front", "back", "external"};
  return location && *location >= 0 && *location < 3 ? kLocations[*location] : "";
}

void list_formats(lc::Camera& camera, lc::StreamRole role, std::vector<LibcameraFormat>& formats) {
  const std::unique_ptr<lc::CameraConfiguration> configuration = compat::configuration(camera, role);
  if (!configuration) return;
  const lc::StreamConfiguration& stream = configuration->at(0);
  const auto put = [&](const lc::PixelFormat& format, const lc::Size& least, const lc::Size& most) {
    formats.push_back({.fourcc = format.fourcc(),
                       .is_raw = role == lc::StreamRole::Raw ? 1U : 0U,
                       .modifier = format.modifier(),
                       .least_width = static_cast<std::int32_t>(least.width),
                       .least_height = static_cast<std::int32_t>(least.height),
                       .most_width = static_cast<std::int32_t>(most.width),
                       .most_height = static_cast<std::int32_t>(most.height)});
  };
  // A pipeline that makes no difference between roles offers the same again.
  const auto is_listed = [&](const lc::PixelFormat& format) {
    return std::any_of(formats.begin(), formats.end(), [&](const LibcameraFormat& each) {
      return each.is_raw != (role == lc::StreamRole::Raw ? 1U : 0U) && each.fourcc == format.fourcc() &&
             each.modifier == format.modifier();
    });
  };
  for (const lc::PixelFormat& format : stream.formats().pixelformats()) {
    if (is_listed(format)) continue;
    const std::vector<lc::Size> sizes = stream.formats().sizes(format);
    for (const lc::Size& size : sizes) put(format, size, size);
    const lc::SizeRange range = stream.formats().range(format);
    if (sizes.empty()) put(format, range.min, range.max);
  }
  // It need not tell what else there is.
  if (stream.formats().pixelformats().empty() && !is_listed(stream.pixelFormat)) {
    put(stream.pixelFormat, stream.size, stream.size);
  }
}

}  // namespace

struct LibcameraManager {
  /// A camera and the video devices that are it, as they were at start.
  struct Known {
    std::shared_ptr<lc::Camera> camera;
    std::vector<lm::Node> nodes;
  };
  [[nodiscard]] bool is_gone(const lc::Camera& camera) const {
    for (const Known& each : known) {
      if (each.camera.get() == &camera) return !lm::are_there(each.nodes);
    }
    return false;
  }

  std::vector<lm::Node> nodes;  ///< that there were before it looked
  std::string complaint;        ///< of libcamera's, while it looked
  lc::CameraManager manager;
  std::vector<Known> known;
  std::vector<LibcameraStream*> streams;             ///< that are open
  std::vector<std::shared_ptr<lc::Camera>> cameras;  ///< as of the last count()
  std::shared_ptr<lc::Camera> formats_of;
  std::vector<LibcameraFormat> formats;
};

/// One camera, acquired. libcamera's thread calls completed() and disconnected(), the queueing thread requeue().
struct LibcameraStream {
 public:
  LibcameraStream(LibcameraManager& manager, std::shared_ptr<lc::Camera> of,
                  std::unique_ptr<lc::CameraConfiguration> configuration)
      : manager_(manager), camera_(std::move(of)), configuration_(std::move(configuration)), allocator_(camera_) {}
  LibcameraStream(const LibcameraStream&) = delete;
  LibcameraStream& operator=(const LibcameraStream&) = delete;
  ~LibcameraStream() {
    end();
    if (started_) {
      (void)camera_->stop();
      camera_->requestCompleted.disconnect(this);
      camera_->disconnected.disconnect(this);
    }
    requests_.clear();
    mappings_.clear();
    if (stream_ != nullptr && allocator_.allocated()) (void)allocator_.free(stream_);
    if (acquired_) (void)camera_->release();
  }

  void set_up(const LibcameraWish& wish, LibcameraSetup& setup) {
    check(camera_->acquire(), "is not to be had", "another program has it, or is looking for cameras: stop that");
    acquired_ = true;
    check(camera_->configure(configuration_.get()), "does not take its configuration", "choose another size or format");
    lc::StreamConfiguration& configuration = configuration_->at(0);
    stream_ = configuration.stream();
    check(std::min(allocator_.allocate(stream_), 0), "has no memory for its buffers",
          "lower the number of buffers, or give the kernel more contiguous memory (cma=)");
    const auto& buffers = allocator_.buffers(stream_);
    if (buffers.size() > kLibcameraMostBuffers) throw std::runtime_error("has too many buffers");
    for (const std::unique_ptr<lc::FrameBuffer>& buffer : buffers) {
      std::unique_ptr<lc::Request> request = camera_->createRequest(requests_.size());
      if (!request) throw std::runtime_error("makes no requests");
      check(request->addBuffer(stream_, buffer.get()), "does not take its buffers", "open it anew");
      requests_.push_back(std::move(request));
      mappings_.emplace_back(*buffer);
    }
    choose_controls(wish, setup);
    setup.buffers = static_cast<std::uint32_t>(buffers.size());
    setup.descriptor = handover_.descriptor();
  }

  void start() {
    camera_->requestCompleted.connect(this, &LibcameraStream::completed);
    camera_->disconnected.connect(this, &LibcameraStream::disconnected);
    started_ = true;
    check(camera_->start(&controls_), "does not start to stream", "close what uses it, dmesg tells more");
    for (const std::unique_ptr<lc::Request>& request : requests_) {
      // Not every pipeline heeds what start() is given.
      for (const auto& [number, value] : controls_) request->controls().set(number, value);
      check(camera_->queueRequest(request.get()), "does not take its requests", "open it anew");
    }
    queueing_ = std::thread([this] { requeue(); });
  }

  /// What is left may stay for ever.
  void end() {
    ending_.store(true, std::memory_order_relaxed);
    handover_.end();
    if (queueing_.joinable()) queueing_.join();
  }

  [[nodiscard]] LibcameraManager& manager() noexcept { return manager_; }
  [[nodiscard]] const lc::Camera& camera() const noexcept { return *camera_; }
  [[nodiscard]] std::uint32_t stride() const { return configuration_->at(0).stride; }
  [[nodiscard]] lm::Handover& handover() noexcept { return handover_; }
  [[nodiscard]] const std::vector<Mapping>& mappings() const noexcept { return mappings_; }

 private:
  static void check(int error, const char* what, const char* way_out) {
    if (error < 0) throw std::runtime_error(std::string(what) + " (" + error_text(-error) + "): " + way_out);
  }

  /// As far as the camera has them, by name.
  void choose_controls(const LibcameraWish& wish, LibcameraSetup& setup) {
    const lc::ControlInfoMap& has = camera_->controls();
    controls_ = lc::ControlList(has);
    if (const compat::Settable limits(has, "FrameDurationLimits"); limits && wish.duration > 0) {
      const auto us = std::clamp((wish.duration + kMicrosecond / 2) / kMicrosecond, limits.least<std::int64_t>(),
                                 std::max(limits.least<std::int64_t>(), limits.most<std::int64_t>()));
      limits.set_both(controls_, us);
      setup.duration = us * kMicrosecond;
    }
    const compat::Settable exposure(has, "ExposureTime");
    const compat::Settable gain(has, "AnalogueGain");
    const bool fixes_exposure = exposure && wish.exposure > 0;
    const bool fixes_gain = gain && wish.gain > 0;
    if (fixes_exposure) {
      const auto us = std::clamp((wish.exposure + kMicrosecond / 2) / kMicrosecond, exposure.least<std::int64_t>(),
                                 std::max(exposure.least<std::int64_t>(), exposure.most<std::int64_t>()));
      exposure.set(controls_, static_cast<double>(us));
      setup.exposure = us * kMicrosecond;
    }
    if (fixes_gain) {
      setup.gain = std::clamp(wish.gain, gain.least<float>(), std::max(gain.least<float>(), gain.most<float>()));
      gain.set(controls_, setup.gain);
    }
    if (!fixes_exposure && !fixes_gain) return;
    const compat::Settable exposure_mode(has, "ExposureTimeMode");
    const compat::Settable gain_mode(has, "AnalogueGainMode");
    if (exposure_mode) exposure_mode.set(controls_, fixes_exposure ? 1 : 0);
    if (gain_mode) gain_mode.set(controls_, fixes_gain ? 1 : 0);
    // One switch for both: where only one of them is fixed, its value is what takes it from the automatic.
    const compat::Settable automatic(has, "AeEnable");
    if (automatic && !exposure_mode && !gain_mode) automatic.set(controls_, fixes_exposure && fixes_gain ? 0 : 1);
  }

  // ---- libcamera's thread

  void completed(lc::Request* request) noexcept {
    if (ending_.load(std::memory_order_relaxed)) return;
    if (request->status() == lc::Request::RequestCancelled) {
      handover_.lose("had its requests cancelled: check its cable, dmesg tells more");
      return;
    }
    LibcameraFrame frame{};
    frame.completed_time = monotonic_now();
    frame.buffer = static_cast<std::uint32_t>(request->cookie());
    if (const lc::FrameBuffer* const buffer = request->findBuffer(stream_)) {
      const lc::FrameMetadata& metadata = buffer->metadata();
      frame.sequence = metadata.sequence;
      frame.is_damaged = metadata.status == lc::FrameMetadata::FrameSuccess ? 0 : 1;
      for (const auto& plane : metadata.planes()) frame.bytes += plane.bytesused;
      frame.buffer_time = static_cast<std::int64_t>(metadata.timestamp);
      if (metadata.timestamp != 0) frame.known |= kLibcameraKnowsStamp;
    } else {
      frame.is_damaged = 1;
    }
    const auto& metadata = request->metadata();
    if (const auto time = start_.in<std::int64_t>(metadata)) {
      frame.sensor_time = *time;
      frame.known |= kLibcameraKnowsStart;
    }
    if (const auto exposure_us = exposure_.in<std::int64_t>(metadata)) {
      frame.exposure = *exposure_us * kMicrosecond;
      frame.known |= kLibcameraKnowsExposure;
    }
    if (const auto gain = gain_.in<float>(metadata)) {
      frame.gain = *gain;
      frame.known |= kLibcameraKnowsGain;
    }
    if (frame.buffer < mappings_.size()) mappings_[frame.buffer].begin_read();
    handover_.push(frame);
  }

  void disconnected() noexcept { handover_.lose("was unplugged: check its plug and power"); }

  // ---- Queueing thread

  void requeue() noexcept {
    std::uint32_t buffer = 0;
    while (handover_.wait_returned(buffer)) {
      if (buffer >= requests_.size() || handover_.loss() != nullptr) continue;
      mappings_[buffer].end_read();
      lc::Request& request = *requests_[buffer];
      const bool queued = guarded<bool>(nullptr, false, [&] {
        request.reuse(lc::Request::ReuseBuffers);
        return camera_->queueRequest(&request) == 0;
      });
      if (!queued) handover_.lose("does not take its buffers back: dmesg tells more");
    }
  }

  LibcameraManager& manager_;
  std::shared_ptr<lc::Camera> camera_;
  std::unique_ptr<lc::CameraConfiguration> configuration_;
  lc::FrameBufferAllocator allocator_;
  lc::Stream* stream_ = nullptr;
  std::vector<std::unique_ptr<lc::Request>> requests_;  ///< one a buffer, of its number
  std::vector<Mapping> mappings_;                       ///< likewise
  lc::ControlList controls_;
  lm::Handover handover_;
  std::thread queueing_;
  std::atomic<bool> ending_{false};
  bool acquired_ = false;
  bool started_ = false;
  const compat::Named start_ = compat::metadata("SensorTimestamp");
  const compat::Named exposure_ = compat::metadata("ExposureTime");
  const compat::Named gain_ = compat::metadata("AnalogueGain");
};

namespace {

// ---- The table. extern "C" in type; what they are called in C++ does not matter.

const char* library() { return lc::CameraManager::version().c_str(); }

LibcameraManager* open_manager(char* why) {
  const WithoutSignals quiet;
  return guarded<LibcameraManager*>(why, nullptr, [&]() -> LibcameraManager* {
    auto manager = std::make_unique<LibcameraManager>();
    manager->nodes = lm::list_nodes();
    const HeldLog log;
    const int error = manager->manager.start();
    manager->complaint = HeldLog::last();
    if (error != 0) {
      throw std::runtime_error("does not start to look for cameras (" + error_text(-error) + ")" +
                               (manager->complaint.empty() ? "" : " and complains of \"" + manager->complaint + '"'));
    }
    for (const std::shared_ptr<lc::Camera>& camera : manager->manager.cameras()) {
      LibcameraManager::Known& known = manager->known.emplace_back(LibcameraManager::Known{camera, {}});
      for (const lm::Node& node : lm::list_nodes()) {
        if (compat::is_node_of(manager->manager, camera, node.number)) known.nodes.push_back(node);
      }
    }
    return manager.release();
  });
}

void close_manager(LibcameraManager* manager) {
  (void)guarded<int>(nullptr, 0, [&] {
    const std::unique_ptr<LibcameraManager> owned(manager);
    owned->cameras.clear();
    owned->known.clear();
    owned->formats_of.reset();
    owned->manager.stop();
    return 0;
  });
}

const char* complaint(LibcameraManager* manager) { return manager->complaint.c_str(); }

std::int32_t renew(LibcameraManager* manager) {
  return guarded<std::int32_t>(nullptr, 0, [&] {
    if (!lm::are_there_others(manager->nodes)) return 0;
    for (LibcameraStream* const stream : manager->streams) {
      stream->handover().lose(
          "has to be opened anew, so that libcamera looks for devices that were plugged in: it comes back by itself");
    }
    return 1;
  });
}

std::uint32_t count(LibcameraManager* manager) {
  return guarded<std::uint32_t>(nullptr, 0, [&] {
    manager->formats_of.reset();
    manager->cameras = manager->manager.cameras();
    return static_cast<std::uint32_t>(manager->cameras.size());
  });
}

std::int32_t facts(LibcameraManager* manager, std::uint32_t camera, LibcameraFacts* facts) {
  return guarded<std::int32_t>(nullptr, 0, [&] {
    if (camera >= manager->cameras.size()) return 0;
    lc::Camera& of = *manager->cameras[camera];
    *facts = {};
    put_text(facts->id, of.id());
    facts->is_gone = manager->is_gone(of) ? 1 : 0;
    put_text(facts->model, model_of(of));
    put_text(facts->location, location_of(of));
    const compat::Settable exposure(of.controls(), "ExposureTime");
    facts->exposure_least = exposure.least<std::int64_t>() * kMicrosecond;
    facts->exposure_most = exposure.most<std::int64_t>() * kMicrosecond;
    const compat::Settable duration(of.controls(), "FrameDurationLimits");
    facts->duration_least = duration.least<std::int64_t>() * kMicrosecond;
    facts->duration_most = duration.most<std::int64_t>() * kMicrosecond;
    const compat::Settable gain(of.controls(), "AnalogueGain");
    facts->gain_least = gain.least<float>();
    facts->gain_most = gain.most<float>();
    return 1;
  });
}

std::int32_t format(LibcameraManager* manager, std::uint32_t camera, std::uint32_t number, LibcameraFormat* format) {
  return guarded<std::int32_t>(nullptr, 0, [&] {
    if (camera >= manager->cameras.size()) return 0;
    const std::shared_ptr<lc::Camera>& of = manager->cameras[camera];
    if (manager->formats_of != of) {
      manager->formats.clear();
      list_formats(*of, lc::StreamRole::VideoRecording, manager->formats);
      list_formats(*of, lc::StreamRole::Raw, manager->formats);
      manager->formats_of = of;
    }
    if (number >= manager->formats.size()) return 0;
    *format = manager->formats[number];
    return 1;
  });
}

std::int32_t open(LibcameraManager* manager, std::uint32_t camera, const LibcameraWish* wish, LibcameraSetup* setup,
                  LibcameraStream** stream, char* why) {
  const WithoutSignals quiet;
  return guarded<std::int32_t>(why, kLibcameraFailed, [&]() -> std::int32_t {
    if (camera >= manager->cameras.size()) throw std::runtime_error("there is no such camera any more");
    const std::shared_ptr<lc::Camera> of = manager->cameras[camera];
    if (manager->is_gone(*of)) throw std::runtime_error("is not connected any more: check its plug and power");
    auto configuration =
        compat::configuration(*of, wish->is_raw != 0 ? lc::StreamRole::Raw : lc::StreamRole::VideoRecording);
    if (!configuration) throw std::runtime_error("offers no configuration");
    lc::StreamConfiguration& chosen = configuration->at(0);
    const lc::PixelFormat wanted_format(wish->fourcc, wish->modifier);
    const lc::Size wanted_size(static_cast<unsigned int>(wish->width), static_cast<unsigned int>(wish->height));
    if (wish->fourcc != 0) chosen.pixelFormat = wanted_format;
    if (wish->width > 0) chosen.size = wanted_size;
    if (wish->buffers > 0) chosen.bufferCount = wish->buffers;
    if (configuration->validate() == lc::CameraConfiguration::Invalid) {
      throw std::runtime_error("has no such configuration: choose another size or format");
    }
    *setup = {};
    setup->fourcc = chosen.pixelFormat.fourcc();
    setup->modifier = chosen.pixelFormat.modifier();
    setup->width = static_cast<std::int32_t>(chosen.size.width);
    setup->height = static_cast<std::int32_t>(chosen.size.height);
    const bool is_other =
        (wish->fourcc != 0 && chosen.pixelFormat != wanted_format) || (wish->width > 0 && chosen.size != wanted_size);
    if (is_other) return kLibcameraAdjusted;
    auto opened = std::make_unique<LibcameraStream>(*manager, of, std::move(configuration));
    opened->set_up(*wish, *setup);
    setup->stride = opened->stride();
    manager->streams.push_back(opened.get());
    *stream = opened.release();
    return kLibcameraOpened;
  });
}

std::int32_t plane(LibcameraStream* stream, std::uint32_t buffer, std::uint32_t number, const std::uint8_t** data,
                   std::uint64_t* bytes) {
  const std::vector<Mapping>& mappings = stream->mappings();
  if (buffer >= mappings.size() || number >= mappings[buffer].planes().size()) return 0;
  *data = mappings[buffer].planes()[number].data;
  *bytes = mappings[buffer].planes()[number].bytes;
  return 1;
}

std::int32_t start(LibcameraStream* stream, char* why) {
  const WithoutSignals quiet;
  return guarded<std::int32_t>(why, 0, [&] {
    stream->start();
    return 1;
  });
}

void close(LibcameraStream* stream) {
  (void)guarded<int>(nullptr, 0, [&] {
    LibcameraManager& manager = stream->manager();
    std::erase(manager.streams, stream);
    if (manager.is_gone(stream->camera())) {
      stream->end();
    } else {
      delete stream;
    }
    return 0;
  });
}

const char* loss(LibcameraStream* stream) {
  const char* const cause = stream->handover().loss();
  return cause == nullptr ? "" : cause;
}

std::int32_t take(LibcameraStream* stream, LibcameraFrame* frame) { return stream->handover().take(*frame); }

void give_back(LibcameraStream* stream, std::uint32_t buffer) { stream->handover().give_back(buffer); }

}  // namespace

extern "C" __attribute__((visibility("default"))) const LibcameraModule* stereotrack_libcamera_module() {
  static const LibcameraModule kTable = {kLibcameraModuleVersion,
                                         sizeof(LibcameraModule),
                                         library,
                                         open_manager,
                                         close_manager,
                                         complaint,
                                         renew,
                                         count,
                                         facts,
                                         format,
                                         open,
                                         plane,
                                         start,
                                         close,
                                         loss,
                                         take,
                                         give_back};
  return &kTable;
}

/// libcamera finds these, not libudev's: a module's own symbols come first for the libraries that it brings. Debian
/// 12's libudev hears of nothing before the first; Debian 13's listens from its making on, but nobody waits for what it
/// hears.
extern "C" __attribute__((visibility("default"))) int udev_monitor_enable_receiving(void* /*monitor*/);
extern "C" int udev_monitor_enable_receiving(void* /*monitor*/) { return 0; }
extern "C" __attribute__((visibility("default"))) int udev_monitor_get_fd(void* /*monitor*/);
extern "C" int udev_monitor_get_fd(void* /*monitor*/) {
  static const int silent = ::eventfd(0, EFD_CLOEXEC);
  return silent;
}
