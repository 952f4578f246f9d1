#!/usr/bin/env bash
# The header of plugins of the qemu-user that is installed here, out of its source: Debian packages none. What is there
# is kept; remove FOLDER to fetch again.
#     FOLDER/qemu-plugin.h
#
#     toolchains/fetch_qemu_plugin.sh FOLDER
set -euo pipefail
# shellcheck source=toolchains/debian_packages.sh
source "$(dirname "${BASH_SOURCE[0]}")/debian_packages.sh"

(($# == 1)) || {
  echo "usage: fetch_qemu_plugin.sh FOLDER" >&2
  exit 2
}
mkdir -p "$1"
folder=$(cd "$1" && pwd)
version=$(dpkg-query -W -f '${source:Version}' qemu-user)
if [[ -f $folder/stamp && $(<"$folder/stamp") == "$version" ]]; then exit 0; fi
rm -rf "$folder/stamp" "$folder/download"

echo "qemu: fetching the source of $version for one header"
debian_open "$folder/apt" own "$(dpkg --print-architecture)"
debian_source "$folder/download" "qemu=$version"
tar -xf "$folder/download"/qemu_*.orig.tar.* --wildcards -O '*/include/qemu/qemu-plugin.h' >"$folder/qemu-plugin.h"
debian_close
rm -rf "$folder/download"
echo "$version" >"$folder/stamp"
