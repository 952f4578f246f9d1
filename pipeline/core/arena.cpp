#include "pipeline/core/arena.hpp"

#include <new>

namespace stereotrack {

namespace {

constexpr std::size_t rounded_up(std::size_t bytes, std::size_t to) noexcept { return (bytes + to - 1) / to * to; }

// The address sanitizer sees a stage write into its neighbour's memory only where each request has a slab of its own.
#if defined(__SANITIZE_ADDRESS__)
constexpr std::align_val_t kBegin{Arena::kAlignment};
constexpr std::size_t slab_for(std::size_t bytes) noexcept { return bytes; }
#else
constexpr std::align_val_t kBegin{2 * 1024 * 1024};  // a large page of x86-64, and of ARM with pages of 4 kB
constexpr std::size_t slab_for(std::size_t bytes) noexcept { return rounded_up(bytes, Arena::kSlabBytes); }
#endif

}  // namespace

Arena::~Arena() {
  while (slabs_ != nullptr) {
    Slab* next = slabs_->next;
    ::operator delete(slabs_, kBegin);
    slabs_ = next;
  }
}

void* Arena::take(std::size_t bytes) noexcept {
  constexpr std::size_t kMost = PTRDIFF_MAX - 2 * kSlabBytes;  // no object is larger, its slab included
  if (sealed_ || bytes > kMost) {
    failed_ = true;
    return nullptr;
  }
  const std::size_t wanted = rounded_up(bytes, kAlignment);
  if (wanted <= free_bytes_) {
    char* taken = free_;
    free_ += wanted;
    free_bytes_ -= wanted;
    used_ += bytes;
    return taken;
  }
  const std::size_t size = slab_for(kAlignment + bytes);
  void* memory = ::operator new(size, kBegin, std::nothrow);
  if (memory == nullptr) {
    failed_ = true;
    return nullptr;
  }
  if (advice_ != nullptr) advice_(memory, size);
  slabs_ = new (memory) Slab{slabs_};
  capacity_ += size;
  used_ += bytes;
  char* taken = static_cast<char*>(memory) + kAlignment;
  const std::size_t left = size > kAlignment + wanted ? size - kAlignment - wanted : 0;
  if (left > free_bytes_) {
    free_ = taken + wanted;
    free_bytes_ = left;
  }
  return taken;
}

}  // namespace stereotrack
