#!/bin/bash
# Power is cut, twice: as soon as a recording counts as written, and while another is being written. What counted as
# written is whole, the other one is there up to its last whole frame, and the service comes up by itself each time.
# What it keeps lies on a disk with a journal; what the board had not flushed is lost.
# wants: packages/stereotrack packages/stereotrack-tools
# limit: 1200
# power cuts: 2
# shellcheck source=tests/system/board/guest/tap.sh
source /payload/.board/tap.sh
# shellcheck source=tests/system/board/guest/rig.sh
source /payload/.board/rig.sh

written='stereotrack_recordings_total{fate="written"}'
# A frame of a recording: two pictures of 320x240 in colour, and their heads.
frame_bytes=$((2 * 320 * 240 * 3 + 1024 + 32))
session() { figure stereotrack_session; }
size_of_part() { stat -c %s $recordings/*.part 2>/dev/null || echo 0; }
# Its keyframe is as long as six frames, and eight at a time are flushed: some have been by then, and more are on their way.
is_amid_it() {
  until (($(size_of_part) > 24 * frame_bytes)); do
    if is "$written" 1 >/dev/null; then
      echo "it has written already"
      return 1
    fi
  done
}
replays() { stereotrack replay "$1" --out "$2" >"$2.txt" 2>&1; }

case $1 in
  0)
    fact "what the service keeps is on a disk of its own" use_data_disk
    fact "the packages are installed" install_rig
    configure_scene 10.0 320x240 150.0 <<END
[record]
on = true
seconds = 10.0
seconds_after = 0.2
on_deadline = false
END
    fact "the service is to start with the board" systemctl enable stereotrackd
    sync
    fact "the service is ready" begin
    fact "it runs" runs 110
    echo "session $(session)" | tell
    fact "it is asked to record" ask_for_a_recording
    fact "and has written" eventually is "$written" 1
    cut_the_power
    ;;
  1)
    fact "with power again the service comes up by itself" eventually is_ready
    echo "READY $(property ActiveEnterTimestampMonotonic) us after the kernel began" | tell
    fact "in the next session" test "$(session)" = 2
    fact "what counted as written has its name" test "$(find $recordings -name '*-demand.strec' | wc -l)" = 1
    fact "nothing else is there" test "$(find $recordings -type f | wc -l)" = 1
    fact "it replays" replays "$(echo $recordings/*.strec)" /run/first
    fact "without a word of damage" sh -c '! grep -E "cut|damaged" /run/first.txt'
    tell </run/first.txt
    fact "it runs" runs 110
    # As an SD card that is worn: what the emulator takes at once is too fast to be cut.
    fact "its disk is slow" systemctl set-property --runtime stereotrackd 'IOWriteBandwidthMax=/dev/vdc 4M'
    fact "it is asked to record" ask_for_a_recording
    fact "and is amid it" is_amid_it
    cut_the_power
    ;;
  2)
    fact "it comes up once more" eventually is_ready
    fact "in the session after that" test "$(session)" = 3
    fact "the first recording is still there" test -e $recordings/*0000000000000001-*-demand.strec
    find $recordings -type f -printf '%f %s\n' | tell
    torn=$(echo $recordings/*0000000000000002-*.strec)
    fact "the one that was being written is there, under its name" test -e "$torn"
    fact "nothing half done is" test -z "$(find $recordings -name '*.part')"
    fact "it replays" replays "$torn" /run/torn
    tell </run/torn.txt
    # "... cut or damaged after byte A of B: read up to frame N (M frames)"
    read -r after all frames < <(sed -n 's/.*after byte \([0-9]*\) of \([0-9]*\): .*(\([0-9]*\) frames).*/\1 \2 \3/p' /run/torn.txt)
    fact "and it is said where it is cut" test -n "$frames"
    fact "what is lost of it is less than a frame" test $((all - after)) -lt $frame_bytes
    fact "it has most of what was written before the cut" test "${frames:-0}" -ge 8
    fact "all of these frames were replayed" test "$(grep -c . /run/torn/tracks.csv)" -gt 10
    fact "the service runs" runs 30
    fact "asked to record" ask_for_a_recording
    fact "it does" eventually is "$written" 1
    fact "the service ends" end
    journal
    finish
    ;;
esac
