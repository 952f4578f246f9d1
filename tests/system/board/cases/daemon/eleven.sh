#!/bin/bash
# synthetic:eleven seen by two cameras of the kernel's, in step: what the daemon sends live is what a replay of its
# recording gives, to the byte, and its targets are those of a replay of the same pictures as files.
#
# What makes that exact. v4l2loopback promises no clock, so the driver stamps frames as it takes them, and no two runs
# have the same stamps. The filter's dt follows from them. So the pictures are filed under the times that the recording
# has of them (stamp_pictures), and nothing else of the recording goes into that replay: pixels come from the files that
# were drawn, and both replays have to have seen the same. The pairer spends the first two pairs on learning the
# sequences, the files begin with the third.
#
# A processor of the emulator is slow, and of its two one runs at a time: who is woken may wait for a tick of the kernel
# (4 ms), so what leaves within 20 ms is not late here. That nothing was lost, shed or late is a fact before all others.
# wants: bin/stereotrackd bin/stereotrack tests/play_loopback tests/keep_telemetry tests/stamp_pictures
# limit: 2000
# shellcheck source=tests/system/board/guest/tap.sh
source /payload/.board/tap.sh
# shellcheck source=tests/system/board/guest/daemon.sh
source /payload/.board/daemon.sh

pairs=60
cat >/run/rig.toml <<END
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
file = "/run/scene/calibration.yml"
[latency]
output_ms = 150.0
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
directory = "/run/recordings"
[metrics]
file = "/run/results/figures.prom"
END
mkdir /run/recordings
mkfifo /run/go

replay() { /payload/stereotrack replay "$@"; }
compared() {
  ./keep_telemetry compare /run/live.bin /run/replayed/telemetry.bin >/run/compared.txt && return
  cat /run/compared.txt
  return 1
}
are_many() { awk -v least=$((pairs - 2)) '{ exit !($2 >= least && $4 >= least / 2) }' /run/compared.txt; }
value_of() { sed -n "s/.*\"$1\": *\"\\(.*\\)\".*/\\1/p" "$2/summary.json"; }
same() { [[ $(sha256sum <"$1") == $(sha256sum <"$2") ]]; }
same_pixels() {
  local live files
  live=$(value_of pixels_blake2b /run/replayed)
  files=$(value_of pixels_blake2b /run/filed)
  echo "$live $files"
  [[ -n $live && $live == "$files" ]]
}

fact "the scene is drawn" /payload/stereotrack synth eleven --out /run/scene --frames $pairs --size 320x240
exec 4<>/run/go
./play_loopback /run/scene /dev/video2 /dev/video3 10 </run/go >/run/results/played.txt 2>&1 &
fact "both loopbacks are ready to be read" eventually grep -q ready /run/results/played.txt
./keep_telemetry listen 127.0.0.1:5701 /run/live.bin >/run/results/kept.txt 2>&1 &
listener=$!
fact "somebody listens" eventually grep -q listening /run/results/kept.txt
fact "the daemon has both cameras" start
echo go >&4
# Asking would keep a processor busy.
sleep $((pairs / 10 + 2))
fact "all pairs are played" eventually grep "^played $pairs pairs" /run/results/played.txt
fact "all but the two that the pairer learns from were pairs" \
  eventually is 'stereotrack_pairing_total{verdict="paired"}' $((pairs - 2))
fact "and went through the pipeline" eventually is stereotrack_frames_total $((pairs - 2))
fact "none was lost on the way" none 'stereotrack_camera_frames_total{camera="left",fate="lost"}' \
  'stereotrack_camera_frames_total{camera="right",fate="lost"}' 'stereotrack_pairing_total{verdict="missing_left"}' \
  'stereotrack_pairing_total{verdict="missing_right"}' 'stereotrack_pairing_total{verdict="late"}'
fact "none was evicted, skipped or starved" none 'stereotrack_pairs_total{fate="evicted"}' \
  'stereotrack_pairs_total{fate="skipped"}' 'stereotrack_pairs_total{fate="starved"}' stereotrack_notices_lost_total
fact "nothing was shed" none stereotrack_efforts_shed_total
fact "each left with its own result" eventually is 'stereotrack_outputs_total{cause="on_time"}' $((pairs - 2))
fact "nothing was late" none 'stereotrack_outputs_total{cause="predicted_late"}' \
  'stereotrack_outputs_total{cause="late_results"}' 'stereotrack_outputs_total{cause="stale_results"}' \
  'stereotrack_outputs_total{cause="late_notices"}' stereotrack_sent_late_total
grep -E '^stereotrack_(outputs|pairing|pairs|compute|camera_frames|efforts|effort_overruns|sent_late)' \
  /run/results/figures.prom | tell

fact "it is asked to record" systemctl kill --signal=USR1 stereotrackd
fact "there is a recording" eventually is 'stereotrack_recordings_total{fate="written"}' 1
kill -TERM "$listener"
fact "what was heard is kept" eventually test -e /run/live.bin
fact "the daemon ends" systemctl stop stereotrackd
recording=$(echo /run/recordings/*.strec)

fact "the recording replays" replay "$recording" --out /run/replayed
fact "each message that it gives was sent live, byte for byte" compared
fact "they are those of all pairs, and most have targets" are_many
tell </run/compared.txt

fact "the recording has all pairs from the third on" \
  sh -c "./stamp_pictures $recording /run/scene /run/stamped | tee /run/stamped.txt | grep -x 'first 3 last $pairs'"
fact "the files replay" \
  replay /run/stamped --config /run/rig.toml --calibration /run/scene/calibration.yml --frames 3:$pairs --out /run/filed
fact "with the pixels that the cameras gave" same_pixels
fact "and the same targets" same /run/replayed/tracks.csv /run/filed/tracks.csv
fact "which are many" test "$(wc -l </run/filed/tracks.csv)" -gt $((pairs / 2))
journalctl -u stereotrackd -o cat | tell
finish
