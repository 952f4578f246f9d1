#include "firmware-app/runtime/allocation_count.hpp"

#include <cerrno>
#include <cstddef>

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define STEREOTRACK_COUNTS_ALLOCATIONS 0
#elif defined(__has_feature)
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer)
#define STEREOTRACK_COUNTS_ALLOCATIONS 0
#endif
#endif
#ifndef STEREOTRACK_COUNTS_ALLOCATIONS
#define STEREOTRACK_COUNTS_ALLOCATIONS 1
#endif

namespace {

thread_local std::uint64_t count = 0;
thread_local std::uint64_t freed = 0;

}  // namespace

#if STEREOTRACK_COUNTS_ALLOCATIONS

// glibc's own entry points under the public names.
extern "C" {
void* __libc_malloc(std::size_t size);
void* __libc_calloc(std::size_t number, std::size_t size);
void* __libc_realloc(void* old, std::size_t size);
void* __libc_memalign(std::size_t alignment, std::size_t size);
void* __libc_valloc(std::size_t size);
void* __libc_pvalloc(std::size_t size);
void __libc_free(void* memory);

void* malloc(std::size_t size) {
  ++count;
  return __libc_malloc(size);
}
void* calloc(std::size_t number, std::size_t size) {
  ++count;
  return __libc_calloc(number, size);
}
void* realloc(void* old, std::size_t size) {
  ++count;
  return __libc_realloc(old, size);
}
void* memalign(std::size_t alignment, std::size_t size) {
  ++count;
  return __libc_memalign(alignment, size);
}
void* aligned_alloc(std::size_t alignment, std::size_t size) {
  ++count;
  return __libc_memalign(alignment, size);
}
int posix_memalign(void** out, std::size_t alignment, std::size_t size) {
  ++count;
  void* memory = __libc_memalign(alignment, size);
  if (memory == nullptr) return ENOMEM;
  *out = memory;
  return 0;
}
void* valloc(std::size_t size) {
  ++count;
  return __libc_valloc(size);
}
void* pvalloc(std::size_t size) {
  ++count;
  return __libc_pvalloc(size);
}
void free(void* memory) {
  ++freed;
  __libc_free(memory);
}
}

#endif

namespace stereotrack {

std::uint64_t allocations_of_this_thread() noexcept { return count; }
std::uint64_t frees_of_this_thread() noexcept { return freed; }
bool allocations_are_counted() noexcept { return STEREOTRACK_COUNTS_ALLOCATIONS == 1; }

}  // namespace stereotrack
