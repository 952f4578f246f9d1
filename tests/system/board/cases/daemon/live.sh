#!/bin/bash
# The daemon under systemd: what it promises its service manager, its lines and those who listen.
# wants: bin/stereotrackd bin/stereotrack
# limit: 240
# shellcheck source=tests/system/board/guest/tap.sh
source /payload/.board/tap.sh
# shellcheck source=tests/system/board/guest/daemon.sh
source /payload/.board/daemon.sh

cat >/run/rig.toml <<END
[source]
name = "synthetic:eleven"
fps = 10.0
[synthetic]
frames = 24
width = 160
height = 120
[telemetry]
destinations = ["127.0.0.1:5701"]
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
safe = "active"
END

begin() {
  start --property=WatchdogSec=20 --property=ExecStopPost="/payload/stereotrackd --config /run/rig.toml --safe-lines"
}
# What gpio-sim's line 4 showed, one character a look.
watch_beat() {
  local seen='' look value
  for ((look = 0; look < 60; look++)); do
    read -r value </run/rig/sim_gpio4/value
    seen+=$value
    sleep 0.05
  done
  echo "$seen"
  [[ $seen == *01*01* ]]
}
has_priority() { ps -T -p "$(property MainPID)" -o comm=,cls=,rtprio= | tee /run/results/threads.txt | grep -qE "^$1 +FF +$2\$"; }
# 24 frames to and fro are 4.6 s, and the tool takes seconds to load.
telemetry_tells_targets() {
  timeout -s TERM 12 /payload/stereotrack monitor --listen 127.0.0.1:5701 --json >/run/results/monitor.json
  grep -q '"sequence":.*"targets":\[{' /run/results/monitor.json
}

fact "systemd hears that it is ready" begin
fact "it tells its state" eventually sh -c "systemctl show stereotrackd -p StatusText --value | grep pairs"
fact "pairs leave on time" eventually over 'stereotrack_outputs_total{cause="on_time"}' 5
fact "the publisher has its real-time priority" has_priority st-publisher 82
fact "the capture thread has its" has_priority st-capture 81
fact "the frame loop has its" has_priority st-frames 80
fact "the heartbeat is seen on the line" watch_beat
fact "stereotrack monitor hears of targets" telemetry_tells_targets
fact "no real-time thread asked the heap for anything" no_heap_calls
fact "systemd holds the watchdog for fed" test "$(property ActiveState)" = active
grep -E '^stereotrack_(outputs_total|deadline|send_error|compute)' /run/results/figures.prom | tell

fact "it ends when systemd asks it to" systemctl stop stereotrackd
fact "its journal says so" eventually sh -c "journalctl -u stereotrackd | grep 'Terminated: ending'"
fact "and systemd calls that success" test -z "$(systemctl --failed --no-legend)"

fact "it starts anew" begin
fact "it runs again" eventually over stereotrack_frames_total 0
systemctl kill --signal=KILL stereotrackd
fact "killed, it is seen to have failed" eventually sh -c "systemctl show stereotrackd -p Result | grep -x Result=signal"
fact "and its lines are driven to their safe states" \
  eventually sh -c "journalctl -u stereotrackd | grep -E 'rig:NEAR.*active'"
journalctl -u stereotrackd -o cat | tail -n 8 | tell
finish
