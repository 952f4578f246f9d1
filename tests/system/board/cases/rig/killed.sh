#!/bin/bash
# kill -9: the service is restarted, receivers can tell, and the lines are safe: how soon is measured at lines whose pull
# is to the unsafe side, the worst that a chip can do when nobody holds them.
# wants: packages/stereotrack packages/stereotrack-tools tests/keep_telemetry tests/line_times
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
name = "missed"
line = "rig:ZONE"
when = "deadline_missed"
active = "low"
safe = "active"
[[signal]]
name = "beat"
line = "rig:HEALTH"
when = "heartbeat"
period_ms = 600
END
# By the clock of the lines [ms]: from the kill to when line NUMBER of those watched was seen to become safe: low, all of
# them. What --safe-lines does to a line that follows its pull at once again is too short to be seen.
held_after_ms() {
  awk -v line="$1" -v killed="$killed" '
    $2 == line && $1 >= killed + 1e9 && $3 == 0 { printf "%.1f\n", ($1 - killed) / 1e6; exit }' /run/changes.txt
}
# From the kill to when --safe-lines told that it had driven LINE [ms], by the journal's clock, which is the same.
driven_after_ms() {
  journalctl -u stereotrackd -o short-monotonic | awk -v killed="$killed" -v line="$1" '
    index($0, line ": driven ") { gsub(/[][]/, ""); ms = $1 * 1e3 - killed / 1e6; if (ms > 0) { print ms; exit } }'
}
within() { awk -v is="$1" -v most="$2" 'BEGIN { print is " ms, at most " most; exit !(is != "" && is <= most) }'; }

for line in 2 3 4; do pull $line up; done
fact "somebody listens" listen
fact "the service is ready" begin
echo "READY after $(ready_after_us) us" | tell
fact "a target makes its line active" eventually shows 2 1
fact "pairs leave on time" eventually over 'stereotrack_outputs_total{cause="on_time"}' 10
fact "that no deadline is missed is shown" shows 3 1
fact "somebody looks at the lines" watch_lines 2 3 4
sleep 1
killed=$(/payload/line_times kill "$(property MainPID)")
fact "killed, it is restarted" eventually restarted 1
fact "ready" eventually is_ready
fact "and tracks" runs 3
fact "what was seen of the lines is kept" watched
# Kept here: lines of a chip whose lines keep their level stay so. Else it is the next process that holds them.
for line in rig:NEAR rig:ZONE rig:HEALTH; do
  after=$(driven_after_ms $line)
  echo "$line: driven to its safe state $after ms after the kill" | tell
  fact "$line was driven to its safe state soon after the kill" within "$after" 1500
done
# Held by the next process: the unit's pause, and what that needs before it takes its lines.
for line in 0 1 2; do
  after=$(held_after_ms $line)
  echo "line $line of these: held in its safe state by the next process $after ms after the kill" | tell
  fact "line $line of these was held safe by the next process, before that drew its scene" within "$after" 6000
done
tail -n 60 /run/changes.txt | tell
fact "what was heard is kept" heard
tell </run/sessions.txt
fact "receivers see two sessions, the second the next, each without a gap" sessions_are 2
fact "the service ends" end
journal
finish
