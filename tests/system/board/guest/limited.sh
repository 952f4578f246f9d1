# shellcheck shell=bash
# limited SECONDS NAME COMMAND...: its exit code; 124, and what its processes wait for, where it takes longer. Nothing
# that it started outlives it.
limited() {
  local seconds=$1 name=$2 child timer first code task
  shift 2
  # A child in the background leads no group: setsid becomes the command, and its number is that of the session.
  setsid "$@" 3>&- &
  child=$!
  sleep "$seconds" &
  timer=$!
  wait -n -p first "$child" "$timer"
  code=$?
  if [[ $first == "$timer" ]]; then
    code=124
    echo "board: hung: $name is not done after $seconds s; its processes, and where their threads wait in the kernel:"
    ps -o pid=,stat=,args= --sid "$child" | cut -c 1-160
    for task in $(pgrep --session "$child" | sed 's|.*|/proc/&/task/*|'); do
      echo "  $(<"$task/comm") (thread ${task##*/}): $(sed -n '/invoke_syscall/q; s/+0x.*//; s/.* //p' "$task/stack" | tr '\n' ' ')"
    done 2>/dev/null
    dmesg | tail -n 5
  fi
  kill "$timer" 2>/dev/null
  pkill -KILL --session "$child"
  wait "$child" "$timer" 2>/dev/null
  return "$code"
}

# NAME: the number that the kernel was started with, NAME=NUMBER; else 0.
kernel_word() {
  local word
  for word in $(</proc/cmdline); do
    [[ $word != "$1="* ]] || {
      echo "${word#*=}"
      return
    }
  done
  echo 0
}
