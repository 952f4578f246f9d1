#include <fcntl.h>
#include <linux/dma-buf.h>
#include <linux/videodev2.h>
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>

#include "drivers/capture/v4l2/stream.hpp"

namespace stereotrack::capture::v4l2 {

Buffers::Buffers(const Device& device, const Layout& layout, std::size_t wanted, Memory memory, const std::string& name)
    : device_(device), layout_(layout), memory_(memory) {
  try {
    request(std::clamp(wanted, kFewest, kMost), name);
    for (std::uint32_t index = 0; index < count_; ++index) map(index, name);
  } catch (...) {
    release();
    throw;
  }
}

Buffers::~Buffers() { release(); }

void Buffers::release() noexcept {
  for (Buffer& buffer : buffers_) {
    if (buffer.memory != nullptr) ::munmap(buffer.memory, buffer.bytes);
    for (const int descriptor : buffer.exported) {
      if (descriptor >= 0) ::close(descriptor);
    }
    buffer = {};
  }
  v4l2_requestbuffers none{};
  none.type = layout_.buffer_type();
  none.memory = V4L2_MEMORY_MMAP;
  (void)device_.ask(VIDIOC_REQBUFS, none);
  count_ = 0;
}

void Buffers::request(std::size_t wanted, const std::string& name) {
  v4l2_requestbuffers request{};
  request.type = layout_.buffer_type();
  request.memory = V4L2_MEMORY_MMAP;
  // None at first: the answer tells what the driver can do.
  (void)device_.ask(VIDIOC_REQBUFS, request);
  const bool can_cache = (request.capabilities & V4L2_BUF_CAP_SUPPORTS_MMAP_CACHE_HINTS) != 0;
  request = {};
  request.type = layout_.buffer_type();
  request.memory = V4L2_MEMORY_MMAP;
  request.count = static_cast<std::uint32_t>(wanted);
  // Memory that the processor caches: the kernel cleans it at each turn, and reading is many times faster.
  if (can_cache) request.flags = V4L2_MEMORY_FLAG_NON_COHERENT;
  const int error = device_.ask(VIDIOC_REQBUFS, request);
  if (error == EBUSY) {
    refuse(name, "busy: another program streams from it (fuser -v /dev/video* tells which): stop that");
  }
  if (error != 0) {
    refuse(name, "gives no " + std::to_string(wanted) + " buffers (" + error_text(error) + ", errno " +
                     std::to_string(error) + "): ask for fewer or smaller ones, or plug it in again");
  }
  if (request.count < kFewest) {
    refuse(name, "gives " + std::to_string(request.count) + " of " + std::to_string(wanted) +
                     " buffers, which are too few: choose a smaller size, give the kernel more memory (cma=) or its "
                     "driver more buffers");
  }
  count_ = std::min<std::size_t>(request.count, kMost);
}

void Buffers::map(std::uint32_t index, const std::string& name) {
  v4l2_buffer facts{};
  std::array<v4l2_plane, VIDEO_MAX_PLANES> planes{};
  facts.type = layout_.buffer_type();
  facts.memory = V4L2_MEMORY_MMAP;
  facts.index = index;
  if (layout_.planes_interface) {
    facts.m.planes = planes.data();
    facts.length = static_cast<std::uint32_t>(planes.size());
  }
  if (const int error = device_.ask(VIDIOC_QUERYBUF, facts); error != 0) {
    refuse(name, std::string("does not tell where its buffers are: ") + error_text(error));
  }
  if (index == 0) flags_ = facts.flags;

  const std::size_t pieces = layout_.format->planes;
  std::array<std::size_t, 2> bytes{};
  std::array<off_t, 2> offsets{};
  for (std::size_t i = 0; i < pieces; ++i) {
    bytes[i] = layout_.planes_interface ? planes[i].length : facts.length;
    offsets[i] = layout_.planes_interface ? planes[i].m.mem_offset : facts.m.offset;
  }
  // Of brightness no more than its rows, so that the colour's follow them.
  if (pieces == 2) bytes[0] = layout_.luma_bytes;

  Buffer& buffer = buffers_[index];
  if (bytes[0] + bytes[1] < layout_.bytes) refuse(name, "its buffers are smaller than its pictures");
  void* const place = ::mmap(nullptr, bytes[0] + bytes[1], PROT_NONE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  if (place == MAP_FAILED) refuse(name, "no room for its buffers");
  buffer.memory = static_cast<std::uint8_t*>(place);
  buffer.bytes = bytes[0] + bytes[1];

  std::uint8_t* at = buffer.memory;
  for (std::size_t i = 0; i < pieces; ++i) {
    int descriptor = device_.descriptor();
    off_t offset = offsets[i];
    if (memory_ == Memory::kExported) {
      v4l2_exportbuffer exported{};
      exported.type = layout_.buffer_type();
      exported.index = index;
      exported.plane = static_cast<std::uint32_t>(i);
      exported.flags = O_CLOEXEC | O_RDWR;
      if (const int error = device_.ask(VIDIOC_EXPBUF, exported); error != 0) {
        refuse(name, std::string("cannot export its buffers (") + error_text(error) + "): use mapped ones");
      }
      descriptor = buffer.exported[i] = exported.fd;
      offset = 0;
    }
    // Some drivers map for reading and writing only.
    void* mapped = ::mmap(at, bytes[i], PROT_READ, MAP_SHARED | MAP_FIXED, descriptor, offset);
    if (mapped == MAP_FAILED) {
      mapped = ::mmap(at, bytes[i], PROT_READ | PROT_WRITE, MAP_SHARED | MAP_FIXED, descriptor, offset);
    }
    if (mapped == MAP_FAILED) {
      refuse(name, std::string("its buffers cannot be mapped: ") + error_text(errno));
    }
    at += bytes[i];
  }
}

std::span<const std::uint8_t> Buffers::memory(std::uint32_t buffer) const noexcept {
  return {buffers_[buffer].memory, buffers_[buffer].bytes};
}

void Buffers::sync(std::uint32_t buffer, std::uint64_t flags) const noexcept {
  for (const int descriptor : buffers_[buffer].exported) {
    if (descriptor < 0) continue;
    dma_buf_sync moment{flags | DMA_BUF_SYNC_READ};
    (void)ask_kernel(descriptor, DMA_BUF_IOCTL_SYNC, &moment);
  }
}

void Buffers::begin_read(std::uint32_t buffer) const noexcept { sync(buffer, DMA_BUF_SYNC_START); }
void Buffers::end_read(std::uint32_t buffer) const noexcept { sync(buffer, DMA_BUF_SYNC_END); }

}  // namespace stereotrack::capture::v4l2
