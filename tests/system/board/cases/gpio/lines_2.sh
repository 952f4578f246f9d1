#!/bin/bash
# Our driver on real chips by libgpiod 2, the library of Debian 13: what lines.sh shows of libgpiod 1, by the same
# programs, and debouncing, which 1 has not.
# boards: debian12
# wants: tests/gpio_2_gpiod_test tests/gpio_2_board_test tests/gpio_2_lines_check tests/libgpiod.so.3
# shellcheck source=tests/system/board/guest/tap.sh
source /payload/.board/tap.sh

rig=/sys/kernel/config/gpio-sim/rig
linked() { ldd "$1" | grep "libgpiod.so.3 => /payload/"; }
lines_check() { ./gpio_2_lines_check "$@" | tee /run/results/lines.txt; return "${PIPESTATUS[0]}"; }

for program in gpio_2_gpiod_test gpio_2_board_test gpio_2_lines_check; do
  fact "$program has libgpiod 2" linked ./$program
done
gtest gpio_2_gpiod_test
fact "edges of a line that drives another come once each, in order, also of a chip that comes back" \
  lines_check rig 5 6 /sys/devices/platform/gpio-sim.0 $rig
tell </run/results/lines.txt
# The chip came back, maybe by another number.
ln -sfn "/sys/devices/platform/$(cat $rig/dev_name)/$(cat $rig/bank0/chip_name)" /run/rig
gtest gpio_2_board_test
finish
