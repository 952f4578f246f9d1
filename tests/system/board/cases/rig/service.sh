#!/bin/bash
# The packages and the service that they bring: installed by dpkg, started by systemd as a user without rights of its own,
# in a sandbox that lets the daemon have all it needs and nothing else; an upgrade, a removal, a purge.
# wants: packages/stereotrack packages/stereotrack-tools packages/stereotrack-libcamera
# limit: 1500
# shellcheck source=tests/system/board/guest/tap.sh
source /payload/.board/tap.sh
# shellcheck source=tests/system/board/guest/rig.sh
source /payload/.board/rig.sh
paired='stereotrack_pairing_total{verdict="paired"}'

lines() {
  cat <<END
[realtime]
mode = "enforce"
[telemetry]
destinations = ["127.0.0.1:47800"]
[record]
on = true
seconds = 2.0
seconds_after = 0.1
on_deadline = false
[[signal]]
name = "alive"
line = "rig:HEALTH"
when = "heartbeat"
period_ms = 600
[[signal]]
name = "missed"
line = "rig:ZONE"
when = "deadline_missed"
active = "low"
safe = "active"
[[input]]
name = "ready"
line = "rig:READY"
edge = "rising"
active = "high"
apart_ms = 0
END
}
refuses() {
  systemctl start "$unit" && return 1
  says 'camera\.left\.device' && [[ $(property ExecMainStatus)$(property NRestarts)$(property ActiveState) == 20failed ]]
}
# NAME VALUE: what the kernel says of the daemon.
status_is() {
  local now
  now=$(sed -n "s/^$1:[[:space:]]*//p" "/proc/$(property MainPID)/status")
  echo "$1: $now"
  [[ $now == "$2" ]]
}
is_locked() { (($(awk '/^VmLck/ { print $2 }' "/proc/$(property MainPID)/status") > 10000)); }
# THREAD PRIORITY
runs_at() { ps -L -o comm=,cls=,rtprio= -p "$(property MainPID)" | grep -E "^$1 +FF +$2\$"; }
holds() { find "/proc/$(property MainPID)/fd" -lname "$1" | grep .; }
beats() { eventually shows 4 1 && eventually shows 4 0 && eventually shows 4 1; }
edges='stereotrack_input_edges_total{input="ready",line="rig:READY"}'
edge_counts() {
  local before
  before=$(figure "$edges") && echo pull-up >/run/rig/sim_gpio1/pull && sleep 0.05 &&
    echo pull-down >/run/rig/sim_gpio1/pull && eventually over "$edges" "$before"
}
owned() { [[ $(stat -c %U:%G "$1") == "$2" ]]; }
# FOLDER
recorded() { find "$1/recordings" -name '*.strec' -user stereotrack | grep .; }
# As root, in the unit's cgroup: which devices there are is not a question of the user.
is_forbidden() {
  (echo "$BASHPID" >/sys/fs/cgroup/system.slice/stereotrackd.service/cgroup.procs && exec head -c 1 "$1") 2>&1 |
    grep 'not permitted'
}
main_pid() { systemctl show "$1" --property=MainPID --value; }
# UNIT PID: it runs, as another process.
another() { [[ $(main_pid "$1") != "$2" ]] && systemctl is-active "$1"; }
exposed_at_most() {
  local now
  now=$(systemd-analyze security --no-pager "$1" | sed -n 's/.*Overall exposure level for .*: \([0-9.]*\) .*/\1/p')
  echo "exposure $now"
  [[ -n $now ]] && awk -v now="$now" -v most="$2" 'BEGIN { exit !(now + 0 <= most + 0) }'
}
runs_with() {
  install -D -m 644 "/usr/share/stereotrack/drop-ins/$1.conf" "/etc/systemd/system/$unit.service.d/$1.conf" &&
    systemctl daemon-reload && systemctl restart "$unit" && eventually over "$paired" 2
}

# The package, a version later, with another configuration in it than the one that was installed.
make_newer() {
  local tree=/run/newer
  dpkg-deb -R /payload/stereotrack_*.deb $tree && sed -i 's/^Version:.*/&+newer/' $tree/DEBIAN/control &&
    echo '# of the newer version' >>$tree$configuration && dpkg-deb -Znone -b $tree /run/newer.deb
}

fact "the packages are installed" dpkg -i /payload/*.deb
fact "in full" test "$(dpkg-query -W -f '${db:Status-Abbrev}' stereotrack stereotrack-tools stereotrack-libcamera)" = "ii ii ii "
fact "nothing is enabled by that" test "$(systemctl is-enabled stereotrackd)" = disabled
fact "nor started" test "$(systemctl is-active stereotrackd)" = inactive
id stereotrack | tell
fact "the user is there, with cameras and lines" test "$(id -nG stereotrack)" = "stereotrack video gpio"
fact "lines are the group's" owned /dev/gpiochip1 root:gpio
fact "the wish for cores that do not sleep is the daemon's" owned /dev/cpu_dma_latency root:stereotrack
fact "systemd finds nothing to say of the units" \
  systemd-analyze verify --man=no stereotrackd.service stereotrackd@two.service
fact "as it was installed it refuses, names the key, and is left alone" refuses

vivid_rig bus:platform:vivid-000 bus:platform:vivid-001 "$(lines)"
sed 's|^\[metrics\]|&\nlisten = "127.0.0.1:9464"|' /run/rig.toml >$configuration
fact "the configuration is fine" stereotrackd --config $configuration --check-config
fact "it is enabled and starts, with every right of real time" systemctl enable --now stereotrackd
fact "pairs come" eventually over "$paired" 5
fact "and leave on time" eventually over 'stereotrack_outputs_total{cause="on_time"}' 5
fact "nothing is missing for real time" test -z "$(says 'not real-time')"
fact "its user is its own" owned "/proc/$(main_pid $unit)" stereotrack:stereotrack
fact "without capabilities" status_is CapEff 0000000000000000
fact "nor new ones" status_is NoNewPrivs 1
fact "with a filter of system calls" status_is Seccomp 2
fact "its memory is locked" is_locked
fact "the publisher has its priority" runs_at st-publisher 82
fact "the frame loop, too" runs_at st-frames 80
fact "cores do not sleep deeply" holds /dev/cpu_dma_latency
fact "its line beats" beats
fact "edges are counted" edge_counts
fact "datagrams come" stereotrack monitor --count 10 --timeout 20
fact "figures are served" grep '^stereotrack_frames_total' <(curl -s http://127.0.0.1:9464/metrics)
fact "it records when it is asked to" ask_for_a_recording
fact "into its state directory" eventually recorded /var/lib/stereotrack
fact "a disk is none of its devices" is_forbidden /dev/vda
fact "the kernel's log neither" is_forbidden /dev/kmsg
fact "the board finds it no more exposed than was promised" exposed_at_most stereotrackd.service 1.5
for one in stereotrackd.service stereotrackd@two.service; do
  systemd-analyze security --no-pager "$one" | tail -n 1 | tell
done

sed -i 's|127.0.0.1:47800|127.0.0.1:47801|' $configuration
fact "it reads its configuration again" systemctl reload stereotrackd
fact "and takes it over" eventually says 'reload: taken over'
fact "datagrams go elsewhere" stereotrack monitor --listen 127.0.0.1:47801 --count 5 --timeout 20

process=$(main_pid $unit)
fact "it is killed" systemctl kill --signal=KILL stereotrackd
fact "it is started again" eventually another $unit "$process"
fact "after its lines were made safe" says 'rig:HEALTH.*safe|safe.*rig:HEALTH'
fact "pairs come again" eventually over "$paired" 5

cat >/etc/stereotrack/two.toml <<'END'
[source]
name = "synthetic:eleven"
[synthetic]
frames = 30
width = 160
height = 120
[record]
on = true
seconds = 1.0
seconds_after = 0.1
on_deadline = false
END
fact "a second rig has a unit of its own" systemctl start stereotrackd@two
fact "with a state of its own" owned /var/lib/stereotrack/two/session stereotrack:stereotrack
fact "a runtime directory, too" owned /run/stereotrack-two stereotrack:stereotrack
fact "it records" systemctl kill --signal=USR1 stereotrackd@two
fact "into its own state" eventually recorded /var/lib/stereotrack/two

one=$(main_pid $unit)
two=$(main_pid stereotrackd@two)
fact "an upgrade" dpkg -i /payload/stereotrack_*.deb
fact "restarts what runs" another $unit "$one"
fact "of several, too" another stereotrackd@two "$two"
fact "the configuration is as it was" grep 47801 $configuration
fact "it stays enabled" test "$(systemctl is-enabled stereotrackd)" = enabled
one=$(main_pid $unit)
fact "a later version has another configuration" make_newer
fact "it is installed by who keeps his own" dpkg --force-confold -i /run/newer.deb
fact "which stays" grep 47801 $configuration
fact "the other one lies beside it" grep 'of the newer version' $configuration.dpkg-dist
fact "what runs is of that version" another $unit "$one"
fact "and back to the one before" dpkg --force-confold -i /payload/stereotrack_*.deb
fact "with the same configuration" grep 47801 $configuration
systemctl stop stereotrackd@two

# The board has two cores.
sed -i 's/^CPUAffinity=.*/CPUAffinity=1/' /usr/share/stereotrack/drop-ins/cores.conf
for name in clock cores network pwm; do
  fact "it runs with the drop-in $name" runs_with $name
  rm /etc/systemd/system/stereotrackd.service.d/$name.conf
done
systemctl daemon-reload

# With libcamera after 0.0.3 each picture of vimc's is one of 1920x1080 that the emulated CPU makes small, for seconds.
sed -i -e 's|^left.device.*|left.device = "vimc.0"|; s|^right.device.*|right.device = "vimc.1"\ndriver = "libcamera"|' \
  -e 's|^width.*|width = 318|; s|^format.*|format = "rgb8"|; s|^timeout_ms.*|timeout_ms = 20000|; /^readout_us/d' \
  $configuration
sed -i 's/320, 180/318, 180/' /run/calibration.yml
fact "both are at some ten frames a second" eval "slow_down_vimc 0 && slow_down_vimc 1"
fact "cameras of libcamera, in the same sandbox" systemctl restart stereotrackd
fact "give pairs" eventually over "$paired" 5

watch_the_end &
fact "it ends when it is asked to" systemctl stop stereotrackd
fact "without a failure" test -z "$(systemctl --failed --no-legend)"
wait
told_of_the_end
fact "it is started once more" systemctl start stereotrackd
watch_the_end &
fact "a removal" dpkg -r stereotrack
wait
told_of_the_end
fact "ends it" test "$(systemctl is-active stereotrackd)" = inactive
fact "the configuration stays" test -e $configuration
fact "so does the state" test -e /var/lib/stereotrack/session
fact "a purge" dpkg -P stereotrack stereotrack-libcamera stereotrack-tools
fact "takes the configuration" test ! -e $configuration
fact "and the state" test ! -e /var/lib/stereotrack
fact "and the link that enabled it" test -z "$(find /etc/systemd -name 'stereotrackd.service')"
fact "the user stays" id stereotrack
fact "it is installed anew" dpkg -i /payload/*.deb
fact "with the configuration as it comes" grep '^# stereotrackd: what this rig is' $configuration
fact "nothing is enabled by that either" test "$(systemctl is-enabled stereotrackd)" = disabled
journalctl -u stereotrackd -u stereotrackd@two -o cat | tell
finish
