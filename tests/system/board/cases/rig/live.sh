#!/bin/bash
# The installed service watches a scene that two loopback cameras play, ten pairs a second of 320x240: nothing is shed or
# late, its datagrams are those of a replay of its own recording, and its lines rise and fall with the targets, at t + L.
# Why that can be exact: cases/daemon/eleven.sh.
# wants: packages/stereotrack packages/stereotrack-tools tests/play_loopback tests/keep_telemetry tests/line_times
# limit: 2000
# shellcheck source=tests/system/board/guest/tap.sh
source /payload/.board/tap.sh
# shellcheck source=tests/system/board/guest/rig.sh
source /payload/.board/rig.sh

pairs=60
latency_ms=150
near_m=8.45
mkfifo /run/go
# What was sent, byte for byte.
compared() {
  /payload/keep_telemetry compare /run/heard.bin /run/replayed/telemetry.bin >/run/compared.txt && return
  cat /run/compared.txt
  return 1
}
are_many() { awk -v least=$((pairs - 2)) '{ exit !($2 >= least && $4 >= least / 2) }' /run/compared.txt; }
# INDEX LIMIT: of the lines that are watched.
at_their_time() {
  /payload/line_times compare /run/heard.bin /run/changes.txt "$1" $latency_ms 20 "$2" >"/run/line$1.txt" && return
  cat "/run/line$1.txt"
  return 1
}

fact "the packages are installed" install_rig
fact "the scene is drawn" draw_scene $pairs 320x240
configure <<END
[source]
name = "cameras"
[camera]
left.device = "/dev/video2"
right.device = "/dev/video3"
width = 320
height = 240
format = "bgr8"
fps = 10.0
timeout_ms = 60000
readout_us = 1000
[calibration]
file = "/etc/stereotrack/calibration.yml"
unit_m = 1.0
[latency]
output_ms = $latency_ms.0
late_ms = 20.0
grace_ms = 20.0
[telemetry]
destinations = ["127.0.0.1:5701"]
[record]
on = true
# All of the run, from the state before its first pair on.
seconds = 24.0
seconds_after = 0.2
on_deadline = false
[[signal]]
name = "there"
line = "rig:NEAR"
when = "confirmed"
hold_ms = 0
[[signal]]
name = "near"
line = "rig:ZONE"
when = "distance_below"
limit_m = $near_m
hold_ms = 0
END
exec 4<>/run/go
/payload/play_loopback /run/scene /dev/video2 /dev/video3 10 </run/go >/run/results/played.txt 2>&1 &
fact "both cameras are ready to be read" eventually grep -q ready /run/results/played.txt
fact "somebody listens" listen
fact "somebody looks at the lines" watch_lines 2 3
fact "the service is ready" begin
echo "READY after $(ready_after_us) us" | tell
echo go >&4
# Asking would keep a processor busy.
sleep $((pairs / 10 + 2))
fact "all pairs are played" eventually grep "^played $pairs pairs" /run/results/played.txt
fact "all but the two that the pairer learns from went through the pipeline" \
  eventually is stereotrack_frames_total $((pairs - 2))
fact "each left with its own result" eventually is 'stereotrack_outputs_total{cause="on_time"}' $((pairs - 2))
fact "nothing was late" none 'stereotrack_outputs_total{cause="predicted_late"}' \
  'stereotrack_outputs_total{cause="late_results"}' 'stereotrack_outputs_total{cause="stale_results"}' \
  'stereotrack_outputs_total{cause="late_notices"}' stereotrack_sent_late_total
fact "nothing was shed" none stereotrack_efforts_shed_total
fact "nothing was lost" none 'stereotrack_pairs_total{fate="evicted"}' 'stereotrack_pairs_total{fate="skipped"}' \
  'stereotrack_pairs_total{fate="starved"}' 'stereotrack_pairing_total{verdict="missing_left"}' \
  'stereotrack_pairing_total{verdict="missing_right"}' 'stereotrack_pairing_total{verdict="late"}'
fact "it is asked to record" ask_for_a_recording
fact "there is a recording" eventually is 'stereotrack_recordings_total{fate="written"}' 1
fact "without pairs the lines are in their safe states" eventually shows 2 0
fact "both of them" eventually shows 3 0
fact "what was heard is kept" heard
fact "and what was seen of the lines" watched
fact "no real-time thread asked the heap for anything" no_heap_calls
fact "the service ends" end

fact "the recording replays" sh -c "stereotrack replay $recordings/*.strec --out /run/replayed"
fact "each message that it gives was sent, byte for byte" compared
fact "they are those of all pairs, and most have targets" are_many
tell </run/compared.txt
fact "the line rose and fell with the targets, each time when the message was due" at_their_time 0 0
tell </run/line0.txt
fact "so did that of what is nearer than $near_m m" at_their_time 1 $near_m
tell </run/line1.txt
fact "and not at the same times" test "$(awk '$2 == 0' /run/changes.txt | cut -c 1-6)" != "$(awk '$2 == 1' /run/changes.txt | cut -c 1-6)"
journal
finish
