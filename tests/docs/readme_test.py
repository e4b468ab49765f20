#!/usr/bin/python3
"""The program of README.md, as it stands there, presses with what the README says.

Usage: readme_test.py HAPTIC_SERVER LIBHAPTIC SOURCE, with the Python of an environment in .venv that has MuJoCo's binding
"""

import os
import pathlib
import re
import socket
import subprocess
import sys
import time

SERVER, LIBRARY, SOURCE = (pathlib.Path(argument).resolve() for argument in sys.argv[1:4])
text = (SOURCE / "README.md").read_text()
program = re.search(r"^    import time\n(?:    .*\n|\n)+", text, re.M).group(0).replace("\n    ", "\n")[4:]
claimed = float(re.search(r"It ends at `active: (\S+) N`", text).group(1))

with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:  # a port where nobody listens
    probe.bind(("127.0.0.1", 0))
    port = probe.getsockname()[1]
client = subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE, text=True, cwd=SOURCE,
                          env={**os.environ, "HAPTIC_LIBRARY": str(LIBRARY), "HAPTIC_SERVER_PROGRAM": str(SERVER),
                               "HAPTIC_SERVER": f"127.0.0.1:{port}",
                               "PYTHONPATH": f"{SOURCE}/client/python"})
time.sleep(6)
client.terminate()
lines = client.communicate(timeout=10)[0].splitlines()
said = re.fullmatch(r"active: (\S+) N", lines[-2] if len(lines) > 1 else "")
if not said or abs(float(said.group(1)) - claimed) > 0.02:
    sys.exit(f"the README says {claimed} N, the program said {lines[-2:]!r}")
