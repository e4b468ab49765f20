# Sourced by the scripts in this folder: how far long work is.
# shellcheck shell=bash

# Seconds in words: "40 s", "3 min", "2 h 5 min".
in_words() {
  local seconds=$1 minutes=$((($1 + 30) / 60))
  if ((seconds < 90)); then
    echo "$seconds s"
  elif ((minutes < 60)); then
    echo "$minutes min"
  else
    echo "$((minutes / 60)) h $((minutes % 60)) min"
  fi
}

# show_progress TEXT DONE TOTAL BEGAN: one line, which is rewritten on a terminal; elsewhere a line for
# each tenth of the way. BEGAN: value of $SECONDS when the work began.
show_progress() {
  local text=$1 finished=$2 total=$3 passed=$((SECONDS - $4)) time=
  ((finished > 0)) || return 0
  if ((finished == total)); then
    time=" in $(in_words "$passed")"
  elif ((passed >= 3 && finished >= 3)); then  # The first few say little about the rest.
    time=", about $(in_words $((passed * (total - finished) / finished))) left"
  fi
  if [ -t 1 ]; then
    printf '\r\e[K%s: %d of %d done%s' "$text" "$finished" "$total" "$time"
    ((finished < total)) || printf '\n'
  elif ((10 * finished / total > 10 * (finished - 1) / total)); then
    echo "$text: $finished of $total done$time"
  fi
}

# watch_ninja TEXT LOG: copies what ninja writes to LOG and shows how far it is. NINJA_STATUS must be
# $ninja_status.
ninja_status='[%f/%t] '
watch_ninja() {
  local text=$1 log=$2 began=$SECONDS line='' finished=0 total=0
  : >"$log"
  while IFS= read -r line; do
    printf '%s\n' "$line" >>"$log"
    [[ $line =~ ^\[([0-9]+)/([0-9]+)\]\  ]] || continue
    finished=${BASH_REMATCH[1]} total=${BASH_REMATCH[2]}
    show_progress "$text" "$finished" "$total" "$began"
  done
  if grep -q '^ninja: no work to do' "$log"; then
    echo "$text: nothing to do"
  elif ((finished < total)) && [ -t 1 ]; then
    echo
  fi
}
