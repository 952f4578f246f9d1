# What the toolchain files of this folder share. Each says
#     stereotrack_triplet         Debian's name of the architecture: aarch64-linux-gnu
#     stereotrack_architecture    dpkg's: arm64
#     stereotrack_processor       CMake's and the kernel's: aarch64
#     stereotrack_emulator        of one program, on this machine: qemu-aarch64
#     stereotrack_flags           for every compilation
#     stereotrack_flags_of_gcc    those that only GCC knows
#
# The sysroot is the target's libraries and headers. The compiler is this machine's; it must not know a newer C library
# than the sysroot has.
set(STEREOTRACK_DEBIAN bookworm CACHE STRING "Debian whose sysroot is taken: bookworm (12), trixie (13)")
set(STEREOTRACK_COMPILER gcc CACHE STRING "gcc, clang, or clang-VERSION")
# Never what the results are: floating point is not contracted (the top CMakeLists.txt), and no kernel asks which core
# it is. A core newer than the board's is an illegal instruction there.
set(STEREOTRACK_CPU "" CACHE STRING "Core to build for: cortex-a53, cortex-a72, cortex-a76; empty: any")
if(NOT STEREOTRACK_SYSROOT)
  if(DEFINED ENV{STEREOTRACK_BOARD_CACHE})
    set(sysroot $ENV{STEREOTRACK_BOARD_CACHE})
  else()
    get_filename_component(sysroot ${CMAKE_CURRENT_LIST_DIR}/../build ABSOLUTE)
  endif()
  string(APPEND sysroot /sysroots/${STEREOTRACK_DEBIAN}-${stereotrack_architecture})
endif()
set(STEREOTRACK_SYSROOT "${sysroot}" CACHE PATH "The target's libraries and headers (toolchains/make_sysroot.sh)")
list(APPEND CMAKE_TRY_COMPILE_PLATFORM_VARIABLES
  STEREOTRACK_DEBIAN STEREOTRACK_COMPILER STEREOTRACK_CPU STEREOTRACK_SYSROOT)
get_filename_component(root "${STEREOTRACK_SYSROOT}" ABSOLUTE BASE_DIR ${CMAKE_SOURCE_DIR})
# As both Debian and what was copied from a board have it.
set(libraries ${root}/usr/lib/${stereotrack_triplet})
if(NOT EXISTS ${libraries})
  message(FATAL_ERROR "${root} is no sysroot: it lacks usr/lib/${stereotrack_triplet}. To make one: "
                      "toolchains/make_sysroot.sh ${STEREOTRACK_DEBIAN}-${stereotrack_architecture} (docs/CROSS.md)")
endif()

set(CMAKE_SYSTEM_NAME Linux)
set(CMAKE_SYSTEM_PROCESSOR ${stereotrack_processor})
set(CMAKE_LIBRARY_ARCHITECTURE ${stereotrack_triplet})
set(CMAKE_SYSROOT ${root})
# The newest GCC of the sysroot: its C++ library is what the target's other libraries were linked with.
file(GLOB of_gcc LIST_DIRECTORIES ON ${root}/usr/lib/gcc/${stereotrack_triplet}/*)
list(SORT of_gcc COMPARE NATURAL ORDER DESCENDING)
set(link_flags -L${libraries})
if(of_gcc)
  list(GET of_gcc 0 newest)
  string(APPEND link_flags " -L${newest}")
endif()
if(STEREOTRACK_COMPILER STREQUAL gcc)
  set(CMAKE_C_COMPILER ${stereotrack_triplet}-gcc)
  set(CMAKE_CXX_COMPILER ${stereotrack_triplet}-g++)
  # Start files of the sysroot's C library, not of the compiler's own.
  string(PREPEND stereotrack_flags "-B${libraries} ${stereotrack_flags_of_gcc} ")
elseif(STEREOTRACK_COMPILER MATCHES "^clang(-[0-9]+)?$")
  set(CMAKE_C_COMPILER clang${CMAKE_MATCH_1})
  set(CMAKE_CXX_COMPILER clang++${CMAKE_MATCH_1})
  set(CMAKE_C_COMPILER_TARGET ${stereotrack_triplet})
  set(CMAKE_CXX_COMPILER_TARGET ${stereotrack_triplet})
  # The sysroot's own libstdc++, headers too, and a linker that knows every architecture.
  string(PREPEND stereotrack_flags "--gcc-toolchain=${root}/usr ")
  string(APPEND link_flags " -fuse-ld=lld${CMAKE_MATCH_1}")
else()
  message(FATAL_ERROR "STEREOTRACK_COMPILER=${STEREOTRACK_COMPILER}: want gcc, clang, or clang-VERSION")
endif()
if(STEREOTRACK_CPU)
  string(APPEND stereotrack_flags " -mcpu=${STEREOTRACK_CPU}")
endif()
set(CMAKE_C_FLAGS_INIT "${stereotrack_flags}")
set(CMAKE_CXX_FLAGS_INIT "${stereotrack_flags}")
set(CMAKE_EXE_LINKER_FLAGS_INIT "${link_flags}")
set(CMAKE_SHARED_LINKER_FLAGS_INIT "${link_flags}")
set(CMAKE_MODULE_LINKER_FLAGS_INIT "${link_flags}")

# Not this machine's own .pc files; what they say of /usr means the sysroot's.
set(ENV{PKG_CONFIG_SYSROOT_DIR} ${root})
set(ENV{PKG_CONFIG_LIBDIR} ${libraries}/pkgconfig:${root}/usr/share/pkgconfig)
set(CMAKE_FIND_ROOT_PATH ${root})
set(CMAKE_FIND_ROOT_PATH_MODE_PROGRAM NEVER)
set(CMAKE_FIND_ROOT_PATH_MODE_LIBRARY ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_INCLUDE ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_PACKAGE ONLY)
set(CMAKE_CROSSCOMPILING_EMULATOR ${stereotrack_emulator};-L;${root})
