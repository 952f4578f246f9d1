#!/bin/bash
# stereotrack doctor on a board with cameras and lines of the kernel's: what it finds, what it measures, and that the
# configuration that it writes is one that the daemon runs with.
# wants: bin/stereotrack bin/stereotrackd
# limit: 2000
# shellcheck disable=SC2016  # what stands in single quotes is Perl, whose variables are its own
# shellcheck source=tests/system/board/guest/tap.sh
source /payload/.board/tap.sh
# shellcheck source=tests/system/board/guest/daemon.sh
source /payload/.board/daemon.sh

report=/run/results/report.txt
json=/run/results/doctor.json
line_json=/run/results/line.json

# CODE COMMAND...: the command ends with that exit code.
ends_with() {
  local wanted=$1 code
  shift
  "$@"
  code=$?
  echo "exit code $code"
  [[ $code == "$wanted" ]]
}
looks() { /payload/stereotrack doctor --no-measure >$report; }
tells() { grep -E "$1" $report; }
# PERL [FILE]: an expression about what --json said, as $d; not JSON: it does not hold.
holds() {
  perl -MJSON::PP -0777 -ne 'BEGIN { $e = shift @ARGV } $d = decode_json($_); exit(eval($e) ? 0 : 1)' "$1" "${2:-$json}"
}
# FILE: for what it tells.
measures() {
  /payload/stereotrack doctor --calibration /run/scene/calibration.yml --seconds 3 --json --write /run/rig.toml >"$1"
}
sets_a_line() { /payload/stereotrack doctor --config /run/lines.toml --seconds 1 --line rig:NEAR --json >$line_json; }
is_low() { [[ $(cat /run/rig/sim_gpio2/value) == 0 ]]; }
start() {
  systemd-run --unit=stereotrackd --property=Type=notify --property=StateDirectory=stereotrack \
    /payload/stereotrackd --config /run/rig.toml --set metrics.file=/run/results/figures.prom
}
screen() { (($(wc -l <$report) <= 40)) && ! grep -E '^.{101,}' $report; }

fact "a scene brings a calibration" /payload/stereotrack synth eleven --out /run/scene --frames 1 --size 320x180

fact "it looks, and the exit code tells of limits" ends_with 1 looks
fact "what it tells is one screen" screen
release=$(uname -r | sed 's/[.+]/[&]/g')  # as a regular expression
if [[ $(uname -v) == *PREEMPT_RT* ]]; then
  fact "it names the kernel and its preemption" tells "^OK +kernel +$release .*PREEMPT_RT"
else
  fact "it names the kernel and its preemption" tells "^NOTE +kernel +$release .*preemption voluntary"
  fact "and the command for another one" tells 'sudo apt install linux-image-rt-arm64'
fi
fact "the first camera with its formats" tells '^OK +camera +/dev/video0 vivid, platform:vivid-000: .* grey8 '
fact "its largest size and rate, its controls" tells '[0-9]+x[0-9]+ at [0-9.]+/s; .*gain <- left'
fact "the second one" tells '^OK +camera +/dev/video1 vivid, platform:vivid-001: '
fact "which it takes for the right one" tells '<- right'
fact "the GPIO chip with its lines' names" tells 'rig, 8 lines: TRIGGER READY'
fact "that a calibration is missing, and what to type" tells 'doctor --calibration calibration.yml --write rig.toml'
tell <$report

fact "it measures and writes a configuration" ends_with 1 measures $json
fact "its JSON has the verdict" holds '$d->{verdict} eq "works_with_limits" && $d->{exit_code} == 1'
fact "two vivid cameras with sizes and rates" \
  holds '2 == grep {
    $_->{kernel_driver} eq "vivid" && grep { $_->{name} eq "grey8" && @{$_->{sizes}[0]{rates}} } @{$_->{formats}}
  } @{$d->{found}{cameras}}'
fact "their controls" holds '!grep { $_->{kernel_driver} eq "vivid" && @{$_->{controls}} < 10 } @{$d->{found}{cameras}}'
fact "the lines of chip rig by name" \
  holds 'grep { $_->{label} eq "rig" && $_->{lines}[2]{name} eq "NEAR" } @{$d->{found}{gpio}{chips}}'
fact "frames of both cameras" holds '2 == grep { $_->{frames} > 10 && $_->{failure} eq "" } @{$d->{measured}{capture}}'
fact "how the two lie against each other" holds 'defined $d->{measured}{pair}{phase_ms}'
fact "a wake-up with the publisher's priority" \
  holds '$d->{measured}{wake_up}{priority} == 82 && $d->{measured}{wake_up}{latency}{count} > 100'
fact "the pipeline's time in the cameras' size" \
  holds '$p = $d->{measured}{pipeline}; $p->{width} == 320 && $p->{height} == 180 && $p->{stereo} && $p->{compute}{count} >= 20'
fact "and a latency that follows" holds '$d->{measured}{latency}{achievable_ms} > $d->{measured}{latency}{compute_ms}'
tell </run/rig.toml

fact "a second time it does not write over it" ends_with 2 measures /dev/null
fact "the daemon finds the configuration fine" /payload/stereotrackd --config /run/rig.toml --check-config
fact "and starts with it" start
fact "pairs come" eventually over 'stereotrack_pairing_total{verdict="paired"}' 5
fact "it ends" systemctl stop stereotrackd

cat >/run/lines.toml <<END
[source]
name = "synthetic:eleven"
[synthetic]
width = 64
height = 48
[[signal]]
name = "near"
line = "rig:NEAR"
when = "confirmed"
[[signal]]
name = "zone"
line = "rig:NOWHERE"
when = "confirmed"
END
fact "a line that is not there is a problem" ends_with 2 sets_a_line
fact "which is told with those that are" \
  holds 'grep { $_->{verdict} eq "problem" && $_->{text} =~ /rig:NOWHERE.*TRIGGER, READY, NEAR/ } @{$d->{items}}' $line_json
fact "the one that was asked for was set, many times" \
  holds '$d->{measured}{line}{latency}{count} > 100 && $d->{measured}{line}{failures} == 0' $line_json
fact "and is inactive again" is_low
sed -n '/"measured"/,$p' $json | tell
finish
