# shellcheck shell=bash
# To be sourced: arm64 packages out of this machine's own Debian mirrors, fetched and unpacked, never installed. Nothing
# of this machine changes: apt works with lists, a cache and a status of its own.
#
#     arm64_open FOLDER [ARCHITECTURE...]    asks the mirrors; FOLDER is apt's own. Other architectures than arm64, too.
#     arm64_download FOLDER PACKAGE...       those packages into FOLDER
#     arm64_download_all FOLDER PACKAGE...   and all they depend on, as on a machine that has nothing yet
#     arm64_source FOLDER PACKAGE            the source of a package, not unpacked
#     arm64_unpack FOLDER DEB...             packages into the tree FOLDER, whose /bin, /sbin and /lib are links into /usr
#     arm64_close                            removes apt's folder

arm64_apt=

arm64_open() {
  arm64_apt=$1
  shift
  rm -rf "$arm64_apt"
  mkdir -p "$arm64_apt"/{etc/sources.list.d,etc/parts,etc/preferences.d,lists/partial,cache/archives/partial}
  : >"$arm64_apt/status"
  # The mirrors and keys of this machine, asked for sources, too. Its proxies count; its hooks do not.
  local file
  for file in /etc/apt/sources.list /etc/apt/sources.list.d/*.{list,sources}; do
    if [[ -f $file ]]; then
      sed -E -e 's/^Types:.*/Types: deb deb-src/' -e '/^deb-src /d' -e 's/^deb (.*)/deb \1\ndeb-src \1/' "$file" \
        >"$arm64_apt/etc/${file#/etc/apt/}"
    fi
  done
  {
    apt-config dump | grep -E '^Acquire::(https?|ftp|Check)' || true
    cat <<END
APT::Architecture "arm64";
APT::Architectures { "arm64"; $(printf '"%s"; ' "$@")};
APT::Sandbox::User "";
APT::Install-Recommends "false";
Acquire::Languages "none";
Dir::Etc "$arm64_apt/etc";
Dir::Etc::parts "parts";
Dir::Etc::trusted "/etc/apt/trusted.gpg";
Dir::Etc::trustedparts "/etc/apt/trusted.gpg.d";
Dir::State "$arm64_apt";
Dir::State::lists "$arm64_apt/lists";
Dir::State::status "$arm64_apt/status";
Dir::Cache "$arm64_apt/cache";
END
  } >"$arm64_apt/apt.conf"
  # Only what this file says: apt reads it before the machine's own, whose folder is then another.
  export APT_CONFIG=$arm64_apt/apt.conf
  # A mirror of somebody else may have nothing for arm64; what matters is whether the packages come.
  apt-get update -q >"$arm64_apt/log" 2>&1 || true
}

# FOLDER WHAT COMMAND...: the command, in FOLDER; what it said is told where it fails.
arm64_fetch() {
  local folder=$1 what=$2
  shift 2
  mkdir -p "$folder"
  (cd "$folder" && "$@") >>"$arm64_apt/log" 2>&1 || {
    cat "$arm64_apt/log" >&2
    echo "arm64 packages: this machine's mirrors did not give $what" >&2
    return 1
  }
}

arm64_download() { arm64_fetch "$1" "${*:2}" apt-get download -q "${@:2}"; }

arm64_download_all() {
  arm64_fetch "$1" "${*:2}" apt-get install -q -y --download-only "${@:2}" || return
  mv "$arm64_apt"/cache/archives/*.deb "$1"
}

arm64_source() { arm64_fetch "$1" "the source of $2" apt-get source -q --download-only --only-source "$2"; }

# Documents and translations are of no use to a build nor to a board.
arm64_unpack() {
  local tree=$1 name deb
  shift
  for name in bin sbin lib; do
    mkdir -p "$tree/usr/$name"
    [[ -L $tree/$name ]] || ln -s "usr/$name" "$tree/$name"
  done
  for deb in "$@"; do
    dpkg-deb --fsys-tarfile "$deb" | tar -x -C "$tree" --keep-directory-symlink --no-same-owner \
      --exclude='./usr/share/doc/*' --exclude='./usr/share/man/*' --exclude='./usr/share/locale/*' \
      --exclude='./usr/share/info/*' --exclude='./usr/share/lintian/*'
  done
}

arm64_close() {
  rm -rf "$arm64_apt"
  unset APT_CONFIG
}
