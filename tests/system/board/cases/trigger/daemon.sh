#!/bin/bash
# The trigger on real lines: pulses of ours read back at the pin, edges of somebody else's, what is not there. The
# kernel's cameras run free, so whether their frames answer a pulse is chance: what is asserted holds either way.
# wants: bin/stereotrackd
# limit: 300
# shellcheck source=tests/system/board/guest/tap.sh
source /payload/.board/tap.sh
# shellcheck source=tests/system/board/guest/daemon.sh
source /payload/.board/daemon.sh

configure() {
  vivid_rig bus:platform:vivid-000 bus:platform:vivid-001 "[trigger]
$1"
}
check_says() {
  local said
  said=$(check 2>&1)
  echo "$said"
  grep -qF -- "$1" <<<"$said"
}
given='stereotrack_trigger_train_total{fate="given"}'
paired='stereotrack_pairing_total{verdict="paired"}'
pin=/run/rig/sim_gpio0/value
at_pin() { [[ $(<"$pin") == "$1" ]]; }

# For so many seconds: times that the pin rose, as polled; pulses and what lies between them are 50 ms long.
count_rises() {
  local last=1 now rises=0 end=$((SECONDS + $1))
  while ((SECONDS < end)); do
    now=$(<"$pin")
    ((now > last)) && rises=$((rises + 1))
    last=$now
  done
  echo "$rises"
}
# About ten a second, as many as were given in that time: the figures are a second old at most.
train_is_at_the_pin() {
  local before after rises
  before=$(figure "$given")
  rises=$(count_rises 5)
  sleep 1.5
  after=$(figure "$given")
  echo "$rises rises in 5 s; given before $before, after $after"
  ((rises >= 40 && rises <= 61 && after - before >= rises - 1 && after - before <= rises + 40))
}
# So many pulses of somebody else's.
drive() {
  local n
  for ((n = 0; n < $1; n++)); do
    echo pull-up >/run/rig/sim_gpio1/pull
    sleep 0.04
    echo pull-down >/run/rig/sim_gpio1/pull
    sleep 0.05
  done
}
all_are_told() {
  local before
  before=$(figure stereotrack_trigger_pulses_total)
  drive 30
  eventually over stereotrack_trigger_pulses_total $((before + 29))
}
is_silent() { [[ $(figure stereotrack_trigger_silent) == 1 ]]; }


configure 'mode = "gpio"
line = "rig:TRIGGER"
pulse_us = 50000.0
late_us = 20000.0'
fact "it is said what the trigger will do" check_says "trigger: gpio rig:TRIGGER, active high: 10.0 pulses/s of 50000 us"
fact "it starts with a pulse train" start --collect
fact "pulses are given" eventually over "$given" 5
fact "and are at the pin, each once" train_is_at_the_pin
fact "the line is the daemon's" sh -c "gpioinfo | grep -q 'TRIGGER.*stereotrackd-trigger'"
fact "pairs come" rises "$paired"
fact "the trigger thread asked the heap for nothing" \
  is 'stereotrack_allocations_total{thread="trigger"}' 0
fact "none was refused by the line" is 'stereotrack_trigger_train_total{fate="failed"}' 0
grep -E '^stereotrack_(trigger|camera_exposures|pairing)' /run/results/figures.prom | tell
fact "it ends when it is asked to" systemctl stop stereotrackd
fact "the line is inactive then" at_pin 0

sed -i 's/^line = /active = "low"\nline = /' /run/rig.toml
fact "it starts with pulses that are active low" start --collect
fact "which are given" eventually over "$given" 5
fact "it is killed" systemctl kill -s KILL stereotrackd
fact "and is gone" eventually sh -c '! systemctl is-active stereotrackd'
safe_lines() { /payload/stereotrackd --config /run/rig.toml --safe-lines 2>&1 | grep -F "driven inactive, its safe state (high)"; }
fact "its line is made safe" safe_lines

configure 'mode = "external"
line = "rig:READY"'
fact "it is said whose pulses are expected" \
  check_says "trigger: external rig:READY, active high: 10.0 pulses/s expected; exposures begin 0 us after the rising edge"
fact "it starts with somebody else's pulses" start --collect
fact "without one, pairs come all the same" eventually over "$paired" 5
fact "each edge is told" all_are_told
fact "when they stop that is told" eventually says 'trigger: frames come, and no pulse was told for'
fact "and shows" eventually is_silent
fact "pairs go on" rises "$paired"
fact "edges come again" all_are_told
fact "which is told, too" eventually says 'trigger: pulses are told again'
fact "the capture thread asked the heap for nothing" \
  is 'stereotrack_allocations_total{thread="capture"}' 0
grep -E '^stereotrack_(trigger|camera_exposures|pairing)' /run/results/figures.prom | tell
journalctl -u stereotrackd -o cat | tell
fact "it ends when it is asked to" systemctl stop stereotrackd

configure 'mode = "pwm"
pwm_chip = "pwmchip7"'
fact "hardware PWM that this board has not got is a line" check_says "PWM pwmchip7: no such chip in /sys/class/pwm"
fact "nothing has failed" test -z "$(systemctl --failed --no-legend)"
finish
