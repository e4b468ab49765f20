"""A local user plants what it can into its run folder, for root's haptic_doctor to stumble over, and holds it.

Usage: plant_files.py FOLDER VICTIM VICTIMS_PROCESS VICTIMS_FOLDER STATE, as that user. Writes the planted addresses, a line
each, then "planted", and waits."""
import json
import os
import pathlib
import signal
import socket
import sys

folder, victim, process, victims, state = pathlib.Path(sys.argv[1]), sys.argv[2], int(sys.argv[3]), sys.argv[4], sys.argv[5]
state = json.loads(pathlib.Path(state).read_text())
held = []


def own_address():
    held.append(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
    held[-1].bind(("127.0.0.1", 0))
    return "127.0.0.1:%d" % held[-1].getsockname()[1]


def listen(path, backlog=1):
    held.append(socket.socket(socket.AF_UNIX, socket.SOCK_STREAM))
    held[-1].bind(str(path))
    held[-1].listen(backlog)


def leave_dangling(path):
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as gone:
        gone.bind(str(path))


def write_state(path, listen, **changes):
    path.write_text(json.dumps({**state, "listen": listen, "process": process, **changes}))


def make_huge(path):
    path.touch()
    os.truncate(path, 1 << 40)


STATES = {  # instead of a state file
    "fifo": os.mkfifo,
    "link to the victim's": lambda path: path.symlink_to(f"{victims}/{victim}.json"),
    "dangling link": lambda path: path.symlink_to("/nowhere"),
    "link to itself": lambda path: path.symlink_to(path),
    "endless": lambda path: path.symlink_to("/dev/zero"),
    "terminal": lambda path: path.symlink_to("/dev/tty"),
    "directory": pathlib.Path.mkdir,
    "huge": make_huge,
    "socket": listen,
    "empty": pathlib.Path.touch,
    "no text": lambda path: path.write_bytes(bytes(range(256)) * 16),
    "deep": lambda path: path.write_text("[" * 60000),
}
SOCKETS = {  # beside a state file that names the victim's process
    "none": lambda path: None,
    "link to the victim's": lambda path: path.symlink_to(f"{victims}/{victim}.sock"),
    "dangling": leave_dangling,
    "fifo": os.mkfifo,
    "directory": pathlib.Path.mkdir,
    "file": pathlib.Path.touch,
    "full": lambda path: listen(path, 0),
    "silent": listen,
}
PROCESSES = [1, 0, -1, 2**40, 1e300, "1", None]  # without a socket

addresses = []
for plant in STATES.values():
    addresses.append(own_address())
    plant(folder / (addresses[-1] + ".json"))
for plant in SOCKETS.values():
    addresses.append(own_address())
    write_state(folder / (addresses[-1] + ".json"), addresses[-1])
    plant(folder / (addresses[-1] + ".sock"))
for said in PROCESSES:
    addresses.append(own_address())
    write_state(folder / (addresses[-1] + ".json"), addresses[-1], process=said)
write_state(folder / (own_address() + ".json"), victim)
write_state(folder / (victim + ".json"), victim)  # the victim's own address, and a socket
listen(folder / (victim + ".sock"))
write_state(folder / "\x1b[2J.json", "\x1b[2J")
write_state(folder / "a.host.that.is.looked.up:1.json", "a.host.that.is.looked.up:1")
print("\n".join(addresses + ["planted"]), flush=True)
signal.pause()
