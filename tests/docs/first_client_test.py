#!/usr/bin/python3
"""The first client of docs/first_ten_minutes.md, as it stands there, presses with what the page says.

Usage: first_client_test.py LIBHAPTIC SOURCE
"""

import os
import pathlib
import re
import subprocess
import sys
import time

LIBRARY, SOURCE = (pathlib.Path(argument).resolve() for argument in sys.argv[1:3])
page = (SOURCE / "docs/first_ten_minutes.md").read_text()
program = re.search(r"^    import time\n(?:    .*\n|\n)+", page, re.M).group(0).replace("\n    ", "\n")[4:]
claimed = re.search(r"It ends at `active: (\S+) N, (\S+) mm`", page)

client = subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE, text=True,
                          env={**os.environ, "HAPTIC_LIBRARY": str(LIBRARY),
                               "PYTHONPATH": str(SOURCE / "client/python")})
time.sleep(4)
client.terminate()
last = client.communicate(timeout=10)[0].splitlines()[-2]

said = re.fullmatch(r"active: (\S+) N, (\S+) mm", last)
if not said or abs(float(said.group(1)) - float(claimed.group(1))) > 0.01 or \
        abs(float(said.group(2)) - float(claimed.group(2))) > 0.02:
    sys.exit(f"the page says {claimed.group(0)!r}, the client said {last!r}")
