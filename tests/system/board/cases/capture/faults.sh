#!/bin/bash
# stereotrackd and the errors that vivid has on demand, one after the other on one run: what each leads to, that each is
# counted where it belongs, and that pairs come again. Then runs that begin amid trouble.
# wants: bin/stereotrackd
# limit: 900
# shellcheck source=tests/system/board/guest/tap.sh
source /payload/.board/tap.sh
# shellcheck source=tests/system/board/guest/daemon.sh
source /payload/.board/daemon.sh

set_control() { v4l2-ctl -d "$1" -c "$2"; }
of() { echo "stereotrack_camera_$1{camera=\"$2\"${3:+,fate=\"$3\"}}"; }
paired='stereotrack_pairing_total{verdict="paired"}'
missing_left='stereotrack_pairing_total{verdict="missing_left"}'
missing_right='stereotrack_pairing_total{verdict="missing_right"}'

# ---- Cameras that are not there when the daemon starts: none, then the left one, then the right one.
unit=none
vivid_rig /run/left /run/right
# shellcheck disable=SC2119  # no options
refused() { ! start 2>/dev/null; }
fact "without any camera it does not start" refused
fact "and names the first, and those there are" says 'camera /run/left: is not there: plug it in.*there is /dev/video0'
systemctl reset-failed

vivid_rig /run/left /dev/video1
unit=early
fact "it starts without the left camera" start
fact "and tells of it, and what that means" eventually says '/run/left.*no pair comes until the left camera does: tries again'
fact "it was asked for again in vain, the left one" eventually over "$(of open_failures_total left)" 1
fact "and nothing is tracked" is stereotrack_frames_total 0
fact "the left one is plugged in" ln -s /dev/video0 /run/left
fact "it is found, and told, the left one" eventually says 'left camera: is back'
fact "and pairs come of both" rises "$paired" 5
fact "the daemon that waited ends" stop

vivid_rig /dev/video0 /run/right
unit=late
fact "it starts without the right camera" start
fact "and tells of it, with the way on" eventually says '/run/right.*goes on with the left camera alone, in mono, and tries again'
fact "left pictures go on alone" eventually over stereotrack_mono_pairs_total 5
fact "no pair is made of them" is "$paired" 0
fact "it was asked for again, in vain" eventually over "$(of open_failures_total right)" 1
fact "it is plugged in" ln -s /dev/video1 /run/right
fact "it is found, and told" eventually says 'right camera: is back'
fact "and pairs come" rises "$paired" 5
fact "the daemon ends" stop

# ---- Errors while it runs.
vivid_rig /dev/video0 /dev/video1
unit=faults
fact "it starts on both" start
fact "pairs come" eventually over "$paired" 5

fact "a frame with an error" set_control /dev/video1 inject_v4l2_buf_flag_error=1
fact "is counted as damaged" eventually is "$(of frames_total right damaged)" 1
fact "its partner goes without one" eventually over "$missing_right" 0
fact "the camera is kept" is "$(of losses_total right)" 0
fact "and pairs go on" rises "$paired" 5

fact "a buffer that is refused" set_control /dev/video0 inject_vidioc_qbuf_error=1
fact "is no loss" rises "$paired" 20
fact "of no camera" is "$(of losses_total left)" 0

lost=$(figure "$(of frames_total left lost)")
fact "the left camera drops a third of its frames" set_control /dev/video0 percentage_of_dropped_buffers=33
fact "they are counted as lost" eventually over "$(of frames_total left lost)" $((lost + 10))
fact "their partners go without them" eventually over "$missing_left" 10
fact "the others are pairs" rises "$paired" 10
fact "the camera is kept though it drops" is "$(of losses_total left)" 0
fact "it drops no more" set_control /dev/video0 percentage_of_dropped_buffers=0
fact "all are pairs again" rises "$paired" 20

fact "the right driver stalls" set_control /dev/video1 percentage_of_dropped_buffers=100
fact "that is told as silence" eventually says 'right camera: .*no frame for .*goes on in mono'
fact "left pictures go on" rises stereotrack_mono_pairs_total 5
fact "it wakes up" set_control /dev/video1 percentage_of_dropped_buffers=0
fact "that is told" eventually says 'right camera: is back'
fact "pairs come again" rises "$paired" 5

fact "the left driver stalls" set_control /dev/video0 percentage_of_dropped_buffers=100
fact "that is told as well" eventually says 'left camera: .*no frame for '
fact "its outputs are missing" rises 'stereotrack_outputs_total{cause="missing"}' 2
fact "it wakes up, too" set_control /dev/video0 percentage_of_dropped_buffers=0
fact "pairs come once more" rises "$paired" 5

# What an opening meets: the first try fails, with the driver's own error; a later one does not. Both controls at once:
# the stream that still runs would take the refusal of a buffer for itself.
declare -A refusals=([streamon]="does not start to stream" [reqbufs]="gives no 8 buffers" [qbuf]="does not take its buffers")
for call in streamon reqbufs qbuf; do
  failures=$(figure "$(of open_failures_total right)")
  fact "the right camera is disconnected, and its next $call is to fail" \
    set_control /dev/video1 inject_vidioc_${call}_error=1,disconnect=1
  fact "that is told, with the reason" \
    eventually says "right camera: camera /dev/video1: ${refusals[$call]} .*errno 22.*; tries again"
  fact "and counted" eventually over "$(of open_failures_total right)" "$failures"
  fact "another try has it back" eventually is "$(of silent right)" 0
  fact "pairs come after $call failed" rises "$paired" 5
done
grep -E '^stereotrack_(camera|pairing|mono|outputs)' /run/results/figures.prom | tell
fact "the capture thread asked the heap for nothing" is 'stereotrack_allocations_total{thread="capture"}' 0
fact "it was one process" test "$(property NRestarts)" = 0
fact "the daemon ends after all that" stop

# ---- Counts and stamps that come round while it runs: after 128 frames, and after 16 s.
for device in 0 1; do
  set_control /dev/video$device wrap_sequence_number=1
  set_control /dev/video$device wrap_timestamp=1
done
unit=round
fact "it starts with counts and stamps that are about to come round" start
sleep 18
fact "both have come round" eventually over "$paired" 190
fact "no camera was lost by that" is "$(of losses_total left)" 0
fact "neither was the other" is "$(of losses_total right)" 0
fact "and no pair, but where the processor was late" at_most "$missing_right" 5
fact "nor was time ever seen to go back" is stereotrack_sensor_clock_steps_total 0
# Stamps that are none of the monotonic clock's are placed by arrivals.
fact "results leave on time all the while" over 'stereotrack_outputs_total{cause="on_time"}' 150
fact "and none bears a time after its arrival" at_most 'stereotrack_outputs_total{cause="from_future"}' 3
grep -E '^stereotrack_(camera|pairing|mono|outputs|clock_steps|sensor_clock)' /run/results/figures.prom | tell
fact "the daemon ends, at last" stop
for each in none early late faults round; do
  echo "journal of $each:"
  journalctl -u "$each" -o cat
done | tell
finish
