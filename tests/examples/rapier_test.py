#!/usr/bin/python3
"""The Rapier example: a box presses, slides, pushes, lifts and enters a hole.

Usage: rapier_test.py HAPTIC_SERVER LIBHAPTIC EXAMPLE
"""

import os
import pathlib
import subprocess
import sys
import unittest

SERVER, LIBRARY, EXAMPLE = (pathlib.Path(argument).resolve() for argument in sys.argv[1:4])
sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "support"))

import hand_session  # noqa: E402
from touch_tasks import TouchTasks  # noqa: E402


def run(*command, stall=0):
    """Its output."""
    return hand_session.run(["node", *command], stall, env={**os.environ, "HAPTIC_LIBRARY": str(LIBRARY)})


class Refusal(unittest.TestCase):
    def says(self, reason, *arguments):
        refused = subprocess.run(["node", EXAMPLE, *arguments], capture_output=True, text=True, timeout=60,
                                 env={**os.environ, "HAPTIC_LIBRARY": str(LIBRARY)})
        self.assertEqual(refused.returncode, 1)
        self.assertRegex(refused.stderr, f"^touch.js: .*{reason}.*\\n$")

    def test_what_cannot_be_used_is_named(self):
        self.says("scene must be .* not chair", "chair")
        self.says("seconds must be", "table", "127.0.0.1:47800", "long")
        self.says("rate must be", "table", "127.0.0.1:47800", "1", "0")
        self.says("nowhere", "table", "nowhere", "1", "60")


class Touch(TouchTasks, unittest.TestCase):
    # A frame that comes late moves bodies late.
    largest_jump_of_bodies = 0.3  # N
    largest_deviation_of_load = 0.1  # N

    @staticmethod
    def play(scene, seconds, hand, *options, rate=60, stall=0):
        return hand_session.play(SERVER, hand, options,
                                 lambda address: run(EXAMPLE, scene, address, str(seconds), str(rate), stall=stall))


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1] + sys.argv[4:], verbosity=2)
