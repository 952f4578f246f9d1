# shellcheck shell=bash
# The whole rig under test, for cases: the packages installed, the service run by its own unit, by
# /etc/stereotrack/stereotrackd.toml. Wants packages/stereotrack and, for the tool, packages/stereotrack-tools.
# shellcheck source=tests/system/board/guest/daemon.sh
source /payload/.board/daemon.sh
figures=/run/stereotrack/figures.prom
configuration=/etc/stereotrack/stereotrackd.toml
state=/var/lib/stereotrack
# shellcheck disable=SC2034  # for cases
recordings=$state/recordings

# What the service keeps is on the data disk, which has a journal.
use_data_disk() { mkdir -p $state && echo "/dev/vdc $state ext4 defaults 0 0" >>/etc/fstab && mount $state; }

# The root disk has no journal: what apt wrote is flushed.
install_rig() {
  DEBIAN_FRONTEND=noninteractive apt-get install -q -y /payload/*.deb && sync
}

# Standard input: the configuration, without what it always has here: no right is missing.
configure() {
  {
    cat
    printf '[realtime]\nmode = "enforce"\n[metrics]\nfile = "%s"\n' "$figures"
  } >"$configuration"
}
# PAIRS_A_SECOND WIDTHxHEIGHT LATENCY_MS [SOURCE], standard input: more. Thirty pairs of a scene, back and forth, without
# cameras. What leaves within 20 ms of its moment is on time: the emulated processors are few and slow.
configure_scene() {
  {
    cat <<END
[source]
name = "${4:-synthetic:eleven}"
fps = $1
[synthetic]
frames = 30
width = ${2%x*}
height = ${2#*x}
[latency]
output_ms = $3
late_ms = 20.0
grace_ms = 20.0
END
    cat
  } | configure
}
# The scene of synthetic:eleven as `pairs` pairs for the loopback cameras, with its calibration. PAIRS SIZE
draw_scene() {
  stereotrack synth eleven --out /run/scene --frames "$1" --size "$2" && cp /run/scene/calibration.yml /etc/stereotrack/
}
begin() { systemctl start stereotrackd; }
# In the background, before it is told to end: what each of its threads does ten seconds later, should it still be there.
watch_the_end() {
  local process task
  process=$(property MainPID)
  sleep 10
  for task in /proc/"$process"/task/*; do
    [[ -e $task ]] || break
    echo "$(<"$task/comm"): $(sed -n 's/^State:[[:space:]]*//p' "$task/status"), ticks $(cut -d' ' -f14,15 "$task/stat")"
    sed 's/^/  /' "$task/stack"
  done >/run/end.txt 2>/dev/null
}
told_of_the_end() { tell </run/end.txt; }
end() { systemctl stop stereotrackd && [[ $(property Result) == success ]]; }
is_ready() { [[ $(property ActiveState) == active && -e $figures ]]; }
runs() { eventually over stereotrack_frames_total "${1:-5}"; }
# Microseconds of CLOCK_MONOTONIC from when it was told to start to its being ready.
ready_after_us() { echo $(($(property ActiveEnterTimestampMonotonic) - $(property InactiveExitTimestampMonotonic))); }
# CLOCK_MONOTONIC [us].
now_us() { awk '{ printf "%d", $1 * 1000000 }' /proc/uptime; }
# Each pair left, but for those on their way, and with its own result. Who is asked for figures keeps a processor of the
# emulator busy, and the publisher from waking at once, now and then: after_due is no part of this.
all_left() {
  local cause
  for cause in predicted_late predicted_superseded missing overslept_pairs overslept_missing without_state outages; do
    is "stereotrack_outputs_total{cause=\"$cause\"}" 0 || return
  done
  none stereotrack_sent_late_total && awk '
    $1 == "stereotrack_frames_total" { pairs = $2 }
    $1 == "stereotrack_outputs_total{cause=\"on_time\"}" { left = $2 }
    END { print pairs " pairs, " left " left"; exit !(left > 0 && pairs - left <= 2 && left - pairs <= 1) }' "$figures"
}
ask_for_a_recording() { systemctl kill --signal=USR1 stereotrackd; }
restarted() { [[ $(property NRestarts) == "$1" ]]; }

# A fact is asked in a shell of its own: what begins in one and ends in another is known by a file.
is_gone() { ! kill -0 "$1" 2>/dev/null; }
ends_at_term() { kill -TERM "$1" && eventually is_gone "$1"; }
# Telemetry, from now on, until heard: /run/heard.bin.
listen() {
  /payload/keep_telemetry listen 127.0.0.1:5701 /run/heard.bin >/run/results/listening.txt 2>&1 &
  echo $! >/run/listener
  eventually grep -q listening /run/results/listening.txt
}
heard() {
  ends_at_term "$(</run/listener)" && /payload/keep_telemetry sessions /run/heard.bin >/run/sessions.txt
}
# Of what was heard: N sessions, each the next, each with all its messages from the first on.
sessions_are() {
  cat /run/sessions.txt
  awk -v wanted="$1" '
    $4 != 1 || $6 != $8 || (NR > 1 && $2 != last + 1) { wrong = 1 }
    { last = $2 }
    END { exit wrong || NR != wanted }' /run/sessions.txt
}
# BIT of the health, at any time.
health_was_told() {
  cat /run/sessions.txt
  awk -v bit="$1" 'int($14 / bit) % 2 { found = 1 } END { exit !found }' /run/sessions.txt
}
# Lines NUMBER..., from now on, until watched: /run/changes.txt.
watch_lines() {
  local number values=()
  for number in "$@"; do values+=("/run/rig/sim_gpio$number/value"); done
  chrt -f 90 /payload/line_times watch /run/changes.txt "${values[@]}" >/run/results/watching.txt 2>&1 &
  echo $! >/run/watcher
  eventually grep -q watching /run/results/watching.txt
}
watched() { ends_at_term "$(</run/watcher)"; }
shows() { [[ $(</run/rig/sim_gpio"$1"/value) == "$2" ]]; }
pull() { echo "pull-$2" >/run/rig/sim_gpio"$1"/pull; }
journal() { journalctl -u stereotrackd -o cat | tell; }
