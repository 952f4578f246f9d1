#!/bin/bash
# apt and dpkg know what the board has: packages are installed, upgraded, removed and purged as on any Debian, without a
# network, and scripts of theirs find what they call. The package is made here, with a service, a user, a configuration.
# limit: 600
# shellcheck source=tests/system/board/guest/tap.sh
source /payload/.board/tap.sh

export DEBIAN_FRONTEND=noninteractive
cd /run || exit
proof=board-proof
conf=/etc/$proof.conf

# VERSION [DEPENDS]: the package, as NAME_VERSION.deb; its configuration is another in each version.
make_package() {
  local tree=/run/make
  rm -rf "$tree"
  mkdir -p "$tree"/{DEBIAN,etc,usr/lib/{sysusers.d,systemd/system,udev/rules.d}}
  cat >"$tree/DEBIAN/control" <<TEXT
Package: $proof
Version: $1
Architecture: arm64
Maintainer: Board <board@example.org>
Depends: ${2:-libsodium23, libhwy1 | libhwy1t64, systemd}
Description: shows that packages are installed
TEXT
  echo "$conf" >"$tree/DEBIAN/conffiles"
  echo "activate-noawait ldconfig" >"$tree/DEBIAN/triggers"
  echo "version $1" >"$tree$conf"
  echo "u $proof - \"Board\"" >"$tree/usr/lib/sysusers.d/$proof.conf"
  echo "SUBSYSTEM==\"gpio\", GROUP=\"$proof\", MODE=\"0660\"" >"$tree/usr/lib/udev/rules.d/60-$proof.rules"
  printf '[Service]\nType=exec\nUser=%s\nExecStart=/bin/sleep infinity\n[Install]\nWantedBy=multi-user.target\n' "$proof" \
    >"$tree/usr/lib/systemd/system/$proof.service"
  cat >"$tree/DEBIAN/postinst" <<TEXT
#!/bin/sh
set -e
[ "\$1" = configure ] || exit 0
systemd-sysusers $proof.conf
udevadm control --reload
udevadm trigger --subsystem-match=gpio --settle
deb-systemd-helper enable $proof.service
systemctl daemon-reload
deb-systemd-invoke restart $proof.service
TEXT
  cat >"$tree/DEBIAN/prerm" <<TEXT
#!/bin/sh
set -e
[ "\$1" != remove ] || deb-systemd-invoke stop $proof.service
TEXT
  cat >"$tree/DEBIAN/postrm" <<TEXT
#!/bin/sh
set -e
[ "\$1" != remove ] || systemctl daemon-reload
[ "\$1" != purge ] || deb-systemd-helper purge $proof.service
TEXT
  chmod 755 "$tree"/DEBIAN/{postinst,prerm,postrm}
  dpkg-deb --root-owner-group -Znone --build "$tree" "/run/${proof}_$1.deb"
}
nothing_is_half_done() { [[ -z $(dpkg --audit) ]] && apt-get check; }
state() { dpkg-query -W -f '${db:Status-Abbrev}${Version}\n' "$proof" | tr -d ' '; }
is_state() { [[ $(state) == "$1" ]] || { echo "it is $(state)"; return 1; }; }
says() { grep -qx "$1" "$conf"; }
not() { ! "$@"; }
# VERSION [OPTION...]
install() { apt-get install -y "${@:2}" "./${proof}_$1.deb"; }
refused() { ! install "$1" >/run/refused 2>&1 && grep -q "Depends: nothing-like-it" /run/refused; }
ldconfig_ran() { grep -q 'Processing triggers for libc-bin' /run/installed; }
installs() { install 1 >/run/installed 2>&1 || { cat /run/installed; return 1; }; }
owner_of() { dpkg -S "$1" | grep -q "^$2:"; }

fact "nothing that the image has is half installed or lacks what it depends on" nothing_is_half_done
fact "dpkg knows of which package a file is" owner_of /usr/lib/aarch64-linux-gnu/libsodium.so.23 libsodium23
fact "a package is made" make_package 1
fact "apt installs it without a network" installs
fact "it is installed" is_state ii1
fact "libraries are looked up again" ldconfig_ran
fact "its service runs" systemctl is-active --quiet "$proof"
fact "its service starts at boot" systemctl is-enabled --quiet "$proof"
fact "its user is there" getent passwd "$proof"
fact "its rule gives the lines to its group" test "$(stat -c %G /dev/gpiochip1)" = "$proof"

main_pid=$(systemctl show "$proof" -p MainPID --value)
echo "mine" >>"$conf"
make_package 2 >/dev/null
fact "apt upgrades it" install 2 -o Dpkg::Options::=--force-confdef -o Dpkg::Options::=--force-confold
fact "it is the new one" is_state ii2
fact "what was changed in its configuration stays" says mine
fact "the new configuration lies beside it" test -e "$conf.dpkg-dist"
fact "its service was restarted" test "$(systemctl show "$proof" -p MainPID --value)" != "$main_pid"

make_package 3 nothing-like-it >/dev/null
fact "apt refuses what depends on what is not there, and says so" refused 3
fact "the old one is untouched" is_state ii2

fact "apt removes it" apt-get remove -y "$proof"
fact "its configuration is kept" is_state rc2
fact "its service is gone" not systemctl is-active --quiet "$proof"
fact "dpkg installs it" dpkg --force-confold -i "./${proof}_1.deb"
fact "with the configuration that was kept" says mine
fact "apt purges it" apt-get purge -y "$proof"
fact "its configuration is gone" test ! -e "$conf"
fact "nothing is half done at the end" nothing_is_half_done
finish
