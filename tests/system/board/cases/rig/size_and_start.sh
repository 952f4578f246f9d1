#!/bin/bash
# What the daemon takes of a board: its size and that of its libraries, its memory at two picture sizes, the time until it is
# READY, and from power on to the first target. The figures stand in /run/results/size_and_start.txt and in docs/SERVICE.md.
# wants: packages/stereotrack packages/stereotrack-tools
# limit: 600
# power cuts: 1
# shellcheck source=tests/system/board/guest/tap.sh
source /payload/.board/tap.sh
# shellcheck source=tests/system/board/guest/rig.sh
source /payload/.board/rig.sh

measured() { tee -a /run/results/size_and_start.txt | tell; }
libraries() { ldd "$1" | sed -n 's/.* => \([^ ]*\) .*/\1/p'; }
# Standard input: files.
size_of_all() { xargs -d '\n' stat -L -c %s | awk '{ sum += $1 } END { printf "%.1f MB", sum / 1e6 }'; }
size_of() {
  echo "$(basename "$1"): $(size_of_all <<<"$1"), and $(libraries "$1" | wc -l) libraries of $(libraries "$1" | size_of_all)"
}
is_lean() { ! libraries /usr/bin/stereotrackd | grep -E 'videoio|imgcodecs|highgui|gdal|gstreamer|avcodec|gtk|Qt'; }
held() { awk -v key="$1:" '$1 == key { printf "%.1f MB", $2 / 1024 }' "/proc/$(property MainPID)/status"; }

# SIZE WIDTH HEIGHT: two cameras of vivid's, of a size that they have.
cameras_at() {
  plain_calibration /etc/stereotrack/calibration.yml "$1" "$2"
  configure <<END
[source]
name = "cameras"
[camera]
left.device = "/dev/video0"
right.device = "/dev/video1"
width = $1
height = $2
format = "grey8"
fps = $3
tolerance = 0.5
[calibration]
file = "/etc/stereotrack/calibration.yml"
[latency]
output_ms = 900.0
END
}
# PATH SIZE...: the scene, or what was recorded of it.
plays() {
  configure_scene 5.0 320x240 190.0 "$1" <<END
[record]
on = true
seconds = 5.0
seconds_after = 0.2
on_deadline = false
END
}
recording() { echo $recordings/*-demand.strec; }
# Of the last start of the kernel [s].
first_target_after() { journalctl -b -u stereotrackd -o short-monotonic | sed -n 's/^\[ *\([0-9.]*\)\].*: target .* is there.*/\1/p' | head -n 1; }
is_under() { awk -v is="$1" -v most="$2" 'BEGIN { print is ", at most " most; exit !(is != "" && is + 0 <= most) }'; }

case $1 in
  0)
    fact "what the service keeps is on a disk of its own" use_data_disk
    fact "the packages are installed" install_rig
    size_of /usr/bin/stereotrackd | measured
    size_of /usr/bin/stereotrack | measured
    fact "the daemon is linked with nothing that reads pictures, plays videos or opens windows" is_lean
    for size in "640 480" "1280 720"; do
      read -r width height <<<"$size"
      cameras_at "$width" "$height" 1.0
      fact "on two cameras of ${width}x$height the service is ready" begin
      fact "and runs" runs 2
      echo "${width}x$height, grey, two cameras: $(held VmRSS) resident, of them $(held RssFile) of files and $(held VmLck) locked; READY after $(($(ready_after_us) / 1000)) ms" | measured
      fact "it ends" end
    done

    plays synthetic:eleven
    fact "on a scene the service is ready" begin
    fact "it runs" runs 40
    fact "it is asked to record" ask_for_a_recording
    fact "it does" eventually is 'stereotrack_recordings_total{fate="written"}' 1
    fact "it ends" end
    plays "$(recording)"
    fact "what it recorded is played with the next start of the board" systemctl enable stereotrackd
    sync
    cut_the_power
    ;;
  1)
    fact "with power the service comes up by itself" eventually is_ready
    fact "and tells its first target" eventually first_target_after
    ready=$(property ActiveEnterTimestampMonotonic)
    echo "from the kernel's start: READY after $(awk -v us="$ready" 'BEGIN { printf "%.1f", us / 1e6 }') s, the first target after $(first_target_after) s" | measured
    fact "the first target comes soon after READY" is_under "$(first_target_after)" "$((ready / 1000000 + 6))"
    fact "the service ends" end
    journal
    finish
    ;;
esac
