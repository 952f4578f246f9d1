#!/bin/bash
# What README.md promises of the board is there.
# shellcheck source=tests/system/board/guest/tap.sh
source /payload/.board/tap.sh

driver_of() { [[ $(v4l2-ctl -d "$1" -D | sed -n 's/.*Driver name *: //p' | head -1) == "$2" ]]; }
two_media_devices_of_vimc() { [[ $(for d in /dev/media*; do media-ctl -d "$d" -p; done | grep -c '^driver *vimc') == 2 ]]; }
# Each on its own: libcamera's programs cannot share devices.
libcamera_sees_two_cameras() { [[ $(LIBCAMERA_LOG_LEVELS='*:ERROR' cam -l | grep -c vimc) == 2 ]]; }
all_units_run() { [[ $(systemctl is-system-running) == running ]] || ! systemctl --failed --no-legend; }

# Debian 13's kernel is that with PREEMPT_RT.
preemption_is_promised() {
  local realtime=0
  if [[ -e /sys/kernel/realtime ]]; then realtime=$(</sys/kernel/realtime); fi
  [[ $(. /etc/os-release && echo "$VERSION_ID")-$realtime == @(12-0|13-1) ]]
}

fact "the CPU is 64-bit ARM" test "$(uname -m)" = aarch64
fact "the kernel is real-time where it is said" preemption_is_promised
fact "systemd has started all that it should" all_units_run
fact "/dev/video0 is a vivid camera" driver_of /dev/video0 vivid
fact "/dev/video1 is a vivid camera" driver_of /dev/video1 vivid
fact "/dev/video2 is a loopback" driver_of /dev/video2 "v4l2 loopback"
fact "/dev/video3 is a loopback" driver_of /dev/video3 "v4l2 loopback"
fact "vimc has two media devices" two_media_devices_of_vimc
fact "libcamera sees two cameras" libcamera_sees_two_cameras
fact "gpio-sim has a chip with the label rig" sh -c "gpiodetect | grep -q '\[rig\]' && gpioinfo | grep -q TRIGGER"
fact "the payload cannot be written" test ! -w /payload/.board/start
finish
