#!/bin/bash
# Exposure, gain, black level and blank rows by the kernel's own control framework: set, clamped, read back, the same on both
# sensors, in force from the right frame on, and two cameras held together by them.
# wants: tests/v4l2_board_test
# limit: 420
# shellcheck source=tests/system/board/guest/tap.sh
source /payload/.board/tap.sh
gtest v4l2_board_test "--gtest_filter=Controls.*"
grep "^# " /run/results/v4l2_board_test.log
finish
