#!/usr/bin/python3
"""The hello worlds of docs/adapter.md, as they stand there, end at what the page says, each with a server of its own.

Usage: hello_test.py HAPTIC_SERVER SOURCE PROGRAM …
"""

import os
import pathlib
import re
import socket
import subprocess
import sys
import time

SERVER, SOURCE, *PROGRAMS = sys.argv[1:]
PATIENCE = 20  # s; some tenths unless the machine is busy
LINE = r"(-?[\d.]+) N, (-?[\d.]+) mm"

claimed = re.search(rf"Both end at `{LINE}`", (pathlib.Path(SOURCE) / "docs/adapter.md").read_text())
force, height = (float(number) for number in claimed.groups())
with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:  # a port where nobody listens
    probe.bind(("127.0.0.1", 0))
    nobody = probe.getsockname()[1]


def is_claimed(line):
    said = re.fullmatch(LINE, line.strip())
    return bool(said) and abs(float(said.group(1)) - force) <= 0.01 and abs(float(said.group(2)) - height) <= 0.02


for program in PROGRAMS:
    environment = {**os.environ, "HAPTIC_SERVER_PROGRAM": SERVER, "HAPTIC_SERVER": f"127.0.0.1:{nobody}"}
    with subprocess.Popen([program], stdout=subprocess.PIPE, text=True, env=environment) as running:
        end = time.monotonic() + PATIENCE
        good, line = 0, ""
        while good < 30 and time.monotonic() < end:  # for half a second
            line = running.stdout.readline()
            good = good + 1 if is_claimed(line) else 0
        running.kill()
    if good < 30:
        sys.exit(f"the page says {claimed.group(0)!r}, {pathlib.Path(program).name} said {line!r}")
