# 64-bit ARM, as Debian's arm64: g++-aarch64-linux-gnu or clang, and a sysroot (cross.cmake has the settings).
#     toolchains/make_sysroot.sh bookworm-arm64 && cmake --preset aarch64
set(stereotrack_triplet aarch64-linux-gnu)
set(stereotrack_architecture arm64)
set(stereotrack_processor aarch64)
set(stereotrack_emulator qemu-aarch64)
set(stereotrack_flags "")
set(stereotrack_flags_of_gcc "")
include(${CMAKE_CURRENT_LIST_DIR}/cross.cmake)
