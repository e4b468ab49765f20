#!/usr/bin/env bash
# Installs the package on a clean Debian 12, in a folder that is its root, and uses it there: the programs,
# the client library in C++, C and Python; then removes it and looks for what it left. Needs root.
# Usage: tests/package/clean_debian.sh out/haptic-local-model_*.deb
set -euo pipefail
deb=$(realpath "$1")
root=$(mktemp -d)
server=
clean_up() {
  [ -z "$server" ] || kill "$server" 2>/dev/null || true
  umount -q "$root/proc" || true
  rm -rf "$root"
}
trap clean_up EXIT
inside() { chroot "$root" env DEBIAN_FRONTEND=noninteractive LC_ALL=C.UTF-8 PATH=/usr/sbin:/usr/bin:/sbin:/bin "$@"; }
files() { inside find / -xdev -not -path '/proc*' -not -path '/tmp/*' -not -path '/var/cache/*' \
  -not -path '/var/lib/apt/*' -not -path '/var/lib/dpkg/*' -not -path '/var/log/*' \
  -not -path '*/__pycache__*' | sort; }

debootstrap --variant=minbase bookworm "$root" >/dev/null
mount -t proc proc "$root/proc"
cp "$deb" "$root/tmp/package.deb"
inside apt-get update -qq
inside apt-get install -y -qq /tmp/package.deb >/dev/null
inside apt-get install -y -qq --no-install-recommends g++ cmake make pkg-config >/dev/null
inside dpkg --purge haptic-local-model >/dev/null
before=$(files)
inside apt-get install -y -qq /tmp/package.deb >/dev/null

for program in haptic_server haptic_replay haptic_doctor haptic_keygen ve_client; do
  inside "$program" --version
done
chroot "$root" /usr/bin/haptic_server --listen 127.0.0.1:47871 --status false &
server=$!
inside ve_client --server 127.0.0.1:47871 --world /usr/share/haptic_local_model/worlds/testbed.sdf \
  --duration 2
inside cp -r /usr/share/doc/haptic-local-model/examples/client /tmp/client
inside cmake -S /tmp/client -B /tmp/client/build >/dev/null
inside cmake --build /tmp/client/build >/dev/null
echo 'int main(void) { return haptic_abi() != HAPTIC_ABI; }' >"$root/tmp/abi.c"
inside sh -c 'cc -include haptic.h /tmp/abi.c -o /tmp/abi $(pkg-config --cflags --libs haptic) && /tmp/abi'
inside timeout 20 python3 -c '
import haptic
with haptic.Session("127.0.0.1:47871", tool=haptic.box()) as touch:
    while touch.poll() and not touch.connected:
        touch.sample(touch.q, touch.v, 0.02)
    print("connected:", touch.connected)'
kill "$server"
wait "$server" || true
server=

inside dpkg --purge haptic-local-model >/dev/null
left=$(comm -13 <(echo "$before") <(files))
[ -z "$left" ] || {
  echo "left behind:" "$left" >&2
  exit 1
}
echo "installed, used in three languages, and gone without a trace"
