#!/bin/bash
# stereotrackd on two vimc cameras through libcamera: pairs, one unplugged and plugged in again; and without a module.
# wants: bin/stereotrackd
# wants on debian12: lib/stereotrack/stereotrack-libcamera-0.0.3.so
# wants on debian13: lib/stereotrack/stereotrack-libcamera-0.4.so
# limit: 300
# shellcheck source=tests/system/board/guest/tap.sh
source /payload/.board/tap.sh
# shellcheck source=tests/system/board/guest/daemon.sh
source /payload/.board/daemon.sh
export STEREOTRACK_MODULE_PATH=/payload

cat >/run/rig.toml <<END
[source]
name = "cameras"
[camera]
driver = "libcamera"
left.device = "vimc.0"
right.device = "vimc.1"
width = 318
height = 180
format = "rgb8"
fps = 10.0
tolerance = 0.5
# With libcamera after 0.0.3 each picture of vimc's is one of 1920x1080 that the emulated CPU makes small, for seconds.
timeout_ms = 5000
[calibration]
file = "/run/calibration.yml"
[latency]
output_ms = 150.0
[metrics]
file = "/run/results/figures.prom"
END

plain_calibration /run/calibration.yml 318 180

# Without a module: the line says why, and how to go on.
refuses_without_a_module() {
  local said
  said=$(STEREOTRACK_MODULE_PATH=/nowhere check 2>&1) && return 1
  echo "$said"
  grep 'libcamera: there is no module, .*/nowhere' <<<"$said"
}
# Nor does a module that does not load hinder cameras of the kernel's.
v4l2_starts_without() {
  mkdir -p /run/modules
  echo broken >/run/modules/stereotrack-libcamera-9.so
  STEREOTRACK_MODULE_PATH=/run/modules /payload/stereotrackd --config /run/rig.toml --check-config \
    --set camera.driver=v4l2 --set camera.left.device=/dev/video0 --set camera.right.device= --set calibration.file= \
    --set camera.width=320 --set camera.format=grey8 --set camera.readout_us=90000
}
plug_in() { echo vimc.1 >/sys/bus/platform/drivers/vimc/bind && udevadm settle && slow_down_vimc 1; }
unplug() { echo vimc.1 >/sys/bus/platform/drivers/vimc/unbind; }
paired='stereotrack_pairing_total{verdict="paired"}'

fact "without a module a line says so" refuses_without_a_module
fact "and cameras of the kernel's are opened all the same" v4l2_starts_without
fact "both cameras can do what is asked of them" check
check 2>&1 | tell

fact "both are at some ten frames a second" eval "slow_down_vimc 0 && slow_down_vimc 1"
fact "the daemon starts on both" start --setenv=STEREOTRACK_MODULE_PATH=/payload
fact "pairs come" eventually over "$paired" 5
fact "the capture thread asked the heap for nothing" test "$(figure 'stereotrack_allocations_total{thread="capture"}')" = 0
fact "the right camera is unplugged" unplug
fact "its silence is noticed" eventually says 'right camera: vimc.1 .*no frame for'
fact "the daemon lives on" systemctl is-active stereotrackd
fact "left pictures go on alone" eventually over stereotrack_mono_pairs_total 5
fact "it is plugged in again" plug_in
fact "both are opened anew, for libcamera has to look again" eventually over 'stereotrack_camera_reopened_total{camera="left"}' 0
fact "and pairs come again" rises "$paired"
grep -E '^stereotrack_(camera|pairing|mono|outputs|frames)' /run/results/figures.prom | tell
fact "it is the process that was started" test "$(property NRestarts)" = 0
fact "it ends when it is asked to" systemctl stop stereotrackd
fact "without a failure" test -z "$(systemctl --failed --no-legend)"
journalctl -u stereotrackd -o cat | tell
finish
