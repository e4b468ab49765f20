#!/usr/bin/env bash
# Sixteen headless worlds with scripted hands at sixteen servers, all as services of a clean Debian 12, without the
# final spin. On the way one server and one world are killed and come back by themselves. Fails if any server has a fault, or
# any session is missing in the end. Needs root.
# Usage: tests/package/many_sessions.sh out/haptic-local-model_*.deb [SECONDS], 600 by default
set -euo pipefail
. "$(dirname "$0")/container.sh"
[ -f "${1:-}" ] || fail "'${1:-}' must be a package, as scripts/package makes it"
seconds=${2:-600}
[[ $seconds =~ ^[0-9]+$ ]] && [ "$seconds" -ge 60 ] || fail "SECONDS $seconds must be a whole number, 60 or more"
count=16
kinds=(testbed lift push stack door peg_in_hole_3d corner mesh)
declare -A hands=([testbed]=session) freedoms=([lift]=spatial [stack]=spatial [peg_in_hole_3d]=spatial [mesh]=spatial)

start_container "$1"
inside dpkg -i /root/package.deb >/dev/null
grant_rights
shared=/usr/share/haptic_local_model/worlds
units=()
for ((i = 0; i < count; ++i)); do
  kind=${kinds[i % ${#kinds[@]}]}
  hand=/etc/haptic_hands/$kind.toml
  inside mkdir -p /etc/haptic_hands
  inside sed 's/^after = .*/after = "repeat"/' "$shared/hands/${hands[$kind]:-$kind}.toml" |
    inside tee "$hand" >/dev/null
  inside tee "/etc/default/haptic_server@$i" >/dev/null \
    <<<"HAPTIC_SERVER_OPTIONS=--final-spin 0 --device-option freedom=${freedoms[$kind]:-planar} --hand $hand"
  inside tee "/etc/default/ve_client@$kind-$i" >/dev/null <<UNIT
VE_CLIENT_OPTIONS=--server 127.0.0.1:$((47800 + i))
VE_CLIENT_WORLD=$shared/$kind.sdf
UNIT
  units+=("haptic_server@$i" "ve_client@$kind-$i")
done
inside systemctl start "${units[@]}"
for ((i = 0; i < count; ++i)); do await_session $((47800 + i)) "the start"; done
echo "$count sessions"

lists=$root/lists
# watch SECONDS: the list of all servers, once a second.
watch() {
  local end=$((SECONDS + $1))
  while [ $SECONDS -lt $end ]; do
    inside haptic_doctor --all --json | tr -d '\n' >>"$lists"
    echo >>"$lists"
    sleep 1
  done
}
watch $((seconds / 3))
kill_and_await haptic_server@5 47805
watch $((seconds / 3))
kill_and_await ve_client@door-4 47804
watch $((seconds / 3))
for ((i = 0; i < count; ++i)); do await_session $((47800 + i)) "the end"; done
inside haptic_doctor --all
python3 - "$lists" <<'PYTHON'
import json
import statistics
import sys

with open(sys.argv[1], encoding="utf-8") as file:
    seconds = [server for line in file for server in json.loads(line)["servers"]]
faults = {f"{each['listen']}: {each['fault']}" for each in seconds if each["fault"] != "none"}
active = sum(each["state"] == "active" for each in seconds) / len(seconds)
print(f"lateness: median {1e6 * statistics.median(each['lateness_p50'] for each in seconds):.1f} us, "
      f"largest {1e3 * max(each['lateness_max'] for each in seconds):.1f} ms; "
      f"load of a server {statistics.mean(each['load'] for each in seconds):.3f}; "
      f"force on in {100 * active:.2f} % of {len(seconds)} server seconds")
sys.exit("faults: " + ", ".join(sorted(faults)) if faults else 0)
PYTHON
[ "$(inside systemctl show --property NRestarts --value "${units[@]}" | grep -c '^1$')" = 2 ] ||
  fail "other services than the two that were killed came back: they had ended"
echo "no fault in $seconds s, and nothing ended but what was killed"
