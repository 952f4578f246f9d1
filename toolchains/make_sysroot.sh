#!/usr/bin/env bash
# A sysroot: all libraries and headers that our programs and tests are built with, of a Debian for another architecture,
# from this machine's own mirrors and only unpacked. What is there is kept; remove FOLDER to have newer packages.
#
#     toolchains/make_sysroot.sh NAME [FOLDER]
#         NAME      bookworm-arm64 (Debian 12), bookworm-armhf, trixie-arm64 (Debian 13), trixie-armhf
#         FOLDER    build/sysroots/NAME if not told, or $STEREOTRACK_BOARD_CACHE/sysroots/NAME
#     toolchains/make_sysroot.sh --where NAME      says that folder, and makes nothing
#
# Its var/lib/dpkg tells which package each file is of and what who needs a library depends on, as dpkg knows it of a
# machine: dpkg-query --admindir=FOLDER/var/lib/dpkg -S FILE, info/PACKAGE:ARCHITECTURE.{shlibs,symbols}.
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
# shellcheck source=toolchains/debian_packages.sh
source "$here/debian_packages.sh"

usage() {
  echo "usage: make_sysroot.sh [--where] {bookworm,trixie}-{arm64,armhf} [FOLDER]" >&2
  exit 2
}
only_where=0
if [[ ${1:-} == --where ]]; then
  only_where=1
  shift
fi
name=${1:-}
case $name in
  bookworm-*) release=bookworm gcc=12 ;;
  trixie-*) release=trixie gcc=14 ;;
  *) usage ;;
esac
case $name in
  *-arm64) architecture=arm64 triplet=aarch64-linux-gnu ;;
  *-armhf) architecture=armhf triplet=arm-linux-gnueabihf ;;
  *) usage ;;
esac
case $# in
  1) folder=${STEREOTRACK_BOARD_CACHE:-$here/../build}/sysroots/$name ;;
  2) folder=$2 ;;
  *) usage ;;
esac
folder=$(realpath -m "$folder")
if ((only_where)); then
  echo "$folder"
  exit
fi

packages=(libc6-dev "libstdc++-$gcc-dev" libopencv-dev libeigen3-dev libexpected-dev libhwy-dev libtomlplusplus-dev
  libcli11-dev nlohmann-json3-dev libyaml-cpp-dev libsodium-dev libsystemd-dev libcpp-httplib-dev libgpiod-dev
  libnanopb-dev libcamera-dev libgtest-dev libgmock-dev)

mkdir -p "$(dirname "$folder")"
# One maker at a time: worktrees may share the folder.
exec 9>"$folder.lock"
flock 9
stamp=$(echo "$name" | cat - "$here/debian_packages.sh" "$here/make_sysroot.sh" | sha256sum | cut -d ' ' -f 1)
if [[ -f $folder/stamp && $(<"$folder/stamp") == "$stamp" ]]; then exit 0; fi
rm -rf "$folder" "$folder.work"

echo "sysroot: fetching OpenCV, all that it wants, and our other libraries: $name"
debian_open "$folder.work/apt" "$release" "$architecture"
debian_download_all "$folder.work/debs" "${packages[@]}"
debian_close
echo "sysroot: unpacking $(find "$folder.work/debs" -name '*.deb' | wc -l) packages"
debian_install "$folder" "$folder.work"/debs/*.deb
echo "$architecture" >"$folder/var/lib/dpkg/arch"
# Programs of theirs do not run here.
rm -rf "$folder.work" "${folder:?}"/usr/{bin,sbin,share/{fonts,icons,perl,vim}}

# Absolute links would lead out of the sysroot.
find "$folder" -type l -lname '/*' -printf '%P\t%l\n' | while IFS=$'\t' read -r link target; do
  ln -sfn "$(realpath -m --relative-to="$folder/$(dirname "$link")" "$folder$target")" "$folder/$link"
done
# Of update-alternatives, which unpacking does not run.
for library in blas lapack; do
  ln -sfn "$library/lib$library.so.3" "$folder/usr/lib/$triplet/lib$library.so.3"
done
echo "$stamp" >"$folder/stamp"
echo "sysroot: $(du -s -m "$folder" | cut -f 1) MB"
