# Sourced: a clean Debian 12 for a package, started by its own systemd in a container without a network. Needs root.
fail() {
  echo "$(basename "$0"): $*" >&2
  exit 1
}

root=$(mktemp -d)
chmod 755 "$root"  # The root of all its users.
container=
clean_up() {
  if [ -n "$container" ]; then
    kill "$container" 2>/dev/null || true
    wait "$container" || true
  fi
  umount -q "$root/proc" || true
  rm -rf "$root"
}
trap clean_up EXIT
environment=(env DEBIAN_FRONTEND=noninteractive LC_ALL=C.UTF-8 PATH=/usr/sbin:/usr/bin:/sbin:/bin)

# inside COMMAND...: in the container that runs.
inside() { nsenter --all --target "$first" "${environment[@]}" "$@"; }

# start_container PACKAGE NAME...: with what the package depends on and these of Debian's, and the package itself in
# /root/package.deb, not installed.
start_container() {
  local deb=$1 prepare=(chroot "$root" "${environment[@]}")
  shift
  debootstrap --variant=minbase --include=systemd,systemd-sysv,dbus,udev bookworm "$root" >/dev/null
  mount -t proc proc "$root/proc"
  cp "$deb" "$root/tmp/package.deb"
  "${prepare[@]}" apt-get update -qq
  "${prepare[@]}" apt-get install -y -qq /tmp/package.deb >/dev/null
  [ $# = 0 ] || "${prepare[@]}" apt-get install -y -qq --no-install-recommends "$@" >/dev/null
  "${prepare[@]}" dpkg --purge haptic-local-model >/dev/null
  umount "$root/proc"
  mv "$root/tmp/package.deb" "$root/root/"
  systemd-nspawn --quiet --directory="$root" --boot --private-network --register=no --keep-unit \
    --capability=CAP_IPC_LOCK --console=pipe </dev/null >"$root/boot.log" 2>&1 &
  container=$!
  for _ in {1..50}; do
    first=$(pgrep -P "$container" || true)
    [ -z "$first" ] || [ ! -S "$root/run/dbus/system_bus_socket" ] || break
    sleep 0.2
  done
  local state
  state=$(inside timeout 60 systemctl is-system-running --wait) || fail "systemd is $state"
}

drop_in=/etc/systemd/system/haptic_server.service.d
drop_in_of_many=/etc/systemd/system/haptic_server@.service.d
# A container may not raise limits where its host may not: capabilities give the same rights there.
grant_rights() {
  [ "$(ulimit -Hr)" = 0 ] || return 0
  local folder
  for folder in $drop_in $drop_in_of_many; do
    inside mkdir -p $folder
    inside tee $folder/rights.conf >/dev/null <<'UNIT'
[Service]
CapabilityBoundingSet=CAP_SYS_NICE CAP_IPC_LOCK
AmbientCapabilities=CAP_SYS_NICE CAP_IPC_LOCK
UNIT
  done
  inside systemctl daemon-reload
}

main_process() { inside systemctl show --property MainPID --value "${1:-haptic_server}"; }

# await_session PORT WHEN: a session with the server at that port.
await_session() {
  for _ in {1..100}; do
    if inside haptic_doctor --all | grep -q "^127\.0\.0\.1:$1 .* active "; then return; fi
    sleep 0.2
  done
  inside haptic_doctor --all >&2
  inside journalctl --no-pager --lines 50 >&2
  fail "no session within 20 s of $2"
}

# kill_and_await UNIT PORT: SIGKILL; it comes back by itself, and the session at that port with it.
kill_and_await() {
  local killed process
  killed=$(main_process "$1")
  inside systemctl kill --kill-who=main --signal=KILL "$1"
  for _ in {1..50}; do
    process=$(main_process "$1")
    [ "$process" = 0 ] || [ "$process" = "$killed" ] || break
    sleep 0.2
  done
  [ "$process" != 0 ] && [ "$process" != "$killed" ] || fail "$1 did not come back within 10 s of SIGKILL"
  sleep 2  # What the server says of itself is up to a second old.
  await_session "$2" "the end of $1"
  echo "$1 came back by itself after SIGKILL, with its session"
}
