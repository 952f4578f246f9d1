#!/bin/bash
# Hardware PWM by the installed service: the drop-in that makes /sys writable, the udev rule that gives a channel to the
# group, and the pulses at the line.
# boards: debian13
# wants: packages/stereotrack
# limit: 300
# shellcheck source=tests/system/board/guest/tap.sh
source /payload/.board/tap.sh
# shellcheck source=tests/system/board/guest/rig.sh
source /payload/.board/rig.sh
channel=/sys/class/pwm/pwmchip0/pwm0
paired='stereotrack_pairing_total{verdict="paired"}'
mountpoint -q /sys/kernel/debug || mount -t debugfs debugfs /sys/kernel/debug

level() { sed -n 's/^ *gpio-.*|pwm.*) out \(hi\|lo\).*/\1/p' /sys/kernel/debug/gpio; }
is_low() { [[ $(level) == lo ]]; }
# Pulses and what lies between them are 50 ms long: so many rose in five seconds, as polled.
rises() {
  local last=hi now rises=0 end=$((SECONDS + 5))
  while ((SECONDS < end)); do
    now=$(level)
    [[ $now$last == hilo ]] && rises=$((rises + 1))
    last=$now
  done
  echo "$rises rises in 5 s"
  ((rises >= 40 && rises <= 61))
}
holds() { [[ $(<"$channel/$1") == "$2" ]] || { echo "$1 is $(<"$channel/$1")"; return 1; }; }
is_refused() { ! systemctl start stereotrackd && says 'PWM pwmchip0.*Read-only file system'; }
exposed_at_most() {
  systemd-analyze security --no-pager stereotrackd.service | sed -n 's/.*Overall exposure level for .*: \([0-9.]*\) .*/\1/p' |
    awk -v most="$1" '{ print "exposure " $1; found = $1 <= most } END { exit !found }'
}

fact "the packages are installed" install_rig
fact "the board has a PWM chip" test -e /sys/class/pwm/pwmchip0/npwm
vivid_rig bus:platform:vivid-000 bus:platform:vivid-001 '[trigger]
mode = "pwm"
pwm_chip = "pwmchip0"
pulse_us = 50000.0'
cp /run/rig.toml "$configuration"
fact "the sandbox lets nobody write to /sys, which is told" is_refused
systemctl stop stereotrackd
fact "the drop-in is put where its head says" install -D -m 644 /usr/share/stereotrack/drop-ins/pwm.conf \
  /etc/systemd/system/stereotrackd.service.d/pwm.conf
systemctl daemon-reload
fact "with it the service is ready" begin
fact "it is no more exposed than the drop-in says" exposed_at_most 1.6
fact "the channel is the group's" test "$(stat -c %G $channel/duty_cycle)" = gpio
fact "the service is no root" test "$(stat -c %U "/proc/$(property MainPID)")" = stereotrack
fact "the period is that of ten pairs a second" holds period 100000000
fact "pulses have the width that was asked for" holds duty_cycle 50000000
fact "they are on" holds enable 1
fact "and at the line" rises
fact "pairs come" eventually over "$paired" 5
fact "killed" systemctl kill --signal=KILL stereotrackd
fact "the pulses are turned off" eventually says 'PWM pwmchip0.*: off'
fact "and given again by the next process" eventually restarted 1
fact "which is ready" eventually is_ready
fact "at the line" rises
fact "the service ends" end
# Who was killed left it exported, and what is exported stays so.
fact "the pulses are off" holds enable 0
fact "the line is low" is_low
journal
finish
