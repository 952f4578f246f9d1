#!/bin/bash
# stereotrackd on two cameras of the kernel's: pairs from their own buffers, one lost, both unplugged, a fatal error.
# wants: bin/stereotrackd
# limit: 300
# shellcheck source=tests/system/board/guest/tap.sh
source /payload/.board/tap.sh
# shellcheck source=tests/system/board/guest/daemon.sh
source /payload/.board/daemon.sh

vivid_rig bus:platform:vivid-000 bus:platform:vivid-001

# Both cameras are one platform device.
unplug() { echo vivid.0 >/sys/bus/platform/drivers/vivid/unbind; }
plug_in() { echo vivid.0 >/sys/bus/platform/drivers/vivid/bind; }
is_there() { [[ $(figure "stereotrack_camera_silent{camera=\"$1\"}") == 0 ]]; }
# Its device now: plugged in again, a camera has another number where somebody still held the old one.
right() { v4l2-ctl --list-devices | awk '/vivid-001/ { here = 1; next } here { print $1; exit }'; }
paired='stereotrack_pairing_total{verdict="paired"}'

fact "both cameras can do what is asked of them" check
fact "it starts on both" start
fact "pairs come" eventually over "$paired" 5
fact "and leave on time" eventually over 'stereotrack_outputs_total{cause="on_time"}' 5
fact "the capture thread asked the heap for nothing" test "$(figure 'stereotrack_allocations_total{thread="capture"}')" = 0

fact "the right camera is disconnected" v4l2-ctl -d "$(right)" -c disconnect=1
fact "that is told, with its name" eventually says 'right camera: .*vivid-001.*goes on in mono'
fact "left pictures go on alone" eventually over stereotrack_mono_pairs_total 0
fact "it comes back by itself, and that is told" eventually says 'right camera: is back'
fact "and pairs with it" rises "$paired"

fact "both are unplugged" unplug
fact "the left one is told of" eventually says 'left camera: .*vivid-000.*predicted until'
fact "the daemon lives on" systemctl is-active stereotrackd
fact "they are plugged in again" plug_in
fact "the left one is back" eventually is_there left
fact "the right one is back" eventually is_there right
fact "pairs come for the third time" rises "$paired"
fact "a fatal error of the stream is a camera lost" v4l2-ctl -d "$(right)" -c inject_fatal_streaming_error=1
fact "which is opened anew" eventually over 'stereotrack_camera_reopened_total{camera="right"}' 2
fact "and pairs come for the fourth" rises "$paired"
fact "it is the process that was started" test "$(property NRestarts)" = 0
grep -E '^stereotrack_(camera|pairing|mono|outputs|frames)' /run/results/figures.prom | tell

fact "it ends when it is asked to" systemctl stop stereotrackd
fact "without a failure" test -z "$(systemctl --failed --no-legend)"
journalctl -u stereotrackd -o cat | tell
finish
