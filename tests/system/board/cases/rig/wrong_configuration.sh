#!/bin/bash
# A wrong configuration: taken over while it runs it is refused, with its line in the journal, and the old one goes on. A
# crash then finds the lines that ran; the start after it is refused, and the service waits for a better one.
# wants: packages/stereotrack packages/stereotrack-tools
# limit: 300
# shellcheck source=tests/system/board/guest/tap.sh
source /payload/.board/tap.sh
# shellcheck source=tests/system/board/guest/rig.sh
source /payload/.board/rig.sh

fact "the packages are installed" install_rig
configure_scene 5.0 160x120 150.0 <<END
[telemetry]
destinations = ["127.0.0.1:5701"]
[[signal]]
name = "there"
line = "rig:NEAR"
when = "confirmed"
END
sed 's/^when = .*/when = "confirmd"/' "$configuration" >/run/wrong.toml
wrong_line=$(grep -n confirmd /run/wrong.toml | cut -d : -f 1)
good=$(<"$configuration")
gave_up() { [[ "$(property ActiveState) $(property NRestarts)" == "failed 1" ]]; }

fact "the service is ready" begin
process=$(property MainPID)
fact "a target makes its line active" eventually shows 2 1
cp /run/wrong.toml "$configuration"
fact "a wrong configuration is to be taken over" systemctl reload stereotrackd
fact "it is refused, with file and line" eventually says "reload: refused, .*stereotrackd.toml:$wrong_line:[0-9]+: .*confirmd"
fact "and counted" eventually is stereotrack_reloads_refused_total 1
fact "the old one goes on" rises stereotrack_frames_total 10
fact "all leave with their own results" all_left
fact "its line, too" eventually shows 2 1
fact "it is the process that was started" test "$(property MainPID)" = "$process"

fact "it is killed, with the wrong one on the disk" kill -KILL "$process"
fact "its line is made safe all the same: it is known what ran" eventually says 'rig:NEAR: driven inactive, its safe state'
fact "the next start is refused, with file and line" \
  eventually says "^/etc/.*stereotrackd.toml:$wrong_line:[0-9]+: .*confirmd"
fact "and systemd gives up" eventually gave_up
sleep 10
fact "for good" gave_up
fact "the line is safe" shows 2 0
echo "$good" >"$configuration"
fact "with a good one it starts" begin
fact "and tracks" runs 10
fact "its line tells" eventually shows 2 1
fact "the service ends" end
journal
finish
