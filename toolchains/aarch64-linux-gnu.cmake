# 64-bit ARM with Debian's cross compiler (g++-aarch64-linux-gnu). Two ways to the libraries:
#     toolchains/fetch_arm64.sh build/arm64 && cmake --preset aarch64
#         what needs no OpenCV. The compiler brings the C and C++ libraries, ours lie unpacked in STEREOTRACK_ARM64_ROOT;
#         programs and tests run in qemu-aarch64.
#     toolchains/make_sysroot.sh bookworm-arm64 && cmake --preset aarch64-board
#         everything. STEREOTRACK_SYSROOT is a whole arm64 Debian; programs run there, on a board: tests/system/board.
set(CMAKE_SYSTEM_NAME Linux)
set(CMAKE_SYSTEM_PROCESSOR aarch64)
set(CMAKE_C_COMPILER aarch64-linux-gnu-gcc)
set(CMAKE_CXX_COMPILER aarch64-linux-gnu-g++)
set(CMAKE_LIBRARY_ARCHITECTURE aarch64-linux-gnu)

set(STEREOTRACK_SYSROOT "" CACHE PATH "Whole arm64 system to compile and link against; empty: the compiler's own")
set(STEREOTRACK_ARM64_ROOT ${CMAKE_CURRENT_LIST_DIR}/../build/arm64/root CACHE PATH "Unpacked arm64 packages")
list(APPEND CMAKE_TRY_COMPILE_PLATFORM_VARIABLES STEREOTRACK_SYSROOT STEREOTRACK_ARM64_ROOT)
if(STEREOTRACK_SYSROOT)
  get_filename_component(root ${STEREOTRACK_SYSROOT} ABSOLUTE)
  set(CMAKE_SYSROOT ${root})
  # Not this machine's own .pc files; what they say of /usr means the sysroot's.
  set(ENV{PKG_CONFIG_SYSROOT_DIR} ${root})
  set(ENV{PKG_CONFIG_LIBDIR} ${root}/usr/lib/aarch64-linux-gnu/pkgconfig:${root}/usr/share/pkgconfig)
else()
  get_filename_component(root ${STEREOTRACK_ARM64_ROOT} ABSOLUTE)
  # Where the programs' loader and C library are when emulated.
  set(CMAKE_CROSSCOMPILING_EMULATOR qemu-aarch64;-L;/usr/aarch64-linux-gnu)
endif()
set(CMAKE_FIND_ROOT_PATH ${root})
set(CMAKE_FIND_ROOT_PATH_MODE_PROGRAM NEVER)
set(CMAKE_FIND_ROOT_PATH_MODE_LIBRARY ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_INCLUDE ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_PACKAGE ONLY)
