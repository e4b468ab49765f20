# Sourced by the scripts in this folder: what the stages of a run take, as a table at its end. A script that
# is called by another leaves its rows to that one.
# shellcheck shell=bash

# Of this shell and all that it waited for, user and system together, ms.
processor_time() {
  local report=$stage_folder/times times total=0 number
  times >"$report"
  mapfile -t times < <(tr -s ' ' '\n' <"$report")
  for number in "${times[@]}"; do
    [[ $number =~ ^([0-9]+)m([0-9]+)[.,]([0-9]+)s$ ]] || continue
    total=$((total + 60000 * BASH_REMATCH[1] + 1000 * BASH_REMATCH[2] + 10#${BASH_REMATCH[3]}))
  done
  processor_ms=$total
}

# stage NAME COMMAND …: runs it, and notes what it took.
stage() {
  stage_name=$1
  shift
  stage_began=${EPOCHREALTIME/[.,]/}
  processor_time
  stage_processor=$processor_ms
  "$@"
  note_stage ""
}

note_stage() {
  processor_time
  printf '%s\t%d\t%d\n' "$stage_name$1" $(((${EPOCHREALTIME/[.,]/} - stage_began) / 1000)) \
    $((processor_ms - stage_processor)) >>"$HLM_STAGES"
  stage_name=
}

end_stages() {
  [ -z "$stage_name" ] || note_stage " (failed)"
  if $owns_stages && [ -s "$HLM_STAGES" ]; then
    awk -F '\t' 'BEGIN { printf "\n%-36s %10s %14s\n", "stage", "wall, s", "processor, s" }
      { printf "%-36s %10.1f %14.1f\n", $1, $2 / 1000, $3 / 1000; wall += $2; processor += $3 }
      END { printf "%-36s %10.1f %14.1f\n", "all", wall / 1000, processor / 1000 }' "$HLM_STAGES"
  fi
  rm -rf "$stage_folder"
}

stage_name=
stage_folder=$(mktemp -d)
owns_stages=false
if [ -z "${HLM_STAGES:-}" ]; then
  owns_stages=true
  export HLM_STAGES=$stage_folder/stages
fi
trap end_stages EXIT
