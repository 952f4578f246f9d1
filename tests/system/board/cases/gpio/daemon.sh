#!/bin/bash
# A GPIO chip that goes away while stereotrackd has outputs and inputs on it, and comes back: told once each way, no
# restart, and the lines are right again without anybody's doing.
# wants: bin/stereotrackd
# limit: 300
# shellcheck source=tests/system/board/guest/tap.sh
source /payload/.board/tap.sh
# shellcheck source=tests/system/board/guest/daemon.sh
source /payload/.board/daemon.sh

cat >/run/rig.toml <<END
[source]
name = "synthetic:eleven"
fps = 10.0
[synthetic]
frames = 90
width = 160
height = 120
[record]
on = true
seconds = 2.0
seconds_after = 0.1
on_deadline = false
directory = "/run/recordings"
[metrics]
file = "/run/results/figures.prom"
[[signal]]
name = "beat"
line = "rig:HEALTH"
when = "heartbeat"
period_ms = 600
[[signal]]
name = "near"
line = "rig:NEAR"
when = "confirmed"
[[signal]]
name = "missed"
line = "rig:ZONE"
when = "deadline_missed"
active = "low"
safe = "active"
[[input]]
name = "ready"
line = "rig:READY"
edge = "rising"
active = "high"
apart_ms = 0
END
mkdir /run/recordings
live=/sys/kernel/config/gpio-sim/rig

said() { journalctl -u stereotrackd -o cat | grep -cE "$1"; }
said_times() {
  local times
  times=$(said "$2")
  echo "said $times times, not $1: $2"
  [[ $times == "$1" ]]
}
unplug() { echo 0 >$live/live; }
# Its number may be another now.
plug_in() {
  echo 1 >$live/live && udevadm settle &&
    ln -sfn "/sys/devices/platform/$(cat $live/dev_name)/$(cat $live/bank0/chip_name)" /run/rig
}
shows() { [[ $(</run/rig/sim_gpio"$1"/value) == "$2" ]]; }
beats() { eventually shows 4 0 && eventually shows 4 1 && eventually shows 4 0; }
# An edge, and whether it is counted.
edge_counts() {
  local before
  before=$(figure "$edges") && echo pull-up >/run/rig/sim_gpio1/pull && sleep 0.05 &&
    echo pull-down >/run/rig/sim_gpio1/pull && eventually over "$edges" "$before"
}
edges='stereotrack_input_edges_total{input="ready",line="rig:READY"}'
there='stereotrack_input_there{input="ready",line="rig:READY"}'

fact "it starts with its lines" start
process=$(property MainPID)
fact "a target makes its line active" eventually shows 2 1
# Its safe state, and that of a chip anew, is the other level.
fact "no deadline is missed, which one that is active low shows" eventually shows 3 1
fact "the heartbeat beats" beats
fact "an edge is counted" edge_counts

for round in 1 2; do
  fact "the chip is taken away, time $round" unplug
  fact "outputs are told of" eventually said_times $round '^GPIO outputs rig:[A-Z]+, rig:[A-Z]+, rig:[A-Z]+ fail: '
  fact "inputs are told of" eventually said_times $round '^GPIO inputs rig:READY fail: '
  fact "the figures have it" eventually is "$there" 0
  frames=$(figure stereotrack_frames_total)
  # Longer than it waits between two attempts.
  sleep 10
  fact "frames go on meanwhile" over stereotrack_frames_total $((frames + 50))
  fact "and nothing is told twice" said_times $((2 * round)) '^GPIO .* fail: '
  fact "nor that it is back" said_times $((2 * (round - 1))) '^GPIO .* work again'
  fact "it is plugged in again" plug_in
  fact "outputs are back, told" eventually said_times $round '^GPIO outputs .* work again after [0-9.]+ s'
  fact "inputs are back, told" eventually said_times $round '^GPIO inputs rig:READY work again after [0-9.]+ s'
  fact "a target makes its line active again" eventually shows 2 1
  fact "that no deadline is missed is shown, too" eventually shows 3 1
  fact "the heartbeat beats again" beats
  fact "edges are counted again" edge_counts
  fact "the figures have that" eventually is "$there" 1
done
fact "the chip was lost twice for outputs" is 'stereotrack_gpio_chips_lost_total{lines="outputs"}' 2
fact "and for inputs" is 'stereotrack_gpio_chips_lost_total{lines="inputs"}' 2
fact "no real-time thread asked the heap for anything" no_heap_calls
fact "it is the process that was started" test "$(property MainPID)" = "$process"
fact "and was not restarted" test "$(property NRestarts)" = 0

fact "the chip is taken away for good" unplug
fact "that is told" eventually said_times 3 '^GPIO outputs .* fail: '
fact "the daemon ends all the same" systemctl stop stereotrackd
fact "without a failure" test -z "$(systemctl --failed --no-legend)"
journalctl -u stereotrackd -o cat | tell
finish
