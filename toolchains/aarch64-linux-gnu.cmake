# 64-bit ARM with Debian's cross compiler (g++-aarch64-linux-gnu). Programs and tests run in qemu-aarch64.
# The cross compiler brings the C and C++ libraries; ours lie where toolchains/fetch_arm64.sh has unpacked them:
#     toolchains/fetch_arm64.sh build/arm64 && cmake --preset aarch64
set(CMAKE_SYSTEM_NAME Linux)
set(CMAKE_SYSTEM_PROCESSOR aarch64)
set(CMAKE_C_COMPILER aarch64-linux-gnu-gcc)
set(CMAKE_CXX_COMPILER aarch64-linux-gnu-g++)
set(CMAKE_LIBRARY_ARCHITECTURE aarch64-linux-gnu)

set(STEREOTRACK_ARM64_ROOT ${CMAKE_CURRENT_LIST_DIR}/../build/arm64/root CACHE PATH "Unpacked arm64 packages")
get_filename_component(root ${STEREOTRACK_ARM64_ROOT} ABSOLUTE)
list(APPEND CMAKE_TRY_COMPILE_PLATFORM_VARIABLES STEREOTRACK_ARM64_ROOT)
set(CMAKE_FIND_ROOT_PATH ${root})
set(CMAKE_FIND_ROOT_PATH_MODE_PROGRAM NEVER)
set(CMAKE_FIND_ROOT_PATH_MODE_LIBRARY ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_INCLUDE ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_PACKAGE ONLY)

# Where the programs' loader and C library are when emulated.
set(CMAKE_CROSSCOMPILING_EMULATOR qemu-aarch64;-L;/usr/aarch64-linux-gnu)
