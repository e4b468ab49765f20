#!/usr/bin/env bash
# Installs the wheel with pip on a clean Debian, whose only other packages are Python's, and uses it there: the contrast's page
# where the wheel has ve_client, a session with a page of its own whose force is felt; then uninstalls it and looks for what it
# left. Says how long it took from pip install to the first force. Needs root, and pip's index for numpy.
# Usage: tests/package/clean_wheel.sh out/haptic_local_model-*.whl [bullseye|bookworm|trixie], bookworm by default
set -euo pipefail
fail() {
  echo "clean_wheel.sh: $*" >&2
  exit 1
}
[ -f "${1:-}" ] || fail "'${1:-}' must be a wheel, as scripts/package makes it"
wheel=$(realpath "$1")
release=${2:-bookworm}
root=$(mktemp -d)
clean_up() {
  umount -q "$root/proc" || true
  rm -rf "$root"
}
trap clean_up EXIT

debootstrap --variant=minbase --include=python3-venv "$release" "$root" >/dev/null
mount -t proc proc "$root/proc"
mkdir "$root/root/packages"
python=$(chroot "$root" python3 -c 'import sys; print("%d.%d" % sys.version_info[:2])')
python3 -m pip download --quiet --disable-pip-version-check --only-binary :all: --python-version "$python" --dest "$root/root/packages" numpy
cp "$wheel" "$root/root/packages/"
inside() { chroot "$root" env LC_ALL=C.UTF-8 HOME=/root PATH=/env/bin:/usr/bin:/bin "$@"; }
inside python3 -m venv /env
pip=(pip --quiet --disable-pip-version-check)
inside "${pip[@]}" install --no-index --find-links /root/packages numpy
files() { inside find /env /root /tmp -not -path '*/__pycache__*' -not -path '*/.cache/*' | sort; }
before=$(files)

begin=$(date +%s%N)
inside "${pip[@]}" install --no-index --find-links /root/packages haptic-local-model
cat >"$root/root/touch.py" <<'PROGRAM'
import time, urllib.request
import haptic_local_model as haptic
import haptic_local_model.shapes as shapes

with haptic.Session(tool=haptic.box(mass=0.1, size=(0.04, 0.04, 0.04))) as touch:
    touch.offer([shapes.box((0.04, 0.04, 0.04), haptic.TOOL_LINK), shapes.half_space()], [[0, 0, 0], [0, 0, -0.03]])
    page = urllib.request.urlopen(touch.show(open_browser=False)).read()
    touch.hold((0, 0, -0.02))  # 10 mm into the floor, 200 N/m
    while touch.poll() and touch.state.contact_wrench[2] < 1.9:
        touch.sample(touch.q, touch.v, 1 / 60)
        touch.send()
        time.sleep(1 / 60)
    print(f"{len(page)} bytes of page, {touch.state.contact_wrench[2]:.2f} N")
PROGRAM
inside timeout 60 python /root/touch.py || fail "no force"
echo "$((($(date +%s%N) - begin) / 1000000)) ms from pip install to the first force"
programs="haptic_server haptic_replay haptic_doctor haptic_keygen haptic_demo"
shown=http://127.0.0.1
if [[ $(python3 -m zipfile -l "$wheel") == *bin/ve_client* ]]; then
  programs="$programs ve_client"
else
  shown='this wheel is for systems with a glibc before'
fi
inside sh -c 'timeout --signal INT 20 haptic_demo --no-browser >/root/demo.txt 2>&1 & wait $!' || true
grep -q "$shown" "$root/root/demo.txt" || fail "haptic_demo said: $(cat "$root/root/demo.txt")"
for program in $programs; do inside "$program" --version; done
said=$([[ $programs == *ve_client* ]] || inside ve_client 2>&1 || true)
[[ $programs == *ve_client* || $said == *"$shown"* ]] || fail "ve_client said: $said"
rm "$root/root/touch.py" "$root/root/demo.txt"
inside "${pip[@]}" uninstall --yes haptic-local-model
left=$(comm -13 <(echo "$before") <(files))
[ -z "$left" ] || fail "left behind: $left"
echo "installed, felt, and gone without a trace"
