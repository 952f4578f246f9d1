#!/bin/bash
# The trigger on real lines, and cameras that are exposed by it: sensors_on_line sees the line where gpio-sim shows it and
# writes a picture into each loopback on each rise, with the number of the rise in it. So whatever the phase of anything,
# it is known which pictures answer a pulse and which two belong together. Pulses of ours, edges of somebody else's,
# exposures missed and doubled, a trigger wire that is off, what is not there.
# wants: bin/stereotrackd tests/sensors_on_line tests/recorded_numbers
# limit: 600
# shellcheck source=tests/system/board/guest/tap.sh
source /payload/.board/tap.sh
# shellcheck source=tests/system/board/guest/daemon.sh
source /payload/.board/daemon.sh

plain_calibration /run/calibration.yml 160 120
mkdir /run/recordings
# MORE TOML of the trigger.
configure() {
  cat >/run/rig.toml <<END
[source]
name = "cameras"
[camera]
left.device = "/dev/video2"
right.device = "/dev/video3"
width = 160
height = 120
format = "grey8"
fps = 10.0
timeout_ms = 1000
# From the pulse to the picture.
readout_us = 10000
[calibration]
file = "/run/calibration.yml"
[latency]
output_ms = 150.0
[record]
on = true
seconds = 60.0
seconds_after = 0.2
on_deadline = false
directory = "/run/recordings"
[metrics]
file = "$figures"
[trigger]
$1
END
}
check_says() {
  local said
  said=$(check 2>&1)
  echo "$said"
  grep -qF -- "$1" <<<"$said"
}
paired='stereotrack_pairing_total{verdict="paired"}'
given='stereotrack_trigger_train_total{fate="given"}'
pulses=stereotrack_trigger_pulses_total
pin=/run/rig/sim_gpio0/value
at_pin() { [[ $(<"$pin") == "$1" ]]; }
astray() { echo "stereotrack_camera_astray{camera=\"$1\"}"; }
fault() { echo "stereotrack_camera_exposures_total{camera=\"$1\",fault=\"$2\"}"; }
taken() { echo "stereotrack_camera_frames_total{camera=\"$1\",fate=\"taken\"}"; }
# PATTERN: how often the journal has it.
told_times() { [[ $(journalctl -u "$unit" -o cat | grep -cE "$1") == "$2" ]]; }

# LINE: the sensors of the pin of that number. They are hardware: nothing on the board keeps them from running.
mkfifo /run/order
exec 4<>/run/order
expose_by() {
  chrt -f 90 ./sensors_on_line "/run/rig/sim_gpio$1/value" /dev/video2 /dev/video3 160 120 10 </run/order >/run/sensors.txt 2>&1 &
  sensors=$!
}
sensors_are_ready() { grep -q ready /run/sensors.txt; }
order() { echo "$@" >&4; }
# The last answer of theirs to "count".
counted() {
  local before
  before=$(grep -c rises /run/sensors.txt)
  order count
  # shellcheck disable=SC2016
  eventually eval '(($(grep -c rises /run/sensors.txt) > before))' && tail -n 1 /run/sensors.txt
}
# Frames and pulses, as the daemon counts them within a second and as the sensors do: what is on its way may be missing.
# A camera is not read before its daemon is there.
counts_agree() {
  local said rises left right p l r
  said=$(counted)
  read -r _ rises _ left _ right <<<"$said"
  sleep 1.5
  p=$(figure "$pulses") l=$(figure "$(taken left)") r=$(figure "$(taken right)")
  echo "the line: $said; told: $p pulses, $l left, $r right"
  ((rises > 30 && rises - left <= 1 && rises - right <= 1 && p - rises >= 0 && p - rises <= 30)) &&
    ((p - l >= 0 && p - l <= 1 && p - r >= 0 && p - r <= 1))
}
# What the black box has, by numbers, to FILE.
recorded() {
  rm -f /run/recordings/*.strec
  systemctl kill --signal=USR1 stereotrackd
  eventually compgen -G '/run/recordings/*.strec' && ./recorded_numbers /run/recordings/*.strec >"$1"
}
# FILE [LEAST]: each pair is of one exposure, that a pulse asked for, and none comes twice; many are there.
no_wrong_pair() {
  awk -v least="${2:-10}" '
    $2 != "mono" { pairs++; if ($1 != $2 || $1 >= 1000000) wrong = wrong " " $0 ";" }
    $1 <= last { wrong = wrong " " $1 " after " last ";" }
    { last = $1 }
    END { print pairs " pairs of " NR ", wrong:" wrong; exit wrong != "" || pairs < least }' "$1"
}
# FILE: pairs on both sides of the one gap of one number, which was left out.
one_is_missing() {
  awk '$2 == "mono" { bad = bad " mono " $1 }
    NR > 1 && $1 != last + 1 { gaps++; if ($1 != last + 2) bad = bad " gap " last " to " $1 }
    { last = $1 }
    END { print NR " pairs, " gaps " gaps," bad; exit gaps != 1 || bad != "" }' "$1"
}
whole() {
  awk 'NR > 1 && $1 != last + 1 { gaps++ } $2 == "mono" { gaps++ } { last = $1 }
    END { print NR " pairs, " gaps + 0 " gaps"; exit gaps != 0 || NR < 10 }' "$1"
}

expose_by 0
fact "two sensors wait at the line" eventually sensors_are_ready
configure 'mode = "gpio"
line = "rig:TRIGGER"
pulse_us = 50000.0
late_us = 20000.0'
fact "it is said what the trigger will do" check_says "trigger: gpio rig:TRIGGER, active high: 10.0 pulses/s of 50000 us"
fact "it starts with a pulse train" start --collect
fact "pulses are given" eventually over "$given" 5
fact "the line is the daemon's" sh -c "gpioinfo | grep -q 'TRIGGER.*stereotrackd-trigger'"
fact "pairs come" eventually over "$paired" 30
hogs=()
for _ in 1 2 3; do
  sh -c 'while :; do :; done' &
  hogs+=($!)
done
fact "they go on while others take all processors" rises "$paired" 30
kill "${hogs[@]}"
fact "each pulse is at the pin, and was answered by a frame of each camera" counts_agree
fact "none is missed, doubled or stray" none "$(fault left missed)" "$(fault right missed)" "$(fault left doubled)" \
  "$(fault right doubled)" "$(fault left stray)" "$(fault right stray)"

order miss right
fact "an exposure that the right camera misses is found" eventually is "$(fault right missed)" 1
fact "it is recorded" recorded /run/missed.txt
fact "that exposure is part of no pair, the next ones are whole" one_is_missing /run/missed.txt
fact "and none is wrong" no_wrong_pair /run/missed.txt 30
order double right
fact "an exposure that it makes twice is found" eventually is "$(fault right doubled)" 1
sleep 1
order double left
fact "one of the left camera, too" eventually is "$(fault left doubled)" 1
sleep 2
fact "they cost no pair" recorded /run/doubled.txt
fact "of those that came since" sh -c "tail -n 15 /run/doubled.txt >/run/last.txt"
fact "all are there" whole /run/last.txt
fact "and none is wrong of all" no_wrong_pair /run/doubled.txt 40
fact "nobody is astray" none "$(astray left)" "$(astray right)"

order free right 10 50
fact "the right camera's wire is off: it is named" \
  eventually says 'right camera: [0-9]+ frames, none answers a pulse, .*goes on in mono: check the trigger'
fact "and shows" eventually is "$(astray right)" 1
fact "alone" none "$(astray left)" stereotrack_trigger_unanswered
fact "left pictures go on" rises stereotrack_mono_pairs_total 10
order wire right
fact "it is on again, which is told" eventually says 'right camera: its frames answer pulses again'
fact "shows" eventually none "$(astray right)"
fact "and pairs come" rises "$paired" 10
order free left 10 50
fact "the left camera's wire is off: it is named" eventually says 'left camera: [0-9]+ frames, none answers a pulse'
fact "and shows, alone" eventually is "$(astray left)" 1
fact "its slots leave as missing" rises 'stereotrack_outputs_total{cause="missing"}'
order wire left
fact "it is on again" eventually says 'left camera: its frames answer pulses again'
fact "and pairs come" rises "$paired" 10
fact "it is recorded what was made of that" recorded /run/astray.txt
fact "no pair was wrong" no_wrong_pair /run/astray.txt 40
# Within camera.tolerance of a pulse a frame is taken for its answer: told as skew, and by what strays beside it.
order free right 20 5
fact "at twice the rate, each second frame near a pulse, it is found as well" \
  eventually says 'right camera: [0-9]+ of [0-9]+ frames answer no pulse'
order wire right
fact "and comes back" eventually none "$(astray right)"
fact "pairs come" rises "$paired" 10
fact "each of these was told once" told_times '(none answers a|frames answer no) pulse' 3
fact "no camera was given up" none 'stereotrack_camera_reopened_total{camera="left"}' \
  'stereotrack_camera_reopened_total{camera="right"}' stereotrack_trigger_unanswered
fact "the trigger thread asked the heap for nothing" none 'stereotrack_allocations_total{thread="trigger"}'
fact "the capture thread asked it for nothing" none 'stereotrack_allocations_total{thread="capture"}'
fact "none was refused by the line" none 'stereotrack_trigger_train_total{fate="failed"}'
grep -E '^stereotrack_(trigger|camera_exposures|camera_astray|camera_strayings|pairing)' "$figures" | tell
fact "it ends when it is asked to" systemctl stop stereotrackd
fact "the line is inactive then" at_pin 0
journalctl -u stereotrackd -o cat | tell

sed -i 's/^line = /active = "low"\nline = /' /run/rig.toml
fact "it starts with pulses that are active low" start --collect
fact "which are given" eventually over "$given" 5
fact "it is killed" systemctl kill -s KILL stereotrackd
fact "and is gone" eventually sh -c '! systemctl is-active stereotrackd'
safe_lines() { /payload/stereotrackd --config /run/rig.toml --safe-lines 2>&1 | grep -F "driven inactive, its safe state (high)"; }
fact "its line is made safe" safe_lines
kill "$sensors"

# So many pulses of somebody else's.
drive() {
  local n
  for ((n = 0; n < $1; n++)); do
    echo pull-up >/run/rig/sim_gpio1/pull
    sleep 0.04
    echo pull-down >/run/rig/sim_gpio1/pull
    sleep 0.05
  done
}
all_are_told() {
  local before
  before=$(figure "$pulses")
  drive 30
  eventually over "$pulses" $((before + 29))
}
both() { order "$1" left "${@:2}" && order "$1" right "${@:2}"; }
is_silent() { [[ $(figure stereotrack_trigger_silent) == 1 ]]; }
answered() {
  local before
  before=$(figure "$paired")
  drive 40
  eventually over "$paired" $((before + 30))
}

expose_by 1
fact "two sensors wait at another line" eventually sensors_are_ready
both free 10 0
configure 'mode = "external"
line = "rig:READY"'
fact "it is said whose pulses are expected" \
  check_says "trigger: external rig:READY, active high: 10.0 pulses/s expected; exposures begin 0 us after the rising edge"
fact "it starts with somebody else's pulses" start --collect
fact "without one, pairs come all the same" eventually over "$paired" 5
fact "which is told" eventually says 'trigger: frames come, and no pulse was told for'
fact "and shows" eventually is_silent
fact "pairs go on" rises "$paired"
both wire
fact "each edge is told" all_are_told
fact "that they are there is told, too" eventually says 'trigger: pulses are told again'
fact "frames that they ask for are pairs" answered
fact "a pause of the trigger is told" eventually says 'cameras: no frame for .*is the trigger alive'
fact "it goes on, and so do pairs" answered
fact "as told" eventually says 'cameras: frames come again'
fact "no camera was given up for it" none 'stereotrack_camera_losses_total{camera="left"}' \
  'stereotrack_camera_losses_total{camera="right"}'
fact "it is recorded" recorded /run/external.txt
fact "all but those that nobody asked for are right" sh -c "awk '\$1 < 1000000' /run/external.txt >/run/asked.txt"
fact "no pair of them is wrong" no_wrong_pair /run/asked.txt 30
fact "the capture thread asked the heap for nothing" none 'stereotrack_allocations_total{thread="capture"}'
grep -E '^stereotrack_(trigger|camera_exposures|pairing)' "$figures" | tell
journalctl -u stereotrackd -o cat | tail -n 20 | tell
fact "it ends when it is asked to" systemctl stop stereotrackd
kill "$sensors"

configure 'mode = "pwm"
pwm_chip = "pwmchip7"'
fact "hardware PWM that this board has not got is a line" check_says "PWM pwmchip7: no such chip in /sys/class/pwm"
fact "nothing has failed" test -z "$(systemctl --failed --no-legend)"
finish
