#!/usr/bin/env bash
# The board: Debian's own kernel and packages for arm64, unpacked only; Debian 13 (trixie) has the kernel with PREEMPT_RT.
#     FOLDER/vmlinuz     Debian's kernel
#     FOLDER/initrd.gz   loads the modules of the disk and goes on with it
#     FOLDER/root.ext4   Debian with systemd, udev, v4l-utils, gpiod, libcamera, our programs' libraries, modules; apt
#                        and dpkg know of all that, as on a board, and install, upgrade and remove without a network
#     FOLDER/id          changes with each of them
# Packages come from this machine's mirrors (toolchains/debian_packages.sh). Each part carries a stamp of what it is made
# of; what is there and fits is kept. Remove FOLDER to have newer packages.
#
#     tests/system/board/make_image.sh FOLDER {bookworm|trixie}
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
# shellcheck source=toolchains/debian_packages.sh
source "$here/../../../toolchains/debian_packages.sh"

packages=(base-files base-passwd bash dash coreutils util-linux bsdutils mount sed grep gawk findutils diffutils tar gzip
  hostname login libc-bin ncurses-bin perl-base usr-is-merged dpkg apt debconf init-system-helpers libpam-modules
  libpam-runtime systemd systemd-sysv udev kmod dbus procps iproute2 strace
  v4l-utils gpiod libcamera-tools libcamera-ipa curl
  # Cases read JSON by it.
  perl)
# What our programs are linked with.
packages+=(libstdc++6 libsodium23 libsystemd0)
case $#-${2:-} in
  2-bookworm) opencv=406 packages+=(libgpiod2 libhwy1 libyaml-cpp0.7 libcpp-httplib0.11) ;;
  2-trixie) opencv=410 packages+=(libgpiod3 libhwy1t64 libyaml-cpp0.8 libcpp-httplib0.18) ;;
  *)
    echo "usage: make_image.sh FOLDER {bookworm|trixie}" >&2
    exit 2
    ;;
esac
packages+=(libopencv-{core,imgproc,calib3d,imgcodecs,videoio}"$opencv")
debian=$2
modules=(virtio_console virtio_rng virtio_net configfs autofs4 vivid loop irq_sim gpio-sim v4l2loopback vimc)
if [[ $debian == trixie ]]; then modules+=(pwm-gpio board_pwm); fi
# Debian's kernel has the disk and its file system as modules.
disk_modules=(virtio_pci virtio_blk crc32c_generic ext4)

mkdir -p "$1"
folder=$(cd "$1" && pwd)
work=$folder/work
say() { echo "board: $*"; }
hash_of() { sha256sum | cut -d ' ' -f 1; }
is_made() { [[ -f $folder/$1.stamp && $(<"$folder/$1.stamp") == "$2" ]]; }
# Files in the image are root's, whoever makes it.
as_owner() { if ((EUID == 0)); then "$@"; else unshare --map-root-user "$@"; fi; }

# One maker at a time: worktrees may share the folder. Children do not hold the lock.
exec 9>"$folder/lock"
flock 9

kernel_stamp=$(echo "$debian" | cat - "$here/make_kernel.sh" "$here"/modules/* | hash_of)
tree_stamp=$(echo "$debian ${packages[*]}" | cat - "$here/../../../toolchains/debian_packages.sh" | hash_of)
image_stamp=$(echo "$kernel_stamp $tree_stamp" | cat - "$here/make_image.sh" "$here"/guest/{agent,devices,board-agent.service} | hash_of)

if ! is_made kernel "$kernel_stamp"; then
  rm -f "$folder/kernel.stamp"
  "$here/make_kernel.sh" "$folder/kernel" "$debian" 9>&-
  echo "$kernel_stamp" >"$folder/kernel.stamp"
fi

if ! is_made tree "$tree_stamp"; then
  rm -rf "$folder/tree.stamp" "$folder/tree" "$work"
  say "fetching Debian for the board"
  debian_open "$work/apt" "$debian" arm64
  debian_download_all "$work/debs" "${packages[@]}"
  debian_close
  say "unpacking $(find "$work/debs" -name '*.deb' | wc -l) packages"
  debian_install "$folder/tree" "$work"/debs/*.deb
  rm -rf "$work"
  echo "$tree_stamp" >"$folder/tree.stamp"
fi

if is_made image "$image_stamp"; then exit 0; fi
rm -rf "$folder/image.stamp" "$work"
say "making the disk"
release=$(basename "$folder"/kernel/tree/lib/modules/*)
tree=$work/tree
mkdir "$work"
# Links of files cost nothing; what is written below is removed first, or new.
cp -al "$folder/tree" "$tree"

# FILE: its text is what comes in; the file of the package stays as it is.
put() {
  mkdir -p "$(dirname "$tree/$1")"
  rm -f "$tree/$1"
  cat >"$tree/$1"
}
# What maintainer scripts would have done, as far as a board that boots needs it.
put etc/passwd <"$tree/usr/share/base-passwd/passwd.master"
put etc/group <"$tree/usr/share/base-passwd/group.master"
{
  grep -q '^_apt:' "$tree/usr/share/base-passwd/passwd.master" || echo "_apt:x:42:65534::/nonexistent:/usr/sbin/nologin"
  echo "messagebus:x:100:102::/nonexistent:/usr/sbin/nologin"
  echo "systemd-network:x:998:998::/:/usr/sbin/nologin"
} >>"$tree/etc/passwd"
printf '%s\n' messagebus:x:102: systemd-journal:x:999: systemd-network:x:998: render:x:997: kvm:x:996: sgx:x:995: \
  input:x:994: clock:x:993: >>"$tree/etc/group"
sed 's|^\([^:]*\):.*|\1:*:19000:0:99999:7:::|; s|^root:[^:]*:|root::|' "$tree/etc/passwd" | put etc/shadow
printf 'passwd: files\ngroup: files\nhosts: files dns\n' | put etc/nsswitch.conf
printf '127.0.0.1 localhost board\n' | put etc/hosts
echo board | put etc/hostname
put etc/fstab </dev/null
echo 0123456789abcdef0123456789abcdef | put etc/machine-id
[[ -e $tree/usr/bin/sh ]] || ln -s dash "$tree/usr/bin/sh"
[[ -e $tree/usr/bin/awk ]] || ln -s gawk "$tree/usr/bin/awk"
for name in blas lapack; do
  ln -sf "$name/lib$name.so.3" "$tree/usr/lib/aarch64-linux-gnu/lib$name.so.3"
done
mkdir -p "$tree"/{proc,sys,dev,run,tmp,root,mnt,payload,var/log/journal}
# Not asked for at each boot of an image that forgets what it did.
touch "$tree/etc/.updated" "$tree/var/.updated"
units=$tree/etc/systemd/system
for unit in systemd-random-seed systemd-update-utmp systemd-firstboot systemd-binfmt systemd-pstore getty@tty1 \
  serial-getty@ttyAMA0 systemd-hwdb-update ldconfig systemd-tpm2-setup systemd-tpm2-setup-early systemd-pcrphase; do
  ln -sf /dev/null "$units/$unit.service"
done
for unit in apt-daily apt-daily-upgrade dpkg-db-backup e2scrub_all fstrim; do ln -sf /dev/null "$units/$unit.timer"; done
put etc/systemd/journald.conf.d/board.conf <<'END'
[Journal]
Storage=volatile
RateLimitBurst=0
END
put etc/systemd/system/board-agent.service <"$here/guest/board-agent.service"
mkdir -p "$units/multi-user.target.wants"
ln -sf ../board-agent.service "$units/multi-user.target.wants/board-agent.service"
ln -sf /lib/systemd/system/multi-user.target "$units/default.target"
for name in agent devices; do
  put "usr/libexec/board/$name" <"$here/guest/$name"
  chmod 755 "$tree/usr/libexec/board/$name"
done

# Modules: those wanted and what they need.
with_needs() {
  local name
  for name in "$@"; do
    modprobe -d "$folder/kernel/tree" -S "$release" --show-depends "$name" | sed -n 's/^insmod \([^ ]*\).*/\1/p'
  done | awk '!seen[$0]++'
}
from=$folder/kernel/tree/lib/modules/$release
with_needs "${disk_modules[@]}" "${modules[@]}" >"$work/modules"
while read -r file; do install -D -m 644 "$file" "$tree/usr/lib/modules/$release/${file#"$from/"}"; done <"$work/modules"
cp "$from"/modules.{builtin,builtin.modinfo,order} "$tree/usr/lib/modules/$release/"
depmod -b "$tree" "$release"

# Room for what tests write; the file is sparse.
size=$(($(du -s -m --apparent-size "$tree" | cut -f 1) * 5 / 4 + 512))
truncate -s "${size}M" "$work/root.ext4"
as_owner mkfs.ext4 -q -F -O ^has_journal -E root_owner=0:0 -d "$tree" "$work/root.ext4"

initrd=$work/initrd
mkdir -p "$initrd"/{bin,dev,proc,sys,new,modules}
cp "$folder/kernel/busybox" "$initrd/bin/"
number=10
while read -r file; do
  name=$((number++))_$(basename "$file" .xz)
  case $file in
    *.xz) xz -dc "$file" >"$initrd/modules/$name" ;;
    *) cp "$file" "$initrd/modules/$name" ;;
  esac
done < <(with_needs "${disk_modules[@]}")
cat >"$initrd/init" <<'END'
#!/bin/busybox sh
b=/bin/busybox
$b mount -t proc proc /proc
$b mount -t sysfs sysfs /sys
$b mount -t devtmpfs devtmpfs /dev
for module in /modules/*; do $b insmod $module; done
until [ -b /dev/vda ]; do $b sleep 0.05; done
$b mount -t ext4 -o noatime /dev/vda /new
$b mount --move /dev /new/dev
$b umount /proc /sys
exec $b switch_root /new /lib/systemd/systemd
END
chmod +x "$initrd/init"
(cd "$initrd" && find . | cpio -o -H newc -R 0:0 --quiet | gzip -1) >"$work/initrd.gz"

# A board that runs keeps the file that it has open.
mv "$work/root.ext4" "$work/initrd.gz" "$folder/"
cp "$folder/kernel/vmlinuz" "$folder/vmlinuz"
echo "$image_stamp" >"$folder/id"
echo "$image_stamp" >"$folder/image.stamp"
rm -rf "$work"
say "the disk is made: $(du -m "$folder/root.ext4" | cut -f 1) MB"
