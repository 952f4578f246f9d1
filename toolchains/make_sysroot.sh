#!/usr/bin/env bash
# All libraries and headers of a cross build of every program for 64-bit ARM, taken from this machine's own Debian mirrors
# and only unpacked: FOLDER is a sysroot. What is there is kept; remove FOLDER to fetch again. For the part that needs no
# OpenCV fetch_arm64.sh is enough, and much smaller.
#
#     toolchains/make_sysroot.sh FOLDER
#     cmake --preset aarch64-board -DSTEREOTRACK_SYSROOT=FOLDER
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
# shellcheck source=toolchains/arm64_packages.sh
source "$here/arm64_packages.sh"

packages=(libc6-dev libstdc++-12-dev libopencv-dev libeigen3-dev libexpected-dev libhwy-dev libtomlplusplus-dev
  libcli11-dev nlohmann-json3-dev libyaml-cpp-dev libsodium-dev libsystemd-dev libcpp-httplib-dev libgpiod-dev
  libnanopb-dev libcamera-dev libgtest-dev libgmock-dev)

(($# == 1)) || {
  echo "usage: make_sysroot.sh FOLDER" >&2
  exit 2
}
mkdir -p "$(dirname "$1")"
folder=$(cd "$(dirname "$1")" && pwd)/$(basename "$1")
# One maker at a time: worktrees may share the folder.
exec 9>"$folder.lock"
flock 9
stamp=$(echo "${packages[*]}" | cat - "$here/arm64_packages.sh" "$here/make_sysroot.sh" | sha256sum | cut -d ' ' -f 1)
if [[ -f $folder/stamp && $(<"$folder/stamp") == "$stamp" ]]; then exit 0; fi
rm -rf "$folder" "$folder.work"

echo "sysroot: fetching OpenCV, all that it wants, and our other libraries for arm64"
arm64_open "$folder.work/apt"
arm64_download_all "$folder.work/debs" "${packages[@]}"
arm64_close
echo "sysroot: unpacking $(find "$folder.work/debs" -name '*.deb' | wc -l) packages"
arm64_unpack "$folder" "$folder.work"/debs/*.deb
# Programs of theirs do not run here.
rm -rf "$folder.work" "${folder:?}"/usr/{bin,sbin,share/{fonts,icons,perl,vim}}

# Absolute links would lead out of the sysroot.
find "$folder" -type l -lname '/*' -printf '%P\t%l\n' | while IFS=$'\t' read -r link target; do
  ln -sfn "$(realpath -m --relative-to="$folder/$(dirname "$link")" "$folder$target")" "$folder/$link"
done
# Of update-alternatives, which unpacking does not run.
for name in blas lapack; do
  ln -sfn "$name/lib$name.so.3" "$folder/usr/lib/aarch64-linux-gnu/lib$name.so.3"
done
echo "$stamp" >"$folder/stamp"
echo "sysroot: $(du -s -m "$folder" | cut -f 1) MB"
