"""What a test of a package is given: NAME_test.py HAPTIC_SERVER LIBHAPTIC [TEST …]. Import it first: it finds the package
haptic and what tests share."""

import os
import pathlib
import subprocess
import sys
import unittest

PROJECT = pathlib.Path(__file__).resolve().parents[2]
SERVER, LIBRARY = (pathlib.Path(argument).resolve() for argument in sys.argv[1:3])
PYTHON = PROJECT / "client/python"
os.environ.update(HAPTIC_SERVER_PROGRAM=str(SERVER), HAPTIC_PROGRAMS=str(SERVER.parent), HAPTIC_LIBRARY=str(LIBRARY), HAPTIC_SERVER="127.0.0.1:9",
                  PYTHONPATH=str(PYTHON))
sys.path[:0] = [str(PYTHON), str(PROJECT / "tests/support")]


def last_line_of(example, *arguments):
    """What an example prints last, which starts a server of its own."""
    printed = subprocess.run([sys.executable, PROJECT / "examples" / example, *arguments], stdout=subprocess.PIPE, text=True,
                             timeout=60, check=True).stdout
    print(printed.splitlines()[-1])
    return printed.splitlines()[-1]


def main():
    unittest.main(argv=sys.argv[:1] + sys.argv[3:], verbosity=2)
