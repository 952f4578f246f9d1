#!/bin/bash
# The trigger's pulses and edges on real lines, before the kernel's test cameras.
# wants: tests/trigger_board_test
# limit: 120
# shellcheck source=tests/system/board/guest/tap.sh
source /payload/.board/tap.sh

gtest trigger_board_test
finish
