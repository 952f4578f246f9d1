#!/bin/bash
# A frame loop that hangs, and a process that does: the watchdog ends them, the lines are safe before, and the next process
# tracks. The loop is held by its tracer, so that all other threads go on.
# wants: packages/stereotrack packages/stereotrack-tools tests/hold_thread
# limit: 300
# shellcheck source=tests/system/board/guest/tap.sh
source /payload/.board/tap.sh
# shellcheck source=tests/system/board/guest/rig.sh
source /payload/.board/rig.sh

fact "the packages are installed" install_rig
configure_scene 5.0 160x120 150.0 <<END
[telemetry]
destinations = ["127.0.0.1:5701"]
[[signal]]
name = "there"
line = "rig:NEAR"
when = "confirmed"
[[signal]]
name = "beat"
line = "rig:HEALTH"
when = "heartbeat"
period_ms = 600
END
hold() {
  /payload/hold_thread "$(property MainPID)" "$1" >/run/results/held.txt 2>&1 &
  eventually grep held /run/results/held.txt
}
watchdog_us() { property WatchdogUSec; }

fact "the service is ready" begin
echo "the watchdog waits for $(watchdog_us)" | tell
fact "it has a watchdog" test "$(watchdog_us)" != infinity
fact "a target makes its line active" eventually shows 2 1
fact "pairs leave on time" eventually over 'stereotrack_outputs_total{cause="on_time"}' 10
fact "its frame loop hangs" hold st-frames
held=$SECONDS
fact "nothing is known any more: the line is in its safe state" eventually shows 2 0
fact "long before the watchdog bites" restarted 0
fact "the process still sends" rises 'stereotrack_telemetry_total{fate="sent"}'
fact "systemd ends it" eventually says 'Watchdog timeout'
echo "after $((SECONDS - held)) s" | tell
fact "its last act is to make the lines safe" eventually says 'fault, signal 6: lines are in their safe states'
fact "it is restarted" eventually restarted 1
fact "ready" eventually is_ready
fact "and tracks" runs 10
fact "the line tells of targets again" eventually shows 2 1

process=$(property MainPID)
fact "the whole process is stopped" kill -STOP "$process"
fact "systemd ends that, too" eventually restarted 2
fact "another one is ready" eventually is_ready
fact "which tracks" runs 10
fact "the line tells of targets" eventually shows 2 1
fact "the service ends" end
journal
finish
