#!/bin/bash
# Both cameras of the installed service are unplugged and plugged in again, then one of them fails: it finds them in its
# sandbox, and goes on as the process that it was.
# wants: packages/stereotrack
# limit: 300
# shellcheck source=tests/system/board/guest/tap.sh
source /payload/.board/tap.sh
# shellcheck source=tests/system/board/guest/rig.sh
source /payload/.board/rig.sh

paired='stereotrack_pairing_total{verdict="paired"}'
# Both cameras are one platform device.
unplug() { echo vivid.0 >/sys/bus/platform/drivers/vivid/unbind; }
plug_in() { echo vivid.0 >/sys/bus/platform/drivers/vivid/bind; }
is_there() { is "stereotrack_camera_silent{camera=\"$1\"}" 0; }

fact "the packages are installed" install_rig
vivid_rig bus:platform:vivid-000 bus:platform:vivid-001
cp /run/rig.toml "$configuration"
fact "the service is ready" begin
process=$(property MainPID)
echo "READY after $(ready_after_us) us" | tell
fact "pairs come" eventually over "$paired" 5
fact "and leave on time" eventually over 'stereotrack_outputs_total{cause="on_time"}' 5
fact "both are unplugged" unplug
fact "that is told" eventually says 'left camera: .*vivid-000.*predicted until'
fact "the service lives on" systemctl is-active stereotrackd
fact "they are plugged in again" plug_in
fact "the left one is back" eventually is_there left
fact "the right one is back" eventually is_there right
fact "and pairs come" rises "$paired"
fact "the right one is disconnected" v4l2-ctl -d1 -c disconnect=1
fact "left pictures go on alone" rises stereotrack_mono_pairs_total
fact "it comes back by itself, and that is told" eventually says 'right camera: is back'
fact "and pairs come" rises "$paired"
fact "it is the process that was started" test "$(property MainPID)" = "$process"
fact "no real-time thread asked the heap for anything" no_heap_calls
grep -E '^stereotrack_(camera|pairing|mono|outputs|frames)' "$figures" | tell
fact "the service ends" end
journal
finish
