#!/usr/bin/env bash
# Installs the package on a clean Debian 12, started by its own systemd in a container without a network, and uses
# it there: the service, also killed and hung, one of several servers with a world, killed both, the programs, the
# client library in C++, C and Python; then removes it and looks for what it left. Needs root.
# Usage: tests/package/clean_debian.sh out/haptic-local-model_*.deb
set -euo pipefail
. "$(dirname "$0")/container.sh"
[ -f "${1:-}" ] || fail "'${1:-}' must be a package, as scripts/package makes it"
start_container "$1" g++ cmake make pkg-config
files() { inside find / -xdev -not -path '/tmp/*' -not -path '/var/tmp/*' -not -path '/var/cache/*' \
  -not -path '/var/lib/dpkg/*' -not -path '/var/log/*' -not -path '*/.cache/*' | sort; }
before=$(files)
inside dpkg -i /root/package.deb >/dev/null

grant_rights
# The service has failed, and does not come back by itself: a person at the device starts it.
await_end() {
  for _ in {1..60}; do
    if inside systemctl --quiet is-failed haptic_server; then return; fi
    sleep 0.2
  done
  inside journalctl --no-pager --unit haptic_server >&2
  fail "haptic_server did not end within 12 s of SIG$1"
}
play() {
  inside ve_client --server 127.0.0.1:47800 --world /usr/share/haptic_local_model/worlds/testbed.sdf --duration 2 "$@"
}
inside systemctl enable --quiet --now haptic_server || {
  inside journalctl --no-pager --unit haptic_server >&2
  fail "the service does not start"
}
play
for signal in KILL STOP; do  # Systemd ends one that hangs after two seconds.
  inside kill -$signal "$(main_process)"
  await_end $signal
  [ -z "$(inside pgrep haptic || true)" ] || fail "processes were left after SIG$signal"
  inside systemctl start haptic_server || fail "the service does not start after SIG$signal"
  echo "the service ended with SIG$signal, and a person started it again"
done
[ "$(inside pgrep -c haptic_server)" -le 2 ] || fail "processes were left: $(inside pgrep -a haptic)"
play

# One of several servers and a world at it: both come back by themselves, and the session with them.
shared=/usr/share/haptic_local_model/worlds
inside tee /etc/default/haptic_server@12 >/dev/null <<<"HAPTIC_SERVER_OPTIONS=--hand $shared/hands/session.toml"
inside tee /etc/default/ve_client@testbed >/dev/null <<<"VE_CLIENT_OPTIONS=--server 127.0.0.1:47812"
inside tee /etc/default/haptic_server@13 >/dev/null <<<"HAPTIC_SERVER_OPTIONS=--device haply"
inside systemctl enable --quiet --now haptic_server@12 ve_client@testbed
await_session 47812 "the start"
kill_and_await haptic_server@12 47812
kill_and_await ve_client@testbed 47812
listed=$(inside haptic_doctor --all)
echo "$listed"
grep -q '^127\.0\.0\.1:47800 ' <<<"$listed" || fail "the list lacks a server"
! inside systemctl start haptic_server@13 2>/dev/null || fail "an unattended server takes a real device"
inside journalctl --sync
inside journalctl --no-pager --unit haptic_server@13 | grep -q -- '--device haply does not go with --unattended' ||
  fail "the server does not say why it refuses a real device"
inside systemctl --quiet is-failed haptic_server@13 || fail "the server that was refused its device starts again"

inside cc -D_POSIX_C_SOURCE=199309L /usr/share/doc/haptic-local-model/examples/c/touch.c -o /tmp/touch -lhaptic
inside env HAPTIC_SERVER=127.0.0.1:47810 timeout 30 /tmp/touch | tee /dev/stderr | grep -q '^3\.9. N' || fail "the C example has no force"
for program in haptic_server haptic_replay haptic_doctor haptic_keygen haptic_page haptic_demo ve_client; do
  inside "$program" --version
done
inside cp -r /usr/share/doc/haptic-local-model/examples/client /tmp/client
inside cmake -S /tmp/client -B /tmp/client/build >/dev/null
inside cmake --build /tmp/client/build >/dev/null
echo 'int main(void) { return haptic_abi() != HAPTIC_ABI; }' | inside tee /tmp/abi.c >/dev/null
inside sh -c 'cc -include haptic.h /tmp/abi.c -o /tmp/abi $(pkg-config --cflags --libs haptic) && /tmp/abi'
inside timeout 20 python3 -c '
import haptic_local_model as haptic
with haptic.Session("127.0.0.1:47800", tool=haptic.box()) as touch:
    while touch.poll() and not touch.connected:
        touch.sample(touch.q, touch.v, 0.02)
    print("connected:", touch.connected)'

# A key, as docs/operations.md hands it over.
documented() { sed -n "/^## As a service/,/^## /s/^    \($1.*\)/\1/p" "$(dirname "$0")/../../docs/operations.md"; }
for line in "mkdir -p -m 700" "echo 'HAPTIC_SERVER_OPTIONS=--listen 192" "systemctl restart haptic_server"; do
  command=$(documented "$line" | sed 's/192\.0\.2\.7/127.0.0.1/')
  [ -n "$command" ] || fail "docs/operations.md no longer says '$line'"
  inside sh -ec "$command" || {
    inside journalctl --no-pager --unit haptic_server >&2
    fail "as docs/operations.md has it, this fails: $command"
  }
done
play --key-file /etc/credstore/haptic.key
inside systemctl restart haptic_server@12 ve_client@testbed
await_session 47812 "a key for both"
inside systemctl stop ve_client@testbed
play --server 127.0.0.1:47812 --key-file /etc/credstore/haptic.key
! play --server 127.0.0.1:47812 --connect-timeout 2 >/dev/null 2>&1 || fail "one of several services talks without its key"
! play >/dev/null 2>&1 || fail "the service talks without its key"

inside rm -rf $drop_in $drop_in_of_many /etc/credstore
inside sh -c 'rm /etc/default/haptic_server /etc/default/haptic_server@* /etc/default/ve_client@*'
inside dpkg --purge haptic-local-model >/dev/null
! inside pgrep -l haptic || fail "processes run on after the package is gone"
left=$(comm -13 <(echo "$before") <(files))
[ -z "$left" ] || fail "left behind:" "$left"
echo "installed, served, used in three languages, and gone without a trace"
