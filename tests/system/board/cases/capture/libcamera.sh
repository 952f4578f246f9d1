#!/bin/bash
# Our libcamera driver and its module on the board's two vimc cameras.
# wants: tests/libcamera_board_test
# wants on debian12: lib/stereotrack/stereotrack-libcamera-0.0.3.so
# wants on debian13: lib/stereotrack/stereotrack-libcamera-0.4.so
# limit: 300
# shellcheck source=tests/system/board/guest/tap.sh
source /payload/.board/tap.sh
export STEREOTRACK_MODULE_PATH=/payload
gtest libcamera_board_test
grep '^# ' /run/results/libcamera_board_test.log
finish
