#include "firmware-app/runtime/large_pages.hpp"

#include <sys/mman.h>

namespace stereotrack::runtime {

void advise_large_pages(void* slab, std::size_t bytes) noexcept { (void)madvise(slab, bytes, MADV_HUGEPAGE); }

}  // namespace stereotrack::runtime
