# shellcheck shell=bash
# stereotrackd under systemd, for cases: by /run/rig.toml, whose metrics.file is /run/results/figures.prom.
unit=stereotrackd
figures=/run/results/figures.prom

matrix() { printf '%s: !!opencv-matrix\n   rows: %d\n   cols: %d\n   dt: d\n   data: [ %s ]\n' "$@"; }

# FILE WIDTH HEIGHT: of two cameras without distortion, a quarter of a metre apart.
plain_calibration() {
  local file=$1 width=$2 height=$3 side focal
  focal=$((width * 15 / 16))
  {
    printf '%%YAML:1.0\n---\nimage_size: [ %d, %d ]\n' "$width" "$height"
    for side in 1 2; do
      matrix "K$side" 3 3 "$focal, 0, $((width / 2)), 0, $focal, $((height / 2)), 0, 0, 1"
      matrix "D$side" 1 5 "0, 0, 0, 0, 0"
    done
    matrix R 3 3 "1, 0, 0, 0, 1, 0, 0, 0, 1"
    matrix T 3 1 "-0.25, 0, 0"
  } >"$file"
}

# LEFT RIGHT [MORE]: two cameras of vivid's, ten pairs a second, with a calibration; MORE is TOML.
vivid_rig() {
  plain_calibration /run/calibration.yml 320 180
  cat >/run/rig.toml <<END
[source]
name = "cameras"
[camera]
left.device = "$1"
right.device = "$2"
width = 320
height = 180
format = "grey8"
fps = 10.0
tolerance = 0.5
timeout_ms = 1000
# vivid stamps what it calls the end of a frame, nine tenths of a period after the frame has come.
readout_us = 90000
[calibration]
file = "/run/calibration.yml"
[latency]
output_ms = 150.0
[metrics]
file = "$figures"
${3:-}
END
}

# NUMBER: some ten frames a second. Else vimc's sensors are as fast as the emulated CPU lets them be, which then has no
# time left for anybody else.
slow_down_vimc() {
  local sensor
  sensor=$(media-ctl -d "platform:vimc.$1" -e "Sensor B") && v4l2-ctl -d "$sensor" -c vertical_blanking=3000
}

# [SYSTEMD-RUN OPTION...]
start() {
  rm -f "$figures"
  systemd-run --unit="$unit" --property=Type=notify --property=StateDirectory=stereotrack "$@" \
    /payload/stereotrackd --config /run/rig.toml
}
stop() { systemctl stop "$unit" && [[ -z $(systemctl --failed --no-legend) ]]; }
check() { /payload/stereotrackd --config /run/rig.toml --check-config; }
property() { systemctl show "$unit" --property="$1" --value; }
says() { journalctl -u "$unit" -o cat | grep -E "$1"; }

# Figures: NAME with its labels, as the daemon serves it.
figure() { awk -v name="$1" '$1 == name { print $2 }' "$figures"; }
is() { [[ $(figure "$1") == "$2" ]] || { echo "$1 is $(figure "$1"), not $2"; return 1; }; }
over() { (($(figure "$1") > $2)) || { echo "$1 is $(figure "$1"), not over $2"; return 1; }; }
at_most() { (($(figure "$1") <= $2)) || { echo "$1 is $(figure "$1"), over $2"; return 1; }; }
# NAME...
none() {
  local name
  for name in "$@"; do is "$name" 0 || return; done
}
# NAME [BY MORE THAN]
rises() {
  local before
  before=$(figure "$1") && eventually over "$1" $((before + ${2:-0}))
}
no_heap_calls() { grep -q '^stereotrack_allocations_total' "$figures" && ! grep '^stereotrack_allocations_total.* [^0]' "$figures"; }
