#pragma once

#include <cstddef>

namespace stereotrack::runtime {

/// Arena::Advice: asks the system for large pages for a slab. A region of the picture touches a row of each of a dozen
/// planes; with pages of 4 kB nearly each of those rows wants its address translated anew. Where the system grants none
/// (/sys/kernel/mm/transparent_hugepage/enabled says "never") all is as right, and slower. At start, any thread.
void advise_large_pages(void* slab, std::size_t bytes) noexcept;

}  // namespace stereotrack::runtime
