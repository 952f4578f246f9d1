#!/bin/bash
# The clock of the day is set an hour forward, then back by two: outputs leave as if nothing had been, since nothing in
# them is counted by it; what telemetry says of TAI follows.
# wants: packages/stereotrack packages/stereotrack-tools tests/keep_telemetry
# limit: 300
# shellcheck source=tests/system/board/guest/tap.sh
source /payload/.board/tap.sh
# shellcheck source=tests/system/board/guest/rig.sh
source /payload/.board/rig.sh

fact "the packages are installed" install_rig
configure_scene 5.0 160x120 150.0 <<END
[telemetry]
destinations = ["127.0.0.1:5701"]
[record]
on = true
seconds = 2.0
seconds_after = 0.2
on_deadline = false
END
set_clock() { date -s "@$(($(date +%s) + $1))"; }
# Of TAI against the capture clock, in hours of the first: "0 1 -1".
hours() { /payload/keep_telemetry offsets /run/heard.bin | awk 'NR == 1 { first = $1 } { print int(($1 - first) / 3600 + 100.5) - 100 }' | uniq; }
followed() {
  hours | tee /run/hours.txt
  [[ $(tr '\n' ' ' </run/hours.txt) == "0 1 -1 " ]]
}

fact "somebody listens" listen
fact "the service is ready" begin
process=$(property MainPID)
fact "it runs" runs 20
fact "the clock is set an hour forward" set_clock 3600
fact "pairs go on" rises stereotrack_frames_total 15
fact "the clock is set two hours back" set_clock -7200
fact "pairs go on after that, too" rises stereotrack_frames_total 15
fact "what is asked for is recorded" ask_for_a_recording
fact "at once" eventually is 'stereotrack_recordings_total{fate="written"}' 1
fact "all left, with their own results" all_left
fact "no step of the capture clock was seen" is stereotrack_clock_steps_total 0
fact "it is the process that was started" test "$(property MainPID)" = "$process"
fact "and was not restarted" restarted 0
grep -E '^stereotrack_(outputs|deadline|clock_steps|sent_late)' "$figures" | tell
fact "what was heard is kept" heard
tell </run/sessions.txt
fact "it is one session, without a gap" sessions_are 1
fact "what telemetry says of TAI followed the clock" followed
fact "the recording replays" sh -c "stereotrack replay $recordings/*.strec --out /run/replayed"
fact "the service ends" end
journalctl -u stereotrackd -o short-monotonic | tell
finish
