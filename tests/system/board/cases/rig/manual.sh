#!/bin/bash
# docs/BOARD.md, followed to the letter: each command of its blocks under "Install", "First start" and "Update, and back" is
# run as it stands there, as root, in a folder with the packages; its configuration, too, but for what is another board's:
# cameras, lines, cores and the receiver.
# wants: packages/stereotrack packages/stereotrack-tools packages/stereotrack-libcamera
# brings: docs/BOARD.md
# limit: 1500
# shellcheck source=tests/system/board/guest/tap.sh
source /payload/.board/tap.sh
# shellcheck source=tests/system/board/guest/rig.sh
source /payload/.board/rig.sh
page=/payload/.board/project/docs/BOARD.md
paired='stereotrack_pairing_total{verdict="paired"}'
mkdir /run/packages && cd /run/packages && cp /payload/*.deb . || exit

# SECTION NUMBER: of its indented blocks one.
block() {
  awk -v title="## $1" -v wanted="$2" '
    in_section && /^    ./ { if (!inside) number++; inside = 1; if (number == wanted) print substr($0, 5); next }
    { inside = 0 }
    /^## / { in_section = $0 == title }' "$page"
}
# CODES ANSWERS COMMAND: it ends with one of these codes; what it asks is answered in this order, the last one for ever.
ends_with() {
  local code
  # What follows for ever is left after some seconds of the board's.
  # shellcheck disable=SC2086  # several words
  timeout 100 bash -c "$3" < <(printf '%s\n' $2 && yes "${2##* }" 2>/dev/null) >/run/said.txt 2>&1
  code=$?
  tail -n 40 /run/said.txt
  echo "code $code"
  [[ $code =~ ^($1)$ ]]
}
# SECTION NUMBER ANSWERS: a fact of each line.
follow() {
  local command codes count=0
  while IFS= read -r command <&4; do
    command=${command%%  #*}
    codes=0
    case $command in
      # Limits of this board are told.
      *doctor*) codes='0|1' ;;
      *" -f") codes=124 ;;
    esac
    fact "\"$1\": ${command%"${command##*[! ]}"}" ends_with "$codes" "$3" "$command"
    { tail -n 12 /run/said.txt; echo; } | tell
    count=$((count + 1))
  done 4< <(block "$1" "$2")
  fact "block $2 of \"$1\" has commands" test $count -gt 0
}
# What is another board's: each wish is found in the page once, or the fact fails.
adapted() {
  local text wish from
  text=$(block Install 2)
  for wish in 'driver = "libcamera"|driver = "v4l2"' 'left.device = "0"|left.device = "bus:platform:vivid-000"' \
    'right.device = "1"|right.device = "bus:platform:vivid-001"' 'width = 728|width = 320' 'height = 544|height = 180' \
    'fps = 30.0|fps = 10.0' 'line = "pinctrl-rp1:GPIO17"|line = "rig:TRIGGER"' 'line = "pinctrl-rp1:GPIO22"|line = "rig:NEAR"' \
    'line = "pinctrl-rp1:GPIO27"|line = "rig:HEALTH"' 'frames.core = 3|frames.core = 1' 'publisher.core = 2|publisher.core = 0' \
    '"192.168.1.20:47800"|"127.0.0.1:47800"'; do
    from=${wish%|*}
    if (($(grep -cF -- "$from" <<<"$text") != 1)); then
      echo "not once in the page: $from" >&2
      return 1
    fi
    text=${text/"$from"/"${wish#*|}"}
  done
  # vivid stamps what it calls the end of a frame, and its two cameras run free; the figures are for this case.
  printf '%s\n[metrics]\nfile = "%s"\n' "${text/\[camera\]/$'[camera]\nreadout_us = 90000\ntolerance = 0.5'}" "$figures"
}
# VERSION: the package that is here, as that one, whose own configuration has changed, too.
make_version() {
  dpkg-deb -R stereotrack_OLD_arm64.deb /run/tree &&
    sed -i "s/^Version: .*/Version: $1/" /run/tree/DEBIAN/control &&
    echo '# another default' >>/run/tree/etc/stereotrack/stereotrackd.toml &&
    dpkg-deb --root-owner-group -Znone -b /run/tree stereotrack_NEW_arm64.deb
}
version_is() { [[ $(dpkg-query -W -f '${Version}' stereotrack) == "$1" ]]; }

follow Install 1 y
fact "nothing starts by that" test "$(systemctl is-active stereotrackd)" = inactive
plain_calibration /etc/stereotrack/calibration.yml 320 180
fact "the page's configuration, for the lines and cameras that are here" adapted
adapted >/etc/stereotrack/stereotrackd.toml
follow Install 3 y
fact "what the doctor wrote is a configuration" stereotrackd --config /tmp/rig.toml --check-config

follow "First start" 1 y
fact "it runs" eventually over "$paired" 5
fact "pulses are given" eventually over 'stereotrack_trigger_train_total{fate="given"}' 5
fact "its messages come" stereotrack monitor --count 10 --timeout 20

old=$(dpkg-query -W -f '${Version}' stereotrack)
mv stereotrack_"$old"_arm64.deb stereotrack_OLD_arm64.deb
fact "there is a newer package" make_version "$old+1"
process=$(property MainPID)
cp $configuration /run/mine.toml
# dpkg's question, whether to take the package's configuration.
follow "Update, and back" 1 n
fact "it is the newer one" version_is "$old+1"
fact "which runs" eventually over "$paired" 5
fact "as another process" test "$(property MainPID)" != "$process"
fact "the configuration is mine" cmp $configuration /run/mine.toml
fact "the new one's lies beside it" grep -q 'another default' $configuration.dpkg-dist
process=$(property MainPID)
# apt's, whether to go back; and dpkg's.
follow "Update, and back" 2 "y n"
fact "it is the old one" version_is "$old"
fact "which runs, too" eventually over "$paired" 5
fact "as another process again" test "$(property MainPID)" != "$process"
fact "the configuration is still mine" cmp $configuration /run/mine.toml
follow "Update, and back" 3 y
fact "nothing is left of it" test ! -e /etc/stereotrack/stereotrackd.toml -a ! -e $state
journalctl -u stereotrackd -o cat | tell
finish
