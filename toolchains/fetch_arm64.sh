#!/usr/bin/env bash
# What a cross build of our own code for 64-bit ARM needs and the cross compiler's packages do not bring, taken from
# this machine's own Debian mirrors:
#     FOLDER/root             arm64 packages of our libraries, only unpacked
#     FOLDER/qemu-plugin.h    out of the source of the qemu-aarch64 that is installed here
# What is already there is kept; remove FOLDER to fetch again. For all programs, with OpenCV: make_sysroot.sh.
#
#     toolchains/fetch_arm64.sh FOLDER
set -euo pipefail
# shellcheck source=toolchains/debian_packages.sh
source "$(dirname "${BASH_SOURCE[0]}")/debian_packages.sh"

packages=(libhwy1 libhwy-dev libgtest-dev libgmock-dev libeigen3-dev libexpected-dev libcli11-dev libtomlplusplus-dev
  libnanopb-dev libsodium23 libsodium-dev)

(($# == 1)) || {
  echo "usage: fetch_arm64.sh FOLDER" >&2
  exit 2
}
mkdir -p "$1"
folder=$(cd "$1" && pwd)
version=$(dpkg-query -W -f '${source:Version}' qemu-user)
stamp="${packages[*]} qemu $version"
if [[ -f $folder/stamp && $(<"$folder/stamp") == "$stamp" ]]; then exit 0; fi
rm -rf "$folder/root" "$folder/stamp" "$folder/download"

echo "arm64: asking the mirrors"
debian_open "$folder/apt" own arm64
echo "arm64: fetching ${packages[*]}, and the source of qemu $version for one header"
debian_download "$folder/download" "${packages[@]}"
debian_unpack "$folder/root" "$folder/download"/*.deb
debian_source "$folder/download" "qemu=$version"
tar -xf "$folder/download"/qemu_*.orig.tar.* --wildcards -O '*/include/qemu/qemu-plugin.h' >"$folder/qemu-plugin.h"
debian_close
rm -rf "$folder/download"
echo "$stamp" >"$folder/stamp"
