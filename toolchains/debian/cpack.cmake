# Run by cpack before it packs: dependencies are read from what was built.
function(stereotrack_depends VARIABLE)
  execute_process(COMMAND ${CPACK_STEREOTRACK_DEPENDS} ${ARGN}
    OUTPUT_VARIABLE depends OUTPUT_STRIP_TRAILING_WHITESPACE RESULT_VARIABLE code)
  if(code)
    message(FATAL_ERROR "the dependencies of ${ARGN} cannot be told")
  endif()
  set(${VARIABLE} "${depends}" PARENT_SCOPE)
endfunction()

stereotrack_depends(daemon ${CPACK_STEREOTRACK_DAEMON})
# For its scripts: systemd-sysusers, systemd-tmpfiles, deb-systemd-helper; and kill, for its unit.
set(CPACK_DEBIAN_STEREOTRACK_PACKAGE_DEPENDS "${daemon}, systemd, init-system-helpers (>= 1.62), procps, udev")
stereotrack_depends(CPACK_DEBIAN_STEREOTRACK-TOOLS_PACKAGE_DEPENDS ${CPACK_STEREOTRACK_TOOL})
file(GLOB modules ${CPACK_STEREOTRACK_MODULES})
if(modules)
  stereotrack_depends(CPACK_DEBIAN_STEREOTRACK-LIBCAMERA_PACKAGE_DEPENDS ${modules})
endif()
