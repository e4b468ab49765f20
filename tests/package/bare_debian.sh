#!/usr/bin/env bash
# Runs the commands under "Try it" in README.md as they are printed, in a clone on a bare Debian 12: what debootstrap makes,
# git, and nothing else. A page that is served until Ctrl-C is asked for once. Takes some 20 minutes without the tests, which
# are run too if asked for. Needs root, and the network.
# Usage: tests/package/bare_debian.sh [tests]
set -euo pipefail
cd "$(dirname "$0")/../.."
fail() {
  echo "bare_debian.sh: $*" >&2
  exit 1
}
[[ $# = 0 || $* = tests ]] || fail "'$*' must be nothing or tests"

root=$(mktemp -d)
clean_up() {
  umount -q "$root/dev/pts" "$root/dev/shm" "$root/proc" || true
  rm -rf "$root"
}
trap clean_up EXIT
debootstrap --variant=minbase --include=ca-certificates,git bookworm "$root" >/dev/null
mount -t proc proc "$root/proc"
mkdir -p "$root/dev/pts" "$root/dev/shm"
mount -t devpts devpts "$root/dev/pts"
mount -t tmpfs tmpfs "$root/dev/shm"
# Whom this machine trusts in its network: certificates of a proxy.
certificates=/etc/ssl/certs/ca-certificates.crt
cp "$certificates" "$root$certificates"
git clone --quiet . "$root/root/clone"

# inside COMMAND: as it is typed into a shell, in the clone.
inside() {
  chroot "$root" env -i HOME=/root PATH=/usr/sbin:/usr/bin:/sbin:/bin PIP_CERT="$certificates" \
    NODE_EXTRA_CA_CERTS="$certificates" bash -ec "cd /root/clone && $1"
}
# serves COMMAND: whether it shows a page at an address that it says.
serves() {
  inside "timeout --signal INT 60 $1 > /root/said & for _ in {1..100}; do
      address=\$(grep -o 'http://[^ ]*' /root/said || true)
      [ -z \"\$address\" ] || ENV/bin/python -c \"import urllib.request; urllib.request.urlopen('\$address')\" && break
      sleep 0.5
    done; [ -n \"\$address\" ]; kill -INT \$!; wait || true"
}

mapfile -t commands < <(sed -n '/^## Try it/,/^## Which/s/^    //p' README.md)
[ ${#commands[@]} -ge 4 ] || fail "README.md has ${#commands[@]} commands under 'Try it'"
for command in "${commands[@]}"; do
  case "$command" in
    scripts/test*) [ $# = 1 ] || continue ;;
  esac
  echo "README: $command"
  began=$SECONDS
  if [[ $command == *haptic_demo* ]]; then
    serves "$command" || fail "no page came of: $command"
  else
    inside "$command" || fail "this does not work: $command"
  fi
  echo "$((SECONDS - began)) s"
done
