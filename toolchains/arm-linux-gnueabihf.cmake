# 32-bit ARM, as Debian's armhf: g++-arm-linux-gnueabihf or clang, and a sysroot (cross.cmake has the settings).
#     toolchains/make_sysroot.sh bookworm-armhf && cmake --preset armhf
#
# NEON with fused multiply-add is asked for, which Debian does not: Highway's headers want it. Cortex-A7, A15 and all
# 64-bit cores have it; A8 and A9 do not. Kernels are the plain ones all the same (pipeline/core/simd.cpp).
set(stereotrack_triplet arm-linux-gnueabihf)
set(stereotrack_architecture armhf)
set(stereotrack_processor armv7l)
set(stereotrack_emulator qemu-arm)
# Files may be larger than 2 GiB: recordings are.
set(stereotrack_flags "-march=armv7-a -mfpu=neon-vfpv4 -mfloat-abi=hard -mthumb -D_FILE_OFFSET_BITS=64")
# Highway names the type of 16 bits, which GCC has only when told in which form. GCC would tell of a change in 2017, and
# GCC 12 imagines overlaps in std::string (its bug 105651).
set(stereotrack_flags_of_gcc "-mfp16-format=ieee -Wno-psabi -Wno-restrict")
# Seconds are as wide as in the libraries: libgpiod and cpp-httplib pass them. Debian 13 has made all 64 bits; before,
# they are 32, which end in 2038.
if(STEREOTRACK_DEBIAN STREQUAL trixie)
  string(APPEND stereotrack_flags " -D_TIME_BITS=64")
endif()
include(${CMAKE_CURRENT_LIST_DIR}/cross.cmake)
