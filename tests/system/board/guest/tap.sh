# shellcheck shell=bash
# What a guest test is written with. It prints TAP: facts that hold or do not, and at the end how many there were.
#     fact NAME COMMAND...      holds where the command succeeds; what it says is told where not
#     gtest PROGRAM [ARG...]    each of its tests is a fact
#     eventually COMMAND...     succeeds as soon as the command does, tried for 20 s
#     cut_the_power             does not return: the case is called again by the board that boots then
#     finish                    the last line
# Of before a power cut.
facts=${FACTS:-0}

tell() { sed 's/^/# /'; }

# RESULT NAME, the number between them.
told() {
  facts=$((facts + 1))
  echo "$1 $facts - $2"
}

fact() {
  local name=$1 said
  shift
  if said=$("$@" 2>&1); then
    told ok "$name"
  else
    echo "code $? of: $*" | tell
    tell <<<"$said"
    told "not ok" "$name"
  fi
}

# LOG NAME: what a gtest said of one of its tests.
said_of() { sed -n "/^\[ RUN      \] $2\$/,/^\[  FAILED  \]/p" "$1"; }
why_skipped() { grep -A1 ': Skipped$' <(sed -n "/^\[ RUN      \] $2\$/,/^\[  SKIPPED \]/p" "$1") | sed -n 2p; }

gtest() {
  local program=$1 log=/run/results/$1.log code line name failed=0
  shift
  "./$program" "$@" >"$log" 2>&1
  code=$?
  while IFS= read -r line; do
    name=${line#\[*\] }
    name=${name% (*}
    case $line in
      "[       OK ] "*) told ok "$name" ;;
      "[  SKIPPED ] "*) told ok "$name # SKIP $(why_skipped "$log" "$name")" ;;
      "[  FAILED  ] "*)
        failed=1
        said_of "$log" "$name" | tell
        told "not ok" "$name"
        ;;
    esac
  done < <(grep -E '^\[ .* \(.* ms\)$' "$log")
  # 1 says that a test failed; what is more, nobody has told.
  if ((code > 1 || (code && !failed))); then
    tail -n 20 "$log" | tell
    told "not ok" "$program ends with code $code"
  fi
}

eventually() {
  local tries
  # Asking costs the host time, waiting does not.
  for ((tries = 0; tries < 80; tries++)); do
    if "$@" >/dev/null 2>&1; then return 0; fi
    sleep 0.25
  done
  "$@"
}

# At once, as power is cut: nothing is flushed.
cut_the_power() {
  echo "board: cut the power after $facts facts and $SECONDS s"
  sleep infinity
}

finish() { echo "1..$facts"; }
