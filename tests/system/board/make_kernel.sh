#!/usr/bin/env bash
# Debian's kernel for arm64 with the modules that it leaves out, built from its source. Of Debian 13 that with PREEMPT_RT:
#     FOLDER/vmlinuz             the kernel
#     FOLDER/tree/lib/modules    all its modules, and in extra/ those of ours
#     FOLDER/busybox             static, for an initrd
#
#     tests/system/board/make_kernel.sh FOLDER {bookworm|trixie}      (make_image.sh calls it)
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
# shellcheck source=toolchains/debian_packages.sh
source "$here/../../../toolchains/debian_packages.sh"

cross=aarch64-linux-gnu-

case $#-${2:-} in
  2-bookworm) series=6.1 flavour='' pwm=() ;;
  2-trixie) series=6.12 flavour=-rt pwm=(drivers/pwm/pwm-gpio.c) ;;
  *)
    echo "usage: make_kernel.sh FOLDER {bookworm|trixie}" >&2
    exit 2
    ;;
esac
rm -rf "$1"
mkdir -p "$1"
folder=$(cd "$1" && pwd)
work=$folder/work
mkdir "$work"
say() { echo "board: $*"; }

say "asking the mirrors for a kernel"
machine=$(dpkg --print-architecture)
debian_open "$work/apt" "$2" arm64 "$machine"
release=$(apt-cache depends "linux-image$flavour-arm64" | sed -n 's/^ *Depends: linux-image-//p')
[[ $release == "$series".* ]] || {
  echo "make_kernel.sh: the mirrors' kernel of $2 for arm64 is '$release', this script builds modules for $series" >&2
  exit 1
}
say "fetching Linux $release and its source"
# What the headers' build calls runs on this machine: kbuild is of its architecture. What reads the modules runs by the C
# library of its own Debian, which may be newer than this machine's.
version=${release%"$flavour-arm64"}
kbuild=$(apt-cache depends "linux-headers-$release" | sed -n 's/^ *Depends: \(linux-kbuild-[^:]*\)$/\1/p')
debian_download "$work/debs" "linux-image-$release" "linux-headers-$release" "linux-headers-$version-common$flavour" \
  "$kbuild:$machine" "libc6:$machine" "linux-source-$series" v4l2loopback-dkms busybox-static
debian_close
debian_unpack "$work/tree" "$work"/debs/{linux-image,linux-headers,linux-kbuild,v4l2loopback-dkms,busybox-static}*.deb
debian_unpack "$work/host" "$work"/debs/libc6*.deb
cp "$work/tree/boot/vmlinuz-$release" "$folder/vmlinuz"
cp "$work/tree/usr/bin/busybox" "$folder/busybox"
mkdir -p "$folder/tree/lib"
mv "$work/tree/usr/lib/modules" "$folder/tree/lib/"

say "building irq_sim, gpio-sim, vimc, v4l2loopback${pwm:+, pwm-gpio}"
source=linux-source-$series
dpkg-deb --fsys-tarfile "$work"/debs/"$source"*.deb | tar -xO "./usr/src/$source.tar.xz" | xz -dc -T2 |
  tar -x -C "$work" --wildcards "$source/drivers/gpio/*" "$source/drivers/media/test-drivers/vimc/*" "$source/kernel/irq/*" \
    "${pwm[@]/#/$source/}"
mkdir "$work/modules"
cp "$work/$source"/kernel/irq/irq_sim.c "$work/$source"/drivers/gpio/{gpio-sim.c,gpiolib.h} \
  "$work"/tree/usr/src/v4l2loopback-*/*.[ch] "$here/modules/Kbuild" "$work/modules/"
if ((${#pwm[@]})); then cp "$work/$source/${pwm[0]}" "$here/modules/board_pwm.c" "$work/modules/"; fi
cp -r "$work/$source/drivers/media/test-drivers/vimc" "$work/modules/vimc"
cp "$here/modules/Kbuild.vimc" "$work/modules/vimc/Makefile"
cp "$here/modules/vimc-exposure.h" "$work/modules/vimc/"
python3 "$here/modules/adapt.py" "$work/modules"
headers=$work/tree/usr/src/linux-headers-$release
sed -i "s|/usr/src/|$work/tree/usr/src/|" "$headers/Makefile"
# GCC before 13 lacks an option that only speed asks for; modules without type information need no pahole (in autoconf.h
# that line would change the layout of a module).
sed -i '/CONFIG_CC_HAS_MIN_FUNCTION_ALIGNMENT/d' "$headers"/include/{config/auto.conf,generated/autoconf.h}
sed -i '/CONFIG_DEBUG_INFO_BTF_MODULES/d' "$headers/include/config/auto.conf"
libraries=$(dirname "$(find "$work/host/usr/lib" -name libc.so.6)")
loader=$(find "$work/host/usr/" -name 'ld-linux-*' | head -n 1)
find "$work"/tree/usr/lib/linux-kbuild-* -type f -name '*.real-*' | while read -r program; do
  mv "$program" "$program.elf"
  printf '#!/bin/sh\nexec %q --library-path %q %q "$@"\n' "$loader" "$libraries" "$program.elf" >"$program"
  chmod +x "$program"
done
make -C "$headers" M="$work/modules" ARCH=arm64 CROSS_COMPILE="$cross" CC="${cross}gcc" modules -j2 >"$work/make.log" 2>&1 || {
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
