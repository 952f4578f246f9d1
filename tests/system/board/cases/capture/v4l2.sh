#!/bin/bash
# Our camera driver on the board's vivid and vimc cameras: formats, stamps, controls, and every fault they can feign.
# wants: tests/v4l2_board_test
# limit: 420
# shellcheck source=tests/system/board/guest/tap.sh
source /payload/.board/tap.sh
gtest v4l2_board_test
finish
