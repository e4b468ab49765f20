"""A machine that misbehaves, for the programs that a test starts on it: its clock is set, its disk is full."""

import mmap
import os
import pathlib
import struct
import subprocess


class SteppedClock:
    """The clock of the day of programs that are started with its environment."""

    def __init__(self, folder):
        library = pathlib.Path(folder) / "stepped_clock.so"
        subprocess.run(["c++", "-std=c++20", "-O1", "-shared", "-fPIC", "-o", library,
                        pathlib.Path(__file__).with_name("stepped_clock.cc")], check=True)
        offset = pathlib.Path(folder) / "clock_offset"
        offset.write_bytes(struct.pack("d", 0))
        # A program that was built with sanitizers wants its own library first.
        options = os.environ.get("ASAN_OPTIONS", "") + ":verify_asan_link_order=0"
        self.environment = {**os.environ, "LD_PRELOAD": str(library), "HLM_CLOCK_OFFSET": str(offset),
                            "ASAN_OPTIONS": options}
        with open(offset, "r+b") as file:
            self._memory = mmap.mmap(file.fileno(), 8)

    def set(self, offset):
        """From now on it is off by so many seconds."""
        self._memory[:] = struct.pack("d", offset)


def on_small_disk(folder, command, size="256k"):
    """The command, for which `folder` is an empty disk of that size that goes with it. None if this machine allows
    no such thing: it takes a mount namespace."""
    rights = [] if os.geteuid() == 0 else ["--map-root-user"]
    namespace = ["unshare", "--mount", *rights, "sh", "-c",
                 'mount -t tmpfs -o size="$0" none "$1" && shift && exec "$@"', size, str(folder)]
    possible = subprocess.run([*namespace, "true"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    return [*namespace, *map(str, command)] if possible.returncode == 0 else None
