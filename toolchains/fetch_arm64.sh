#!/usr/bin/env bash
# What a cross build for 64-bit ARM needs and the cross compiler's packages do not bring, taken from this machine's own
# Debian mirrors:
#     FOLDER/root             arm64 packages of our libraries, only unpacked
#     FOLDER/qemu-plugin.h    out of the source of the qemu-aarch64 that is installed here
# Nothing of this machine changes: apt works with lists, a cache and a status of its own below FOLDER. What is already
# there is kept; remove FOLDER to fetch again.
#
#     toolchains/fetch_arm64.sh FOLDER
set -euo pipefail

packages=(libhwy1 libhwy-dev libgtest-dev libgmock-dev libeigen3-dev libexpected-dev libcli11-dev libtomlplusplus-dev
  libnanopb-dev libsodium23 libsodium-dev)

(($# == 1)) || {
  echo "usage: fetch_arm64.sh FOLDER" >&2
  exit 2
}
mkdir -p "$1"
folder=$(cd "$1" && pwd)
apt=$folder/apt
version=$(dpkg-query -W -f '${source:Version}' qemu-user)
stamp="${packages[*]} qemu $version"
if [[ -f $folder/stamp && $(<"$folder/stamp") == "$stamp" ]]; then exit 0; fi
rm -rf "$folder/root" "$apt" "$folder/stamp"
mkdir -p "$folder/root" "$apt"/{etc/sources.list.d,etc/parts,etc/preferences.d,lists/partial,cache/archives/partial,download}
: >"$apt/status"

# The mirrors and keys of this machine, asked for sources, too. Its proxies count; its hooks do not.
for file in /etc/apt/sources.list /etc/apt/sources.list.d/*; do
  if [[ -f $file ]]; then
    sed -E -e 's/^Types:.*/Types: deb deb-src/' -e '/^deb-src /d' -e 's/^deb (.*)/deb \1\ndeb-src \1/' "$file" \
      >"$apt/etc/${file#/etc/apt/}"
  fi
done
{
  apt-config dump | grep -E '^Acquire::(https?|ftp|Check)' || true
  cat <<END
APT::Architecture "arm64";
APT::Architectures { "arm64"; };
APT::Sandbox::User "";
Acquire::Languages "none";
Dir::Etc "$apt/etc";
Dir::Etc::parts "parts";
Dir::Etc::trusted "/etc/apt/trusted.gpg";
Dir::Etc::trustedparts "/etc/apt/trusted.gpg.d";
Dir::State "$apt";
Dir::State::lists "$apt/lists";
Dir::State::status "$apt/status";
Dir::Cache "$apt/cache";
END
} >"$apt/apt.conf"
# Only what this file says: apt reads it before the machine's own, whose folder is then another.
export APT_CONFIG=$apt/apt.conf

echo "arm64: asking the mirrors"
# A mirror of somebody else may have nothing for arm64; what matters is whether the packages come.
apt-get update -q >"$apt/update.log" 2>&1 || true
cd "$apt/download"
echo "arm64: fetching ${packages[*]}, and the source of qemu $version for one header"
apt-get download -q "${packages[@]}" >"$apt/download.log" 2>&1 || {
  cat "$apt/update.log" "$apt/download.log" >&2
  echo "fetch_arm64.sh: a package did not come" >&2
  exit 1
}
for package in *.deb; do dpkg-deb -x "$package" "$folder/root"; done
apt-get source -q --download-only --only-source "qemu=$version" >"$apt/source.log" 2>&1 || {
  cat "$apt/update.log" "$apt/source.log" >&2
  echo "fetch_arm64.sh: the source of qemu $version did not come" >&2
  exit 1
}
tar -xf qemu_*.orig.tar.* --wildcards -O '*/include/qemu/qemu-plugin.h' >"$folder/qemu-plugin.h"
rm -rf "$apt"
echo "$stamp" >"$folder/stamp"
