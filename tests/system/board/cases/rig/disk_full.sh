#!/bin/bash
# The disk of recordings is full: that is told once, tracking goes on, and recordings when there is room again; the next
# time that it is full is told anew.
# wants: packages/stereotrack packages/stereotrack-tools tests/keep_telemetry
# limit: 300
# shellcheck source=tests/system/board/guest/tap.sh
source /payload/.board/tap.sh
# shellcheck source=tests/system/board/guest/rig.sh
source /payload/.board/rig.sh

fact "the packages are installed" install_rig
configure_scene 5.0 160x120 150.0 <<END
[telemetry]
destinations = ["127.0.0.1:5701"]
[record]
on = true
seconds = 2.0
seconds_after = 0.2
on_deadline = false
END
# Room for some recordings beyond what stays free.
small_disk() { mkdir -p $recordings && mount -t tmpfs -o size=96M,mode=777 small $recordings; }
fill() { head -c "$(df --output=avail -B1 $recordings | tail -n 1)" /dev/zero >$recordings/filler; }
written='stereotrack_recordings_total{fate="written"}'
failed='stereotrack_recordings_total{fate="failed"}'
told_times() {
  local times
  times=$(says 'recording: .*too little space' | wc -l)
  echo "told $times times"
  [[ $times == "$1" ]]
}

fact "recordings have a small disk of their own" small_disk
fact "somebody listens" listen
fact "the service is ready" begin
fact "it runs" runs 12
fact "it is asked to record" ask_for_a_recording
fact "and does" eventually is "$written" 1
fact "the disk is filled" fill
fact "asked again" ask_for_a_recording
fact "it cannot" eventually is "$failed" 1
fact "and tells of it, and of the way out" eventually told_times 1
fact "asked once more" ask_for_a_recording
fact "it cannot, again" eventually is "$failed" 2
fact "which it tells no second time" told_times 1
fact "tracking goes on" rises stereotrack_frames_total 10
fact "and all left, with their own results" all_left
fact "nothing half done is left" sh -c "[ -z \"\$(ls $recordings | grep part)\" ]"
fact "there is room again" rm $recordings/filler
fact "asked for the fourth time" ask_for_a_recording
fact "it records" eventually is "$written" 2
fact "what it wrote replays" sh -c "stereotrack replay \$(ls $recordings/*.strec | tail -n 1) --out /run/replayed"
fact "the disk is filled again" fill
fact "asked for the last time" ask_for_a_recording
fact "it cannot, once more" eventually is "$failed" 3
fact "and tells of it anew" eventually told_times 2
fact "no real-time thread asked the heap for anything" no_heap_calls
fact "what was heard is kept" heard
fact "receivers were told, too" health_was_told 256
fact "and missed nothing" sessions_are 1
fact "the service ends" end
journal
finish
