#!/bin/bash
# The two cameras that the drivers are tested with, by means of v4l-utils alone.
# shellcheck source=tests/system/board/guest/tap.sh
source /payload/.board/tap.sh

capture() { v4l2-ctl -d "$1" --verbose --stream-mmap=4 --stream-count="$2" >"/run/results/capture$1.txt" 2>&1; }
# DEVICE COUNT: as many frames, numbered without a gap. The clock is that of instructions: no host disturbs it.
numbered_without_gap() {
  sed -n 's/^cap dqbuf.* seq: *\([0-9]*\).*/\1/p' "/run/results/capture$1.txt" |
    awk -v want="$2" 'NR > 1 && $1 != last + 1 { print "gap before", $1; bad = 1 } { last = $1 } END {
      if (NR != want) print NR, "frames"; exit bad || NR != want }'
}
monotonic() { [[ $(grep -c 'ts-monotonic' "/run/results/capture$1.txt") -gt 0 ]]; }
median_period_is_40_ms() {
  sed -n 's/.*delta: \([0-9.]*\) ms.*/\1/p' "/run/results/capture$1.txt" | sort -n |
    awk '{ a[NR] = $1 } END { print a[int((NR + 1) / 2)]; exit a[int((NR + 1) / 2)] < 39.5 || a[int((NR + 1) / 2)] > 40.5 }'
}
both_at_once() {
  local left
  capture 0 50 &
  left=$!
  capture 1 50 && wait "$left"
}
gone_while_streaming() {
  v4l2-ctl -d0 --verbose --stream-mmap=4 --stream-count=1000 >/run/results/gone.txt 2>&1 &
  local reader=$!
  eventually grep -q 'cap dqbuf.* seq: *5 ' /run/results/gone.txt || return
  echo vivid.0 >/sys/bus/platform/drivers/vivid/unbind
  wait "$reader"
  grep -E 'DQBUF.*(Invalid argument|No such device)' /run/results/gone.txt
}
back_again() {
  echo vivid.0 >/sys/bus/platform/drivers/vivid/bind && eventually test -c /dev/video0 && capture 0 5 &&
    numbered_without_gap 0 5
}
# v4l2-ctl ends with 0, whatever became of the streaming.
injected() {
  v4l2-ctl -d1 -c inject_vidioc_streamon_error=1
  capture 1 5
  grep 'STREAMON returned -1 (Invalid argument)' /run/results/capture1.txt && capture 1 5 && numbered_without_gap 1 5
}

for device in 0 1; do
  fact "camera $device takes 640x480 GREY at 25 frames a second" \
    v4l2-ctl -d$device -v width=640,height=480,pixelformat=GREY -p 25
done
fact "both give 50 frames at once" both_at_once
for device in 0 1; do
  fact "camera $device numbers its frames without a gap" numbered_without_gap $device 50
  fact "camera $device stamps them with the monotonic clock" monotonic $device
  fact "camera $device gives one each 40 ms" median_period_is_40_ms $device
done
fact "an error that is injected is seen once" injected
fact "a camera that is unplugged ends its reader" gone_while_streaming
fact "its device is gone" test ! -e /dev/video0
fact "plugged in again it gives frames" back_again
finish
