// A dma-heap for kernels that have none: what /dev/zero is asked for as a heap, the other test camera lends, a buffer
// of its own memory that it exports. The driver's code runs as it is; ioctl(2) of this program alone is another.
#include "tests/system/board/capture/lent_memory.hpp"

#include <fcntl.h>
#include <linux/dma-heap.h>
#include <linux/videodev2.h>
#include <sys/ioctl.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/sysmacros.h>
#include <unistd.h>

#include <cerrno>
#include <cstdarg>
#include <cstdint>

namespace {

int ask(int descriptor, unsigned long request, void* argument) {
  return static_cast<int>(syscall(SYS_ioctl, descriptor, request, argument));
}

/// Of a grey picture of that many bytes at least; -1: errno says why. What is exported outlives its device's queue.
int lend(std::uint64_t bytes) {
  constexpr std::uint32_t kWidth = 1280;
  constexpr std::uint32_t kHeight = 720;
  if (bytes > std::uint64_t{kWidth} * kHeight) {
    errno = ENOMEM;
    return -1;
  }
  const int device = open("/dev/video1", O_RDWR | O_CLOEXEC);
  if (device < 0) return -1;
  v4l2_format format{};
  format.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  format.fmt.pix.width = kWidth;
  format.fmt.pix.height = kHeight;
  format.fmt.pix.pixelformat = V4L2_PIX_FMT_GREY;
  if (ask(device, VIDIOC_S_FMT, &format) != 0) {
    format = {};
    format.type = V4L2_BUF_TYPE_VIDEO_CAPTURE_MPLANE;
    format.fmt.pix_mp.width = kWidth;
    format.fmt.pix_mp.height = kHeight;
    format.fmt.pix_mp.pixelformat = V4L2_PIX_FMT_GREY;
    if (ask(device, VIDIOC_S_FMT, &format) != 0) return -1;
  }
  v4l2_requestbuffers wish{};
  wish.type = format.type;
  wish.memory = V4L2_MEMORY_MMAP;
  wish.count = 1;
  v4l2_exportbuffer exported{};
  exported.type = format.type;
  exported.flags = O_CLOEXEC | O_RDWR;
  const bool done = ask(device, VIDIOC_REQBUFS, &wish) == 0 && ask(device, VIDIOC_EXPBUF, &exported) == 0;
  close(device);
  if (done) ++stereotrack::capture::v4l2::test::lent_buffers;
  return done ? exported.fd : -1;
}

bool is_lender(int descriptor) {
  struct stat facts {};
  return fstat(descriptor, &facts) == 0 && S_ISCHR(facts.st_mode) && facts.st_rdev == makedev(1, 5);
}

}  // namespace

int stereotrack::capture::v4l2::test::lent_buffers = 0;

extern "C" int ioctl(int descriptor, unsigned long request, ...) noexcept {
  va_list arguments;
  va_start(arguments, request);
  void* const argument = va_arg(arguments, void*);
  va_end(arguments);
  if (request != DMA_HEAP_IOCTL_ALLOC || !is_lender(descriptor)) return ask(descriptor, request, argument);
  auto& wish = *static_cast<dma_heap_allocation_data*>(argument);
  const int lent = lend(wish.len);
  if (lent < 0) return -1;
  wish.fd = static_cast<std::uint32_t>(lent);
  return 0;
}
