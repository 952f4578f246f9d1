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
#     debian_install FOLDER DEB...                  the same, and dpkg there knows them as installed; no script of theirs runs
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

# The folders of a tree whose /bin, /sbin and /lib are links into /usr.
debian_merge_usr() {
  local name
  for name in bin sbin lib; do
    mkdir -p "$1/usr/$name"
    [[ -L $1/$name ]] || ln -s "usr/$name" "$1/$name"
  done
}

# TREE DEB: tells the names of what is unpacked. Documents and translations are of no use to a build nor to a board.
debian_unpack_one() {
  dpkg-deb --fsys-tarfile "$2" | tar -xv --quoting-style=literal -C "$1" --keep-directory-symlink --no-same-owner \
    --exclude='./usr/share/doc/*' --exclude='./usr/share/man/*' --exclude='./usr/share/locale/*' \
    --exclude='./usr/share/info/*' --exclude='./usr/share/lintian/*'
}

debian_unpack() {
  local tree=$1 deb
  shift
  debian_merge_usr "$tree"
  for deb in "$@"; do debian_unpack_one "$tree" "$deb" >/dev/null; done
}

# dpkg's database is written as dpkg itself leaves it: the status of all, and of each its files, scripts and triggers.
debian_install() {
  local tree=$1 dpkg=$1/var/lib/dpkg deb control name
  shift
  debian_merge_usr "$tree"
  mkdir -p "$dpkg"/{info,updates,parts,triggers,alternatives} "$dpkg/control"
  touch "$dpkg"/{available,diversions,statoverride,triggers/File}
  for deb in "$@"; do
    control=$dpkg/control/one
    dpkg-deb --control "$deb" "$control"
    name=$(debian_dpkg_name "$control/control")
    debian_unpack_one "$tree" "$deb" | sed 's|^\./$|/.|; s|^\./|/|; s|\(.\)/$|\1|' >"$dpkg/info/$name.list"
    debian_dpkg_status "$tree" "$control" >>"$dpkg/status"
    if [[ -f $control/triggers ]]; then debian_dpkg_triggers "$dpkg/triggers" "$name" <"$control/triggers"; fi
    mv "$control" "$dpkg/control/$name"
  done
  # All at once: a process for each of thousands of files takes longer than the rest.
  (cd "$dpkg/control" && find . -type f ! -name control -print0 | tar -c --null -T - --transform='s|^\./\([^/]*\)/|\1.|') |
    tar -x -C "$dpkg/info" --no-same-owner
  rm -rf "$dpkg/control"
  echo 1 >"$dpkg/info/format"
}

# CONTROL: the package's name in dpkg's files; that of a library which may be there for several architectures has its own.
debian_dpkg_name() {
  local field value name='' architecture='' same=''
  while read -r field value; do
    case $field in
      Package:) name=$value ;;
      Architecture:) architecture=:$value ;;
      Multi-Arch:) if [[ $value == same ]]; then same=1; fi ;;
    esac
  done <"$1"
  echo "$name${same:+$architecture}"
}

# TREE FOLDER: the package's part of dpkg's status, by what it is controlled by.
debian_dpkg_status() {
  local line sum path
  while IFS= read -r line; do
    printf '%s\n' "$line"
    if [[ $line == Package:* ]]; then echo "Status: install ok installed"; fi
  done <"$2/control"
  if [[ -f $2/conffiles ]]; then
    echo "Conffiles:"
    (cd "$1" && sed -n 's|^/||p' "$2/conffiles" | xargs -r md5sum) | while read -r sum path; do echo " /$path $sum"; done
  fi
  echo
}

# FOLDER NAME: which names and paths the package waits for.
debian_dpkg_triggers() {
  local kind what how
  while read -r kind what; do
    case $kind in
      interest | interest-await) how= ;;
      interest-noawait) how=/noawait ;;
      *) continue ;;
    esac
    if [[ $what == /* ]]; then echo "$what $2$how" >>"$1/File"; else echo "$2$how" >>"$1/$what"; fi
  done
}

debian_close() {
  rm -rf "$debian_apt"
  unset APT_CONFIG
}
