# Tests of a build for another CPU, in an emulator of one process (CMAKE_CROSSCOMPILING_EMULATOR): ./dev cross.
find_package(Python3 REQUIRED COMPONENTS Interpreter)
set(STEREOTRACK_NATIVE_BIN "" CACHE PATH "Folder of programs of this machine, built from the same source")
set(stereotrack_emulated ${CMAKE_CURRENT_LIST_DIR})
set(left_out ${CMAKE_CURRENT_LIST_DIR}/left_out.txt)
set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${left_out})
# Whole programs are not even built, except where the emulated board wants one.
file(STRINGS ${left_out} stereotrack_programs_left_out REGEX "^program ")
list(TRANSFORM stereotrack_programs_left_out REPLACE "^program ([^ ]+).*" "\\1")
file(STRINGS ${left_out} stereotrack_rooms_left_out REGEX "^room ")
list(TRANSFORM stereotrack_rooms_left_out REPLACE "^room ([^ ]+).*" "\\1")

# One ctest entry for a program of GoogleTest, less what left_out.txt names. The limit is for one that hangs:
# record_test takes minutes of a core's own.
function(stereotrack_emulated_test NAME LABEL)
  if(${NAME} IN_LIST stereotrack_programs_left_out)
    set_target_properties(${NAME} PROPERTIES EXCLUDE_FROM_ALL ON)
    return()
  endif()
  add_test(NAME ${NAME} COMMAND ${Python3_EXECUTABLE} ${stereotrack_emulated}/emulated.py run
    --results ${CMAKE_BINARY_DIR}/emulated $<TARGET_FILE:${NAME}> ${CMAKE_CROSSCOMPILING_EMULATOR})
  set_tests_properties(${NAME} PROPERTIES LABELS ${LABEL} TIMEOUT 3600 ENVIRONMENT PYTHONDONTWRITEBYTECODE=1)
endfunction()
