#!/bin/bash
# An hour of the board's clock at two pairs a second: what the service holds after five minutes it holds after sixty.
# wants: packages/stereotrack packages/stereotrack-tools
# limit: 4000
# only by name: 7200 pairs take an emulated processor a quarter of an hour of the host's, and longer where others want it
# shellcheck source=tests/system/board/guest/tap.sh
source /payload/.board/tap.sh
# shellcheck source=tests/system/board/guest/rig.sh
source /payload/.board/rig.sh

fact "the packages are installed" install_rig
configure_scene 2.0 160x120 200.0 <<END
[telemetry]
destinations = ["127.0.0.1:5701"]
[record]
on = true
seconds = 5.0
seconds_after = 0.5
on_deadline = false
[[signal]]
name = "there"
line = "rig:NEAR"
when = "confirmed"
END
in_status() { awk -v key="$1:" '$1 == key { print $2 }' "/proc/$process/status"; }
# MINUTE: what it holds then, "VmRSS threads descriptors".
take() {
  sleep $((begun + $1 * 60 - SECONDS))
  held[$1]="$(in_status VmRSS) $(in_status Threads) $(find "/proc/$process/fd" -mindepth 1 | wc -l)"
  echo "minute $1: kB, threads, descriptors: ${held[$1]}; $(figure stereotrack_frames_total) pairs" | tell
}
declare -A held

fact "the service is ready" begin
begun=$SECONDS
process=$(property MainPID)
for minute in 5 20 40 60; do
  take $minute
  # Recordings are part of a life.
  ask_for_a_recording
done
grown() {
  local rss_5 rss_60 threads_5 threads_60 files_5 files_60
  read -r rss_5 threads_5 files_5 <<<"${held[5]}"
  read -r rss_60 threads_60 files_60 <<<"${held[60]}"
  echo "kB $rss_5 $rss_60, threads $threads_5 $threads_60, descriptors $files_5 $files_60"
  # The service thread's heap may yet take some pages.
  ((rss_60 <= rss_5 + 128 && threads_60 == threads_5 && files_60 == files_5))
}
fact "memory, threads and descriptors have not grown" grown
fact "all recordings were written" eventually is 'stereotrack_recordings_total{fate="written"}' 4
fact "two pairs a second went through" over stereotrack_frames_total 7150
fact "all left, with their own results" all_left
fact "no real-time thread asked the heap for anything" no_heap_calls
fact "it is the process that was started" test "$(property MainPID)" = "$process"
fact "the service ends" end
journal
finish
