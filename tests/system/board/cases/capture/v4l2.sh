#!/bin/bash
# Our camera driver on the board's vivid and vimc cameras: formats, stamps, controls, and every fault they can feign.
# wants: tests/v4l2_board_test
# limit: 420
# shellcheck source=tests/system/board/guest/tap.sh
source /payload/.board/tap.sh
# Debian 13's v4l2loopback promises the monotonic clock; Debian 12's kernel has no udmabuf.
without=Pictures.MemoryOfTheProcesssOwnIsWrittenIntoByTheDriver
if [[ $(uname -r) != 6.1.* ]]; then without=Frames.OfADriverThatPromisesNoClockAreStampedAsTheyAreTaken; fi
gtest v4l2_board_test "--gtest_filter=-Controls.*:$without"
finish
