#include <fcntl.h>
#include <linux/dma-buf.h>
#include <linux/dma-heap.h>
#include <linux/udmabuf.h>
#include <linux/videodev2.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <filesystem>
#include <system_error>

#include "drivers/capture/v4l2/stream.hpp"

namespace stereotrack::capture::v4l2 {

namespace {

constexpr const char* kUserMemory = "/dev/udmabuf";

std::size_t whole_pages(std::size_t bytes) {
  const auto page = static_cast<std::size_t>(::sysconf(_SC_PAGESIZE));
  return (bytes + page - 1) / page * page;
}

/// The heaps that there are, for people.
std::string heaps_text() {
  std::string text;
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator("/dev/dma_heap", error)) {
    text += (text.empty() ? "" : ", ") + entry.path().string();
  }
  if (std::filesystem::exists(kUserMemory, error)) text += (text.empty() ? "" : ", ") + std::string(kUserMemory);
  return text.empty() ? "this kernel has none" : "there are " + text;
}

[[noreturn]] void refuse_heap(const std::string& name, const std::string& heap, int error) {
  std::string way_out = heaps_text();
  if (error == EACCES || error == EPERM)
    way_out = "let a udev rule give it to the group video, and the daemon be in it";
  if (error == ENOMEM) way_out = "it has no more memory: lower camera.buffers, or give the kernel more (cma=)";
  refuse(name, "no memory from " + heap + " (" + error_text(error) + "): " + way_out);
}

/// A dma-buf of a heap's; or a negative errno.
int from_heap(const std::string& heap, std::size_t bytes) {
  const int device = ::open(heap.c_str(), O_RDWR | O_CLOEXEC);
  if (device < 0) return -errno;
  dma_heap_allocation_data wish{};
  wish.len = bytes;
  wish.fd_flags = O_RDWR | O_CLOEXEC;
  const int error = ask_kernel(device, DMA_HEAP_IOCTL_ALLOC, &wish);
  ::close(device);
  return error == 0 ? static_cast<int>(wish.fd) : -error;
}

/// One over memory of the process.
int from_process(std::size_t bytes) {
  const int device = ::open(kUserMemory, O_RDWR | O_CLOEXEC);
  if (device < 0) return -errno;
  udmabuf_create wish{};
  const int file = ::memfd_create("stereotrack-frame", MFD_CLOEXEC | MFD_ALLOW_SEALING);
  int made = -1;
  if (file >= 0 && ::ftruncate(file, static_cast<off_t>(bytes)) == 0 &&
      ::fcntl(file, F_ADD_SEALS, F_SEAL_SHRINK) == 0) {
    wish.memfd = static_cast<std::uint32_t>(file);
    wish.flags = UDMABUF_FLAGS_CLOEXEC;
    wish.size = bytes;
    made = ::ioctl(device, UDMABUF_CREATE, &wish);
  }
  const int error = errno;
  if (file >= 0) ::close(file);
  ::close(device);
  return made >= 0 ? made : -error;
}

}  // namespace

Buffers::Buffers(const Device& device, const Layout& layout, std::size_t wanted, Memory memory, const std::string& heap,
                 const std::string& name)
    : device_(device), layout_(layout), memory_(memory), heap_(heap) {
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
    for (const int descriptor : buffer.shared) {
      if (descriptor >= 0) ::close(descriptor);
    }
    buffer = {};
  }
  v4l2_requestbuffers none{};
  none.type = layout_.buffer_type();
  none.memory = memory_type();
  (void)device_.ask(VIDIOC_REQBUFS, none);
  count_ = 0;
}

std::uint32_t Buffers::memory_type() const noexcept { return are_imported() ? V4L2_MEMORY_DMABUF : V4L2_MEMORY_MMAP; }

void Buffers::request(std::size_t wanted, const std::string& name) {
  v4l2_requestbuffers request{};
  request.type = layout_.buffer_type();
  request.memory = memory_type();
  // None at first: the answer tells what the driver can do.
  const int answer = device_.ask(VIDIOC_REQBUFS, request);
  const bool can_cache = !are_imported() && (request.capabilities & V4L2_BUF_CAP_SUPPORTS_MMAP_CACHE_HINTS) != 0;
  if (are_imported() && answer == EINVAL) {
    refuse(name, "its driver takes no memory of others: set camera.memory = \"mmap\", or leave camera.heap out");
  }
  request = {};
  request.type = layout_.buffer_type();
  request.memory = memory_type();
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
  facts.memory = memory_type();
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
  const std::array<std::size_t, 2> lengths = bytes;
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
    if (memory_ != Memory::kMapped) {
      descriptor = buffer.shared[i] = share(index, i, lengths[i], name);
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

/// The dma-buf of one plane: the driver's memory, or the heap's.
int Buffers::share(std::uint32_t index, std::size_t plane, std::size_t bytes, const std::string& name) const {
  if (are_imported()) {
    const int made = heap_ == kUserMemory ? from_process(whole_pages(bytes)) : from_heap(heap_, whole_pages(bytes));
    if (made < 0) refuse_heap(name, heap_, -made);
    return made;
  }
  v4l2_exportbuffer exported{};
  exported.type = layout_.buffer_type();
  exported.index = index;
  exported.plane = static_cast<std::uint32_t>(plane);
  exported.flags = O_CLOEXEC | O_RDWR;
  if (const int error = device_.ask(VIDIOC_EXPBUF, exported); error != 0) {
    refuse(name, std::string("cannot export its buffers (") + error_text(error) + "): set camera.memory = \"mmap\"");
  }
  return exported.fd;
}

std::span<const std::uint8_t> Buffers::memory(std::uint32_t buffer) const noexcept {
  return {buffers_[buffer].memory, buffers_[buffer].bytes};
}

void Buffers::sync(std::uint32_t buffer, std::uint64_t flags) const noexcept {
  for (const int descriptor : buffers_[buffer].shared) {
    if (descriptor < 0) continue;
    dma_buf_sync moment{flags | DMA_BUF_SYNC_READ};
    (void)ask_kernel(descriptor, DMA_BUF_IOCTL_SYNC, &moment);
  }
}

void Buffers::begin_read(std::uint32_t buffer) const noexcept { sync(buffer, DMA_BUF_SYNC_START); }
void Buffers::end_read(std::uint32_t buffer) const noexcept { sync(buffer, DMA_BUF_SYNC_END); }

}  // namespace stereotrack::capture::v4l2
