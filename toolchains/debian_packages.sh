# shellcheck shell=bash
# To be sourced: packages of Debian, of whatever release and architecture, from this machine's own mirrors, fetched and
# unpacked, never installed. Nothing of this machine changes: apt works with lists, a cache and a status of its own.
#
#     debian_open FOLDER RELEASE ARCHITECTURE...    asks the mirrors; FOLDER is apt's own. RELEASE is bookworm, trixie,
#                                                   or own: this machine's. Packages are of the first architecture
#     debian_download FOLDER PACKAGE...             those packages into FOLDER
#     debian_download_all FOLDER PACKAGE...         and all they depend on, as on a machine that has nothing yet
#     debian_source FOLDER PACKAGE                  the source of a package, not unpacked
#     debian_unpack FOLDER DEB...                   packages into the tree FOLDER; /bin, /sbin, /lib are links into /usr
#     debian_close                                  removes apt's folder

debian_apt=

debian_open() {
  debian_apt=$1
  local release=$2 own
  shift 2
  rm -rf "$debian_apt"
  mkdir -p "$debian_apt"/{etc/sources.list.d,etc/parts,etc/preferences.d,lists/partial,cache/archives/partial}
  : >"$debian_apt/status"
  # The mirrors and keys of this machine, asked for sources, too. Its proxies count; its hooks do not.
  local file
  for file in /etc/apt/sources.list /etc/apt/sources.list.d/*.{list,sources}; do
    if [[ -f $file ]]; then
      sed -E -e 's/^Types:.*/Types: deb deb-src/' -e '/^deb-src /d' -e 's/^deb (.*)/deb \1\ndeb-src \1/' "$file" \
        >"$debian_apt/etc/${file#/etc/apt/}"
    fi
  done
  # The machine's own release, with what stands behind it (-updates, -security), is the wanted one now.
  own=$(sed -n 's/^VERSION_CODENAME=//p' /etc/os-release)
  if [[ $release != own && $release != "$own" ]]; then
    find "$debian_apt/etc" -type f -exec sed -i "s/\\b$own\\b/$release/g" {} +
  fi
  {
    apt-config dump | grep -E '^Acquire::(https?|ftp|Check)' || true
    cat <<END
APT::Architecture "$1";
APT::Architectures { $(printf '"%s"; ' "$@")};
APT::Sandbox::User "";
APT::Install-Recommends "false";
Acquire::Languages "none";
Dir::Etc "$debian_apt/etc";
Dir::Etc::parts "parts";
Dir::Etc::trusted "/etc/apt/trusted.gpg";
Dir::Etc::trustedparts "/etc/apt/trusted.gpg.d";
Dir::State "$debian_apt";
Dir::State::lists "$debian_apt/lists";
Dir::State::status "$debian_apt/status";
Dir::Cache "$debian_apt/cache";
END
  } >"$debian_apt/apt.conf"
  # Only what this file says: apt reads it before the machine's own, whose folder is then another.
  export APT_CONFIG=$debian_apt/apt.conf
  # A mirror of somebody else may have nothing of that kind; what matters is whether the packages come.
  apt-get update -q >"$debian_apt/log" 2>&1 || true
}

# FOLDER WHAT COMMAND...: the command, in FOLDER; what it said is told where it fails.
debian_fetch() {
  local folder=$1 what=$2
  shift 2
  mkdir -p "$folder"
  (cd "$folder" && "$@") >>"$debian_apt/log" 2>&1 || {
    cat "$debian_apt/log" >&2
    echo "Debian packages: this machine's mirrors did not give $what" >&2
    return 1
  }
}

debian_download() { debian_fetch "$1" "${*:2}" apt-get download -q "${@:2}"; }

debian_download_all() {
  debian_fetch "$1" "${*:2}" apt-get install -q -y --download-only "${@:2}" || return
  mv "$debian_apt"/cache/archives/*.deb "$1"
}

debian_source() { debian_fetch "$1" "the source of $2" apt-get source -q --download-only --only-source "$2"; }

# Documents and translations are of no use to a build nor to a board.
debian_unpack() {
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

debian_close() {
  rm -rf "$debian_apt"
  unset APT_CONFIG
}
