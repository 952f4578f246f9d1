#!/usr/bin/env bash
# Debian 13's libgpiod 2 for arm64, so that our driver of GPIO lines is built against both of the library's interfaces
# and both are run on the board of Debian 12, which has libgpiod 1. It wants glibc 2.33: Debian 12 has 2.36.
#     FOLDER/include/gpiod.h
#     FOLDER/lib/libgpiod.so.3      with its link libgpiod.so
# From this machine's own Debian mirrors, asked for trixie. What is there is kept; remove FOLDER to fetch again.
#
#     toolchains/fetch_gpiod2.sh FOLDER
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
# shellcheck source=toolchains/debian_packages.sh
source "$here/debian_packages.sh"

(($# == 1)) || {
  echo "usage: fetch_gpiod2.sh FOLDER" >&2
  exit 2
}
mkdir -p "$(dirname "$1")"
folder=$(cd "$(dirname "$1")" && pwd)/$(basename "$1")
# One maker at a time: worktrees may share the folder.
exec 9>"$folder.lock"
flock 9
stamp=$(cat "$here/debian_packages.sh" "$here/fetch_gpiod2.sh" | sha256sum | cut -d ' ' -f 1)
if [[ -f $folder/stamp && $(<"$folder/stamp") == "$stamp" ]]; then exit 0; fi
rm -rf "$folder" "$folder.work"

echo "libgpiod 2: asking the mirrors for trixie"
debian_open "$folder.work/apt" trixie arm64
debian_download "$folder.work/debs" libgpiod3 libgpiod-dev
debian_close
debian_unpack "$folder.work/tree" "$folder.work"/debs/*.deb
mkdir -p "$folder/include" "$folder/lib"
cp "$folder.work/tree/usr/include/gpiod.h" "$folder/include/"
cp -L "$folder.work/tree/usr/lib/aarch64-linux-gnu/libgpiod.so.3" "$folder/lib/"
ln -s libgpiod.so.3 "$folder/lib/libgpiod.so"
rm -rf "$folder.work"
echo "$stamp" >"$folder/stamp"
