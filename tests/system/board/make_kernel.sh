#!/usr/bin/env bash
# Debian's kernel for arm64 with the modules that it leaves out, built from its source:
#     FOLDER/vmlinuz             the kernel
#     FOLDER/tree/lib/modules    all its modules, and in extra/ those of ours
#     FOLDER/busybox             static, for an initrd
#
#     tests/system/board/make_kernel.sh FOLDER      (make_image.sh calls it)
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
# shellcheck source=toolchains/debian_packages.sh
source "$here/../../../toolchains/debian_packages.sh"

series=6.1
cross=aarch64-linux-gnu-

(($# == 1)) || {
  echo "usage: make_kernel.sh FOLDER" >&2
  exit 2
}
rm -rf "$1"
mkdir -p "$1"
folder=$(cd "$1" && pwd)
work=$folder/work
mkdir "$work"
say() { echo "board: $*"; }

say "asking the mirrors for a kernel"
machine=$(dpkg --print-architecture)
debian_open "$work/apt" own arm64 "$machine"
release=$(apt-cache depends linux-image-arm64 | sed -n 's/^ *Depends: linux-image-//p')
[[ $release == "$series".* ]] || {
  echo "make_kernel.sh: the mirrors' kernel for arm64 is '$release', this script builds modules for $series (Debian 12)" >&2
  exit 1
}
say "fetching Linux $release and its source"
# What the headers' build calls runs on this machine: kbuild is of its architecture.
debian_download "$work/debs" "linux-image-$release" "linux-headers-$release" "linux-headers-${release%-arm64}-common" \
  "linux-kbuild-$series:$machine" "linux-source-$series" v4l2loopback-dkms busybox-static
debian_close
debian_unpack "$work/tree" "$work"/debs/{linux-image,linux-headers,linux-kbuild,v4l2loopback-dkms,busybox-static}*.deb
cp "$work/tree/boot/vmlinuz-$release" "$folder/vmlinuz"
cp "$work/tree/usr/bin/busybox" "$folder/busybox"
mkdir -p "$folder/tree/lib"
mv "$work/tree/usr/lib/modules" "$folder/tree/lib/"

say "building irq_sim, gpio-sim, vimc, v4l2loopback"
source=linux-source-$series
dpkg-deb --fsys-tarfile "$work"/debs/"$source"*.deb | tar -xO "./usr/src/$source.tar.xz" | xz -dc -T2 |
  tar -x -C "$work" --wildcards "$source/drivers/gpio/*" "$source/drivers/media/test-drivers/vimc/*" "$source/kernel/irq/*"
mkdir "$work/modules"
cp "$work/$source"/kernel/irq/irq_sim.c "$work/$source"/drivers/gpio/{gpio-sim.c,gpiolib.h} \
  "$work"/tree/usr/src/v4l2loopback-*/*.[ch] "$here/modules/Kbuild" "$work/modules/"
cp -r "$work/$source/drivers/media/test-drivers/vimc" "$work/modules/vimc"
cp "$here/modules/Kbuild.vimc" "$work/modules/vimc/Makefile"
python3 "$here/modules/adapt.py" "$work/modules"
headers=$work/tree/usr/src/linux-headers-$release
sed -i "s|/usr/src/|$work/tree/usr/src/|" "$headers/Makefile"
make -C "$headers" M="$work/modules" ARCH=arm64 CROSS_COMPILE="$cross" modules -j2 >"$work/make.log" 2>&1 || {
  cat "$work/make.log" >&2
  echo "make_kernel.sh: modules of Linux $release do not build" >&2
  exit 1
}
extra=$folder/tree/lib/modules/$release/extra
mkdir "$extra"
cp "$work"/modules/*.ko "$work"/modules/vimc/vimc.ko "$extra/"
"${cross}strip" --strip-debug "$extra"/*.ko
depmod -b "$folder/tree" "$release"
rm -rf "$work"
