#!/bin/bash
# Unit tests that ask the kernel for something, on the kernel and CPU of the board: rights of threads and memory, futexes
# between threads, sockets, the heap of real-time loops.
# wants: tests/runtime_test tests/test_frame_pool tests/telemetry_test tests/rt_heart_test tests/rt_lines_test
# brings: tests/unit/telemetry/datagrams_v1.hex tests/unit/telemetry/datagrams_live_v1.hex
# limit: 600
# shellcheck source=tests/system/board/guest/tap.sh
source /payload/.board/tap.sh

gtest runtime_test
gtest test_frame_pool
gtest telemetry_test
gtest rt_heart_test
gtest rt_lines_test
finish
