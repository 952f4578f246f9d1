#!/bin/bash
# Lines of gpio-sim by means of gpiod's tools, then our driver on real chips.
# wants: tests/gpio_test tests/gpio_board_test tests/gpio_lines_check
# shellcheck source=tests/system/board/guest/tap.sh
source /payload/.board/tap.sh

rig=/sys/kernel/config/gpio-sim/rig
chip=$(basename "$(readlink /run/rig)")
# gpiod's tools of Debian 12 and 13 take other arguments.
if command -v gpiofind >/dev/null; then
  set_trigger() { exec gpioset --mode=signal "$chip" 0=1; }
  monitor_ready() { exec gpiomon --num-events=4 --format='%e %s.%n' "$chip" 1; }
  edges="1010"
else
  set_trigger() { exec gpioset --chip "$chip" TRIGGER=1; }
  monitor_ready() { exec gpiomon --chip "$chip" --num-events=4 --format='%e %S' READY; }
  edges="1212"
fi
value_while_set() {
  set_trigger &
  eventually grep -qx 1 /run/rig/sim_gpio0/value
  local code=$?
  kill $!
  return "$code"
}
four_edges() {
  monitor_ready >/run/results/edges.txt &
  local monitor=$! level
  eventually sh -c "gpioinfo | grep -qE 'READY.*(used|consumer)'"
  # irq_sim tells what came since it last looked: edges without a pause between them are one.
  for level in up down up down; do
    echo "pull-$level" >/run/rig/sim_gpio1/pull
    sleep 0.02
  done
  wait "$monitor"
  cat /run/results/edges.txt
  [[ $(cut -d ' ' -f 1 /run/results/edges.txt | tr -d '\n') == "$edges" ]]
}

fact "what is driven is read in sysfs" value_while_set
fact "edges arrive in their order" four_edges
# Two threads that spin against each other take turns here, which costs minutes and shows nothing of a chip.
gtest gpio_test --gtest_filter=-OutputLines.AChipGoesAndComesWhileItIsDriven
fact "edges of a line that drives another come once each, in order, also of a chip that comes back" \
  ./gpio_lines_check rig 5 6 /sys/devices/platform/gpio-sim.0 $rig
# The chip came back, maybe by another number.
ln -sfn "/sys/devices/platform/$(cat $rig/dev_name)/$(cat $rig/bank0/chip_name)" /run/rig
gtest gpio_board_test
finish
