# shellcheck shell=bash
# stereotrackd under systemd, for cases: by /run/rig.toml, whose metrics.file is /run/results/figures.prom.
unit=stereotrackd
figures=/run/results/figures.prom

# LEFT RIGHT [MORE]: two cameras of vivid's, ten pairs a second, with the calibration of /run/scene; MORE is TOML.
vivid_rig() {
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
file = "/run/scene/calibration.yml"
[latency]
output_ms = 150.0
[metrics]
file = "$figures"
${3:-}
END
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
no_heap_calls() { ! grep '^stereotrack_allocations_total.* [^0]' "$figures"; }
