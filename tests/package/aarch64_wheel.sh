#!/usr/bin/env bash
# Uses the wheel for aarch64 on this machine, with QEMU and the Python of Debian 11: a hand that is drawn 10 mm into a floor is
# supported by its own spring's force. Needs root, Debian's packages and pip's index for numpy.
# Usage: tests/package/aarch64_wheel.sh out/glibc_2.31/haptic_local_model-*_aarch64.whl
set -euo pipefail
fail() {
  echo "aarch64_wheel.sh: $*" >&2
  exit 1
}
[ -f "${1:-}" ] || fail "'${1:-}' must be a wheel, as scripts/package wheels makes it"
root=$(mktemp -d)
server=
clean_up() {
  [ -z "$server" ] || kill "$server" 2>/dev/null || true
  rm -rf "$root"
}
trap clean_up EXIT

debootstrap --arch arm64 --foreign --variant=minbase --include=python3 bullseye "$root" >/dev/null
for package in "$root"/var/cache/apt/archives/*.deb; do dpkg-deb -x "$package" "$root"; done
python3 -m pip download --quiet --disable-pip-version-check --only-binary :all: --no-deps --platform manylinux2014_aarch64 \
  --python-version 3.9 --dest "$root/packages" numpy
for wheel in "$1" "$root"/packages/*.whl; do python3 -m zipfile -e "$wheel" "$root/site"; done
chmod +x "$root"/site/haptic_local_model/bin/*
emulated() { qemu-aarch64-static -L "$root" "$@"; }
port=$(python3 -c 'import socket; s = socket.socket(type=socket.SOCK_DGRAM); s.bind(("127.0.0.1", 0)); print(s.getsockname()[1])')
# QEMU is no real-time system.
qemu-aarch64-static -L "$root" "$root/site/haptic_local_model/bin/haptic_server" --listen "127.0.0.1:$port" --status false \
  --max-gap 60 --silence-time 10 --device-option freedom=spatial --duration 120 &
server=$!
PYTHONPATH=$root/site emulated "$root/usr/bin/python3.9" - "127.0.0.1:$port" <<'PROGRAM' || fail "no force"
import platform
import sys
import time
import haptic_local_model as haptic
from haptic_local_model import shapes

with haptic.Session(sys.argv[1], tool=haptic.box(mass=0.1, size=(0.04, 0.04, 0.04))) as touch:
    touch.offer([shapes.box((0.04, 0.04, 0.04), haptic.TOOL_LINK), shapes.half_space()], [[0, 0, 0], [0, 0, -0.03]])
    touch.hold((0, 0, -0.02))  # 10 mm into the floor, 200 N/m
    end = time.monotonic() + 20
    while touch.poll() and time.monotonic() < end:
        touch.sample(touch.q, touch.v, 1 / 60)
        touch.send()
        time.sleep(1 / 60)
    force = touch.state.contact_wrench[2]
print(f"{platform.machine()}: {force:.2f} N of 2")
sys.exit(not 1.8 < force < 2.0)
PROGRAM
echo "imported, served and felt"
